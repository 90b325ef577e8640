"""Tests of run.json."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from frontend.trajectory import Trajectory
from sssslam.products.manifest import describe_metrics, describe_run, describe_track, format_manifest, read_manifest
from sssslam.products.result import Result


def straight(x: list[float], y: float = 0.0) -> Trajectory:
    zeros = np.zeros(len(x))
    return Trajectory(np.arange(len(x)) * 1.0, np.array(x), zeros + y, zeros, zeros, zeros, zeros)


def test_the_shift_of_a_track_is_horizontal() -> None:
    described = describe_track(straight([0.0, 3.0, 6.0]), straight([0.0, 3.0, 6.0], y=2.0))
    assert described == {"distance": 6.0, "shift_rms": 2.0, "shift_max": 2.0}


def test_a_run_is_described_with_what_it_needs_to_be_run_again(result: Result) -> None:
    manifest = json.loads(format_manifest(describe_run(result, ())))
    assert manifest["seed"] == 7
    assert manifest["input"]["sha256"] == "ab" * 32
    assert manifest["counts"]["pings"] == len(result.trajectory)
    assert manifest["counts"]["pings_dropped"] == 1
    assert manifest["versions"]["python"].startswith("3.")
    assert {"numpy", "gtsam", "rasterio"} <= manifest["versions"]["packages"].keys()
    assert "pytest" not in manifest["versions"]["packages"]
    assert [row["stage"] for row in manifest["timings"]] == ["reconstruction", "matching"]


def test_keys_are_sorted(result: Result) -> None:
    text = format_manifest(describe_run(result, ()))
    assert text == json.dumps(json.loads(text), indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def test_only_timings_differ_between_two_runs(result: Result) -> None:
    slower = replace(result, timings={stage: 2 * seconds for stage, seconds in result.timings.items()})
    a, b = (describe_run(run, ()) for run in (result, slower))
    assert {key for key in a if a[key] != b[key]} == {"timings"}


def test_a_note_that_two_stages_give_is_told_once(result: Result) -> None:
    twice = replace(result, notes=(*result.recording.notes, "Port is the finer channel."))
    assert describe_run(twice, ())["notes"] == ["Ping 0 had no position.", "Port is the finer channel."]


def test_what_looks_wrong_in_the_recording_is_told_with_advice(result: Result) -> None:
    findings = describe_run(result, ())["findings"]
    assert any(row["what"].startswith("altitude does not change") and row["advice"] for row in findings)


def test_an_unknown_metric_is_null() -> None:
    metric = SimpleNamespace(name="rpe_50m", value=float("nan"), unit="m", how="0 pairs")
    assert describe_metrics([metric]) == [{"name": "rpe_50m", "value": None, "unit": "m", "how": "0 pairs"}]


@pytest.mark.parametrize(
    ("text", "message"), [("{", "cannot read it"), ("[]", "it lacks"), ("{}", "it lacks versions")]
)
def test_a_file_that_describes_no_run_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(ValueError, match=message):
        read_manifest(tmp_path / "run.json")
