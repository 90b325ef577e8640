"""Tests of everything a run leaves."""

import hashlib
import json
import re
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copytree
from types import SimpleNamespace

import numpy as np
import pytest

from sssslam.products.result import Result
from sssslam.products.write import add_metrics, format_config

TIMINGS = re.compile(rb"<!-- timings -->.*<!-- /timings -->", re.DOTALL)


def digests(out: Path) -> dict[str, str]:
    """Every product but wall times."""
    contents = {str(path.relative_to(out)): path.read_bytes() for path in out.rglob("*") if path.is_file()}
    contents["report.html"] = TIMINGS.sub(b"", contents["report.html"])
    manifest = {key: value for key, value in json.loads(contents["run.json"]).items() if key != "timings"}
    contents["run.json"] = json.dumps(manifest).encode()
    return {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}


def test_a_run_leaves_every_file_of_the_contract(result: Result, written: Path) -> None:
    names = {str(path.relative_to(written)) for path in written.rglob("*") if path.is_file()}
    submaps = {f"submaps/{submap.number:04d}.ply" for submap in result.submaps}
    figures = {name for name in names if name.startswith("figures/")}
    assert names - submaps - figures == {
        *("trajectory.tum", "trajectory_dr.tum", "trajectory.csv", "trajectory.geojson", "loop_closures.csv"),
        *("trajectory_ref.tum", "graph.g2o", "seafloor.tif", "mosaic.tif", "report.html", "config.toml", "run.json"),
    }
    assert submaps <= names
    assert "figures/tracks.png" in figures


def test_a_second_run_writes_the_same_bytes_but_for_wall_times(result: Result, written: Path, tmp_path: Path) -> None:
    replace(result, timings={"reconstruction": 99.0, "matching": 1.0}).write(tmp_path / "again")
    assert digests(tmp_path / "again") == digests(written)
    assert (tmp_path / "again" / "run.json").read_bytes() != (written / "run.json").read_bytes()


def test_a_smaller_run_into_the_same_folder_leaves_nothing_of_the_larger(
    result: Result, written: Path, tmp_path: Path
) -> None:
    out = Path(copytree(written, tmp_path / "out"))
    (out / "notes.txt").write_text("mine")
    recording = replace(result.recording, georeference=None)
    fewer = replace(
        result,
        recording=recording,
        submaps=result.submaps[:2],
        T_world_submap=result.T_world_submap[:2],
        loop_closures=(),
    )
    fewer.write(out)
    assert sorted(path.name for path in (out / "submaps").iterdir()) == ["0000.ply", "0001.ply"]
    assert not (out / "trajectory.geojson").exists()
    assert not (out / "figures" / "closures.png").exists()
    assert (out / "notes.txt").read_text() == "mine"
    assert "No two submaps were compared" in (out / "report.html").read_text()


def test_a_dive_of_one_ping_and_no_submap_is_written(make_result: Callable[..., Result], tmp_path: Path) -> None:
    result = make_result()
    bare = replace(
        result,
        recording=result.recording[:1],
        trajectory=result.trajectory[:1],
        sigmas=result.sigmas[:1],
        submaps=(),
        T_world_submap=np.empty((0, 4, 4)),
        loop_closures=(),
        timings={},
    )
    bare.write(tmp_path / "out")
    assert (tmp_path / "out" / "seafloor.tif").is_file()
    assert len((tmp_path / "out" / "trajectory.tum").read_text().splitlines()) == 1


def test_the_config_is_read_back_as_it_was(written: Path) -> None:
    config = tomllib.loads((written / "config.toml").read_text())
    assert config == {"seed": 7, "windows": {"length": 30.0, "overlap": 0.5}, "matching": {"radius": 8.0}}


def test_a_key_without_a_value_is_left_out_at_any_depth() -> None:
    assert tomllib.loads(format_config({"a": {"b": {"c": None, "d": [1, 2]}}, "e": None})) == {
        "a": {"b": {"d": [1, 2]}}
    }


def test_metrics_are_added_to_a_finished_run(result: Result, written: Path, tmp_path: Path) -> None:
    out = Path(copytree(written, tmp_path / "out"))
    before = digests(out)
    metric = SimpleNamespace(name="ate", value=0.5, unit="m", how="horizontal")
    assert result.recording.truth is not None
    add_metrics(out, [metric], result.recording.truth.trajectory[::3])
    assert json.loads((out / "run.json").read_text())["metrics"] == [
        {"name": "ate", "value": 0.5, "unit": "m", "how": "horizontal"}
    ]
    after = digests(out)
    changed = {name for name in after if after[name] != before[name]}
    assert changed == {"run.json", "report.html", "figures/tracks.png"}


def test_adding_metrics_twice_replaces_them_and_keeps_the_timings(written: Path, tmp_path: Path) -> None:
    out = Path(copytree(written, tmp_path / "out"))
    for value in (0.5, 0.25):
        add_metrics(out, [SimpleNamespace(name="ate", value=value, unit="m", how="")])
    manifest = json.loads((out / "run.json").read_text())
    assert [metric["value"] for metric in manifest["metrics"]] == [0.25]
    assert manifest["timings"][0]["seconds"] == 12.346
    assert (out / "figures" / "tracks.png").read_bytes() == (written / "figures" / "tracks.png").read_bytes()


def test_metrics_of_a_folder_that_is_no_run_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="the folder of a finished run is wanted"):
        add_metrics(tmp_path, [])


def test_a_result_that_cannot_be_written_leaves_the_earlier_run(result: Result, written: Path, tmp_path: Path) -> None:
    out = Path(copytree(written, tmp_path / "out"))
    before = digests(out)
    stranger = replace(result.loop_closures[0], target=0, source=999)
    with pytest.raises(ValueError, match="must join submaps of the run, got 999"):
        replace(result, loop_closures=(stranger,)).write(out)
    assert digests(out) == before


def test_writing_changes_nothing_in_the_result(make_result: Callable[..., Result], tmp_path: Path) -> None:
    result, untouched = make_result(), make_result()
    result.write(tmp_path / "out")
    np.testing.assert_array_equal(result.submaps[3].surface.z, untouched.submaps[3].surface.z)
    np.testing.assert_array_equal(result.T_world_submap, untouched.T_world_submap)
    np.testing.assert_array_equal(result.recording.port, untouched.recording.port)
