"""Tests of judging a whole run."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from frontend.heightfield import Heightfield
from frontend.loop_closures import LoopClosure
from frontend.recording import Truth
from frontend.trajectory import Trajectory
from sssslam.evaluation.run import evaluate_run


@dataclass(frozen=True)
class Finished:
    """A run that found nothing, at the place of its terrain."""

    trajectory: Trajectory
    trajectory_dr: Trajectory
    sigmas: Any
    seafloor: Heightfield
    seafloor_sigma: Any
    loop_closures: tuple[LoopClosure, ...] = ()
    submaps: tuple[()] = ()

    @property
    def anchor_time(self) -> dict[int, float]:
        return {}


@pytest.fixture
def run(track: Trajectory, track_ref: Trajectory) -> Finished:
    """A run that undid all drift."""
    seafloor = Heightfield(np.random.default_rng(0).random((30, 30)), 1.0, (0.0, 0.0))
    return Finished(track_ref, track, np.ones((len(track), 4)), seafloor, np.ones((30, 30)))


def test_a_run_is_judged_in_all_its_rooms(run: Finished, track_ref: Trajectory) -> None:
    metrics = evaluate_run(run, Truth(track_ref, run.seafloor))
    found = {metric.name: metric.value for metric in metrics}
    assert metrics[0].name == "ate"
    assert len(found) == len(metrics)
    assert found["ate"] == pytest.approx(0.0, abs=1e-9)
    assert found["ate_dr"] > 0.1
    assert found["closures_true"] == 0
    assert found["map_rmse"] == 0.0
    assert np.isnan(found["submap_rmse"])


def test_without_a_terrain_shape_is_not_judged(run: Finished, track_ref: Trajectory) -> None:
    names = {metric.name for metric in evaluate_run(run, Truth(track_ref))}
    assert not any(name.startswith(("map_", "submap_")) for name in names)
