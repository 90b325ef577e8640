"""The configuration: what is misspelt or wrong is named in one line; what is written out reads back."""

import re
import tomllib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from frontend.recording import Recording
from sssslam.config import Config, default_toml, load_config, resolve, resolve_pings
from tests.frontend.flat_floor import FlatFloor


def recording(slant_range: float) -> Recording:
    return FlatFloor(np.full(3, 2.0), n_samples=round(slant_range / 0.05)).record(np.random.default_rng(1))


def sections(section: BaseModel, path: str = "") -> list[tuple[str, BaseModel]]:
    """Every section of a configuration, by its path."""
    found = [(path, section)]
    for name in type(section).model_fields:
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            found += sections(value, f"{path}.{name}".strip("."))
    return found


def test_the_default_reads_back_from_its_toml(tmp_path: Path) -> None:
    path = tmp_path / "default.toml"
    path.write_text(default_toml(), encoding="utf-8")
    assert load_config(path) == Config() == load_config()


def test_the_default_toml_shows_every_key_with_a_reason() -> None:
    lines = default_toml().splitlines()
    for _, section in sections(Config()):
        for name, field in type(section).model_fields.items():
            if not isinstance(getattr(section, name), BaseModel):
                assert field.description, f"{name} has no description"
                at = lines.index(f"# {field.description}")
                assert lines[at + 1].removeprefix("# ").startswith(f"{name} =")


def test_no_key_can_be_changed_or_added_afterwards() -> None:
    for path, section in sections(Config()):
        assert section.model_config.get("frozen"), path
        assert section.model_config.get("extra") == "forbid", path


def test_a_file_changes_what_it_names_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_text("[windows]\nlength = 80\n[reconstruction.joint.solver]\nn_steps = 5\n")
    config = load_config(path)
    assert config.windows.length == 80.0
    assert config.reconstruction.joint.solver.n_steps == 5
    assert config.windows.overlap == Config().windows.overlap
    assert config.features == Config().features


def test_settings_win_over_the_file(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_text("seed = 3\n[windows]\nlength = 80\n")
    config = load_config(path, ["windows.length=60", " windows.overlap = 0.25", "reconstruction.method=joint"])
    assert (config.seed, config.windows.length, config.windows.overlap) == (3, 60.0, 0.25)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("windows.lenght=80", "the configuration has no key windows.lenght; did you mean length?"),
        ("window.length=80", "the configuration has no key window; did you mean windows?"),
        ("reconstruction.joint.solver.steps=2", "no key reconstruction.joint.solver.steps; did you mean n_steps?"),
        ("bottom.zzz=1", "the configuration has no key bottom.zzz; known are blanking, step_length"),
        ("windows.length=-1", "windows.length of the configuration: input should be greater than 0, got -1"),
        ("windows.length=nan", "windows.length of the configuration: input should be"),
        ("bottom.blanking=inf", "bottom.blanking of the configuration: input should be a finite number, got inf"),
        ("bottom.n_pings=2.5", "bottom.n_pings of the configuration: input should be a valid integer"),
        ("bottom.n_pings=many", "bottom.n_pings of the configuration: input should be a valid integer"),
        ("windows.length.x=1", "windows.length of the configuration: input should be a valid number, got a section"),
        ("windows=5", "windows is a section of the configuration, keys wanted, got 5"),
        ("reconstruction.method=magic", "reconstruction.method of the configuration: input should be 'coiras'"),
        ("seed=", "seed of the configuration: input should be a valid integer"),
        ("windows.length", "a setting reads section.key=value, got 'windows.length'"),
        ("=5", "a setting reads section.key=value, got '=5'"),
        ("", "a setting reads section.key=value, got ''"),
    ],
)  # fmt: skip
def test_a_wrong_setting_is_refused_in_one_line(setting: str, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)) as refusal:
        load_config(settings=[setting])
    assert "\n" not in str(refusal.value)


def test_a_key_is_no_section() -> None:
    with pytest.raises(ValueError, match=r"windows in 'windows\.length=80' is a key, not a section"):
        load_config(settings=["windows=5", "windows.length=80"])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"windows = [", "is no TOML: "),
        (b"\xff\xfe\x00", "is no TOML: 'utf-8' codec can't decode"),
        (b"[windows]\nlenght = 5\n", "no key windows.lenght; did you mean length?"),
        (b"windows = 'long'\n", "windows is a section of the configuration, keys wanted, got 'long'"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "my.toml"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=re.escape(message)):
        load_config(path)


