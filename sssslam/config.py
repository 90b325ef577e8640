"""The configuration: every stage's section gathered, read from TOML, resolved with the data."""

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from backend.consistency import ConsistencyConfig, suit_overlap
from backend.dead_reckoning import DeadReckoningConfig
from backend.do_no_harm import DoNoHarmConfig
from backend.pose_graph import PoseGraphConfig
from frontend.bottom import BottomConfig
from frontend.features import FeatureConfig
from frontend.loop_closures import LoopClosureConfig
from frontend.radiometry import RadiometryConfig
from frontend.reconstruction import ReconstructionConfig
from frontend.reconstruction.joint import cell_spacing
from frontend.recording import Recording
from frontend.window_defaults import suit_track
from frontend.windows import WindowConfig, resolve_windows
from sssslam.dead_reckoning import suit_sensors
from sssslam.mapping import MapConfig


class Config(BaseModel):
    """All sections; each lives beside its stage."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    windows: WindowConfig = WindowConfig()
    bottom: BottomConfig = BottomConfig()
    radiometry: RadiometryConfig = RadiometryConfig()
    reconstruction: ReconstructionConfig = ReconstructionConfig()
    features: FeatureConfig = FeatureConfig()
    loop_closures: LoopClosureConfig = LoopClosureConfig()
    dead_reckoning: DeadReckoningConfig = DeadReckoningConfig()
    consistency: ConsistencyConfig = ConsistencyConfig()
    pose_graph: PoseGraphConfig = PoseGraphConfig()
    do_no_harm: DoNoHarmConfig = DoNoHarmConfig()
    map: MapConfig = MapConfig()
    seed: int = Field(default=0, ge=0, description="Seed of every random draw [1].")


def load_config(path: str | Path | None = None, settings: Iterable[str] = ()) -> Config:
    """Read a configuration.

    Parameters
    ----------
    path : str or Path or None
        A TOML file with any of the sections and keys; what it leaves out has its default.
    settings : iterable of str
        ``section.key=value``, applied after the file.

    Returns
    -------
    config : Config
        Checked.

    Raises
    ------
    ValueError
        One line: the file is not there or no TOML, or the first key that is unknown or has a wrong value.
    """
    tree = {} if path is None else _read_toml(Path(path))
    for setting in settings:
        _apply(tree, setting)
    try:
        return Config.model_validate(tree)
    except ValidationError as error:
        raise ValueError(_explain(error)) from None


def resolve(config: Config, recording: Recording) -> Config:
    """Fill in what is left to the data of a whole dive.

    Parameters
    ----------
    config : Config
        A configuration with open keys.
    recording : Recording
        The dive: its range says how large a cell is, its range and its track how long a window, that how far apart
        closures have votes of their own, its sensors how much the track drifts and shears windows.

    Returns
    -------
    resolved : Config
        The same with every key set.
    """
    windows = suit_track(config.windows, float(recording.slant_range_max.max()), recording.trajectory_dr)
    return resolve_pings(config.model_copy(update={"windows": windows}), recording)


def resolve_pings(config: Config, recording: Recording) -> Config:
    """Fill in what is left to the data of a dive that goes on.

    Parameters
    ----------
    config : Config
        A configuration with open keys.
    recording : Recording
        Some pings: nobody knows how long their track will be and whether it turns back.

    Returns
    -------
    resolved : Config
        The same with every key set, as by `resolve` but for the windows: 1.5 slant ranges long.
    """
    reach = float(recording.slant_range_max.max())
    windows = resolve_windows(config.windows, reach, recording.ping_spacing)
    methods = {name: method for name, method in config.reconstruction if hasattr(method, "spacing")}
    cells = {name: method.spacing or cell_spacing(reach) for name, method in methods.items()}
    methods = {name: method.model_copy(update={"spacing": cells[name]}) for name, method in methods.items()}
    reconstruction = config.reconstruction.model_copy(update=methods)
    drift = suit_sensors(config.dead_reckoning, recording)
    assert windows.overlap is not None
    consistency = suit_overlap(config.consistency, windows.overlap)
    closures = _with_misalignment(config.loop_closures, drift.velocity_misalignment_sd)
    suited = {"reconstruction": reconstruction, "dead_reckoning": drift, "consistency": consistency}
    return config.model_copy(update={"windows": windows, "loop_closures": closures, **suited})


def _with_misalignment(config: LoopClosureConfig, misalignment: float) -> LoopClosureConfig:
    """The closures' section, its windows sheared as much as dead reckoning says where that is left open."""
    if config.registration.misalignment is not None:
        return config
    registration = config.registration.model_copy(update={"misalignment": misalignment})
    return config.model_copy(update={"registration": registration})


def default_toml() -> str:
    """The default configuration as TOML, each key with its unit and reason.

    Returns
    -------
    text : str
        TOML that `load_config` reads back to the defaults.
    """
    document = tomlkit.document()
    _document(document, Config())
    return tomlkit.dumps(document)


def _read_toml(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise ValueError(f"{path} is {'a folder' if path.is_dir() else 'not there'}; a TOML file is wanted")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no TOML: {error}") from None


def _document(table: Any, section: BaseModel) -> None:
    """Add the keys of a section, then its own sections; what the data decide stands in a comment."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            continue
        table.add(tomlkit.comment(field.description or name))
        table.add(tomlkit.comment(f"{name} =") if value is None else name, *([] if value is None else [value]))
    for name in type(section).model_fields:
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            child = tomlkit.table()
            _document(child, value)
            table.add(name, child)


def _apply(tree: dict[str, Any], setting: str) -> None:
    key, equals, text = setting.partition("=")
    if not equals or not key.strip():
        raise ValueError(f"a setting reads section.key=value, got {setting!r}")
    try:
        value = tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    *sections, last = key.strip().split(".")
    for section in sections:
        tree = tree.setdefault(section, {})
        if not isinstance(tree, dict):
            raise ValueError(f"{section} in {setting!r} is a key, not a section")
    tree[last] = value


def _explain(error: ValidationError) -> str:
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        known = _keys(first["loc"][:-1])
        close = difflib.get_close_matches(str(first["loc"][-1]), known, n=1)
        hint = f"did you mean {close[0]}?" if close else f"known are {', '.join(known)}"
        return f"the configuration has no key {where}; {hint}"
    given = "a section" if isinstance(first["input"], Mapping) else f"{first['input']!r:.60}"
    if first["type"] == "model_type":
        return f"{where} is a section of the configuration, keys wanted, got {given}"
    message = first["msg"][:1].lower() + first["msg"][1:]
    return f"{where} of the configuration: {message}, got {given}"


def _keys(path: tuple[str | int, ...]) -> list[str]:
    section: Any = Config()
    for name in path:
        section = getattr(section, str(name))
    return list(type(section).model_fields)
