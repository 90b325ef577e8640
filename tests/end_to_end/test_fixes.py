"""A dive that surfaces at its end: what a receiver sees there holds the track, and a wrong fix does not bend it."""

import json
from dataclasses import replace

import numpy as np
import pytest

import sssslam
from sssslam.evaluation.run import evaluate_run
from sssslam.products.run import read_run
from sssslam.readers.netcdf import read_netcdf, write_netcdf
from sssslam.simulation import Scene

# mud, where nothing is recognised: the fixes alone can help
SCENE = Scene.model_validate(
    {
        "seed": 4,
        "terrain": {"size": [240.0, 160.0], "depth": 60.0, "layers": [{"kind": "sediment", "rms": 0.05}]},
        "survey": {"pattern": "legs", "legs": [[-50.0, -10.0, 50.0, -10.0], [50.0, 15.0, -50.0, 15.0]]},
        "drift": {"grade": "mems"},
        "sonar": {"range_max": 50.0},
    }
)


@pytest.fixture(scope="module")
def recording():
    return sssslam.simulate(SCENE)


@pytest.fixture(scope="module")
def run(recording, tmp_path_factory):
    """Runs on the dive with fixes over its last ten seconds that are off by so much; gives what it left."""

    def call(east, north):
        truth = recording.truth.trajectory
        time = truth.time[-1] - np.arange(10.0)[::-1]
        noise = np.random.default_rng(2).standard_normal((2, 10))
        x, y = (np.interp(time, truth.time, axis) + n for axis, n in zip((truth.x, truth.y), noise, strict=True))
        gnss = {"time": time, "position_x": x + east, "position_y": y + north}
        out = tmp_path_factory.mktemp("run")
        write_netcdf(replace(recording, sensors={**recording.sensors, "gnss": gnss}), out / "dive.nc")
        sssslam.slam(read_netcdf(out / "dive.nc"), sssslam.load_config(settings=SETTINGS)).write(out)
        return read_run(out)

    return call


SETTINGS = ["reconstruction.joint.spacing=2.0", "reconstruction.joint.n_levels=1", "radiometry.n_rounds=0"]


def metrics_of(run, recording):
    return {metric.name: metric.value for metric in evaluate_run(run, recording.truth)}


def test_fixes_at_the_end_of_a_dive_take_its_drift_out(run, recording):
    held = run(0.0, 0.0)
    metrics = metrics_of(held, recording)
    assert metrics["ate_unaligned"] < 0.6 * metrics["ate_unaligned_dr"]
    # the middle of ten fixes of a metre each, moved over half a window by dead reckoning
    assert metrics["end_point_error"] < 3.0 < metrics["end_point_error_dr"]
    assert held.manifest["counts"]["fixes"] == 10
    assert "Fixes at the surface: 10 of 10 hold the track, at 1 of its anchors." in held.manifest["notes"]
    assert "10 fixes at the surface moved the track by" in (held.out / "report.html").read_text()


def test_fixes_that_are_wildly_wrong_bend_nothing_and_are_said(run):
    wrong = run(900.0, -700.0)
    np.testing.assert_array_equal(wrong.trajectory.poses, wrong.trajectory_dr.poses)
    assert (wrong.manifest["counts"]["fixes"], wrong.manifest["counts"]["fixes_rejected"]) == (0, 10)
    said = next(note for note in wrong.manifest["notes"] if note.startswith("Fixes at the surface"))
    assert "10 rejected: they lie farther off than dead reckoning can be wrong" in said
    assert json.loads((wrong.out / "run.json").read_text())["track"]["shift_max"] == 0.0