def test_a_file_that_is_not_there_and_a_folder_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"my\.toml is not there; a TOML file is wanted"):
        load_config(tmp_path / "my.toml")
    with pytest.raises(ValueError, match="is a folder; a TOML file is wanted"):
        load_config(tmp_path)


@given(st.text(max_size=40))
def test_any_setting_is_taken_or_refused_by_a_value_error(text: str) -> None:
    with suppress(ValueError):
        assert isinstance(load_config(settings=[text]), Config)


def test_resolving_fills_in_window_and_cell_from_the_range() -> None:
    resolved = resolve(Config(), recording(55.0))
    assert resolved.windows.length == pytest.approx(82.5)  # one and a half slant ranges
    assert resolved.reconstruction.joint.spacing == pytest.approx(1.0)
    assert resolved.reconstruction.coiras.spacing == pytest.approx(1.0)
    assert "windows" in resolved.model_dump()


def test_resolving_keeps_what_is_set_and_is_done_once() -> None:
    config = load_config(settings=["windows.length=40", "reconstruction.joint.spacing=0.5"])
    resolved = resolve(config, recording(55.0))
    assert (resolved.windows.length, resolved.reconstruction.joint.spacing) == (40.0, 0.5)
    assert resolve(resolved, recording(200.0)) == resolved


@pytest.mark.parametrize(("setting", "stretch"), [("windows.overlap=0.75", 8), ("consistency.stretch=3", 3)])
def test_how_far_apart_closures_vote_follows_the_overlap_of_windows(setting: str, stretch: int) -> None:
    assert resolve(Config(), recording(55.0)).consistency.stretch == 4
    assert resolve(load_config(settings=[setting]), recording(55.0)).consistency.stretch == stretch


def test_windows_are_sheared_as_much_as_dead_reckoning_says_unless_closures_are_told() -> None:
    said = ["dead_reckoning.velocity_misalignment_sd=0.002"]
    told = [*said, "loop_closures.registration.misalignment=0.03"]
    for resolving in (resolve, resolve_pings):
        left_open, set_ = (resolving(load_config(settings=s), recording(55.0)).loop_closures for s in (said, told))
        assert (left_open.registration.misalignment, set_.registration.misalignment) == (0.002, 0.03)


def turning_back(slant_range: float) -> Recording:
    """A dive of 120 m that turns by one and a half circles, its speed from a log through the water."""
    n, dive = 400, FlatFloor(np.full(400, 2.0), n_samples=round(slant_range / 0.05)).record(np.random.default_rng(1))
    yaw = np.linspace(0.0, 3 * np.pi, n)
    x, y = np.cumsum(0.3 * np.cos(yaw)), np.cumsum(0.3 * np.sin(yaw))
    log = {"time": dive.ping_time, "speed": np.full(n, 1.5)}
    return replace(dive, trajectory_dr=replace(dive.trajectory_dr, x=x, y=y, yaw=yaw), sensors={"speed_log": log})


def test_resolving_a_dive_fills_in_what_its_track_and_its_sensors_ask_for() -> None:
    dive = turning_back(20.0)
    resolved = resolve(Config(), dive)
    assert resolved.windows.length == pytest.approx(dive.trajectory_dr.distance[-1] / 9)
    assert (resolved.windows.overlap, resolved.dead_reckoning.velocity_scale_sd) == (0.8, 0.1)
    assert resolved.loop_closures.registration.misalignment == resolved.dead_reckoning.velocity_misalignment_sd == 0.1
    assert resolved.consistency.stretch == 10  # two window lengths
    assert resolve(resolved, turning_back(30.0)) == resolved


def test_a_dive_that_goes_on_has_the_windows_of_its_range() -> None:
    resolved = resolve_pings(Config(), turning_back(20.0))
    assert (resolved.windows.length, resolved.windows.overlap) == (30.0, 0.5)
    assert resolved.dead_reckoning.velocity_scale_sd == 0.1


def test_a_resolved_configuration_has_no_open_key(tmp_path: Path) -> None:
    resolved = resolve(Config(), recording(55.0))
    assert None not in [value for _, section in sections(resolved) for value in section.__dict__.values()]
    path = tmp_path / "config.toml"
    path.write_text(tomlkit.dumps(resolved.model_dump(mode="json")))
    assert load_config(path) == resolved
    assert tomllib.loads(path.read_text())["seed"] == 0
