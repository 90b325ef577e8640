"""Scenes: TOML files that say what is simulated. What is not said has a default; what is wrong is refused by name."""

import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from sssslam.simulation.absorption import WaterConfig
from sssslam.simulation.drift import DriftConfig
from sssslam.simulation.receiver import FloatRecorder, ReceiverConfig, Recorder
from sssslam.simulation.seabed import Lambert, Seabed
from sssslam.simulation.sensors import SensorsConfig
from sssslam.simulation.sonar import SonarConfig
from sssslam.simulation.speckle import SpeckleConfig
from sssslam.simulation.survey import Lawnmower
from sssslam.simulation.survey_curves import Survey
from sssslam.simulation.terrain import TerrainConfig
from sssslam.simulation.vehicle import VehicleConfig


class Scene(BaseModel):
    """Everything a simulated dive depends on."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: str = Field(default="scene", description="Name of the scene; the source of its recordings.")
    description: str = Field(default="", description="What the scene is for, one line.")
    seed: int = Field(default=0, ge=0, description="Seed of all randomness.")
    position: tuple[float, float] | None = Field(
        default=None, description="Latitude and longitude of the origin [deg]; none: local."
    )
    terrain: TerrainConfig = TerrainConfig()
    seabed: Seabed = Lambert()
    water: WaterConfig = WaterConfig()
    survey: Survey = Lawnmower()
    vehicle: VehicleConfig = VehicleConfig()
    sonar: SonarConfig = Field(default_factory=lambda: SonarConfig.model_validate({}))
    receiver: ReceiverConfig = ReceiverConfig()
    speckle: SpeckleConfig = SpeckleConfig()
    recorder: Recorder = FloatRecorder()
    sensors: SensorsConfig = SensorsConfig()
    drift: DriftConfig = Field(default_factory=lambda: DriftConfig.model_validate({}))

    @field_validator("position")
    @classmethod
    def _on_earth(cls, position: tuple[float, float] | None) -> tuple[float, float] | None:
        if position is not None and not (abs(position[0]) <= 90 and abs(position[1]) <= 360):
            raise ValueError(f"a latitude up to 90 and a longitude up to 360 degrees wanted, got {position}")
        return position

    @model_validator(mode="before")
    @classmethod
    def _usual_kinds(cls, values: Any) -> Any:
        """A section that does not say its kind is of the usual one."""
        if not isinstance(values, dict):
            return values
        usual = (("seabed", "law", "lambert"), ("survey", "pattern", "lawnmower"), ("recorder", "format", "intensity"))
        sections = {
            name: {key: kind, **values[name]} for name, key, kind in usual if isinstance(values.get(name), dict)
        }
        return {**values, **sections}


def scene_names() -> list[str]:
    """Names of the shipped scenes.

    Returns
    -------
    names : list of str
        In alphabetical order.
    """
    return sorted(path.name.removesuffix(".toml") for path in _shipped().iterdir() if path.name.endswith(".toml"))


def load_scene(name_or_path: str | Path) -> Scene:
    """Read a shipped scene or a scene file.

    Parameters
    ----------
    name_or_path : str or Path
        One of `scene_names`, or the path of a TOML file.

    Returns
    -------
    scene : Scene
        The scene, its name that of the file where the file gives none.
    """
    name, path = str(name_or_path), Path(name_or_path)
    if name in scene_names():
        return parse_scene((_shipped() / f"{name}.toml").read_text(encoding="utf-8"), name)
    if not path.is_file():
        raise ValueError(f"{name} given, a scene file or one of {', '.join(scene_names())} wanted")
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{name}: not a text file (byte {error.start})") from error
    return parse_scene(text, path)


def parse_scene(text: str, origin: str | Path) -> Scene:
    """Make a scene of the text of a scene file.

    Parameters
    ----------
    text : str
        TOML.
    origin : str or Path
        Where it comes from: names the scene where the text gives no name, begins error messages, and files the scene
        names are looked for beside it.

    Returns
    -------
    scene : Scene
        The scene.
    """
    path = Path(origin)
    try:
        return Scene.model_validate({"name": path.stem, **tomllib.loads(text)}, context={"folder": path.parent})
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{origin}: not TOML: {error}") from error
    except ValidationError as error:
        raise ValueError(f"{origin}: {_first_problem(error)}") from error


def with_seed(scene: Scene, seed: int) -> Scene:
    """Return the same scene with other random numbers.

    Parameters
    ----------
    scene : Scene
        A scene.
    seed : int
        The new seed, not negative.

    Returns
    -------
    scene : Scene
        The scene with that seed.
    """
    if seed < 0:
        raise ValueError(f"seed must not be negative, got {seed}")
    return scene.model_copy(update={"seed": seed})


def _shipped() -> Any:
    return resources.files("sssslam.simulation") / "scenes"


def _first_problem(error: ValidationError) -> str:
    problems = error.errors()
    first = problems[0]
    where = ".".join(str(part) for part in first["loc"])
    given = "" if first["type"] in ("missing", "value_error") else f", got {first['input']!r:.60}"
    more = f" ({len(problems) - 1} more)" if len(problems) > 1 else ""
    return f"{where}: {first['msg'].removeprefix('Value error, ')}{given}{more}"
