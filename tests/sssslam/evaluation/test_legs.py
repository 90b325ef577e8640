"""Legs of a track and the drift over each."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.trajectory import Trajectory
from sssslam.evaluation.legs import rpe_legs, straight_legs


def track_of(course: np.ndarray, step: float = 0.5) -> Trajectory:
    """A level track of equal steps along courses."""
    x, y = (np.concatenate([[0.0], np.cumsum(step * f(course))]) for f in (np.cos, np.sin))
    yaw = np.append(course, course[-1])
    zero = np.zeros_like(x)
    return Trajectory(np.arange(x.size, dtype=np.float64), x, y, zero, zero, zero, yaw)


@pytest.fixture
def two_legs() -> Trajectory:
    """100 m east, a turn to the north over 16 m, 100 m north."""
    turn = np.linspace(0.0, np.pi / 2, 32)
    return track_of(np.concatenate([np.zeros(200), turn, np.full(200, np.pi / 2)]))


def test_two_legs_are_found_up_to_their_turn(two_legs: Trajectory) -> None:
    legs = straight_legs(two_legs)
    assert len(legs) == 2
    lengths = [two_legs.distance[b] - two_legs.distance[a] for a, b in legs]
    # 10 m before the turn the window reaches into it; it may turn by 10 degrees of 90
    np.testing.assert_allclose(lengths, 92.0, atol=3.0)


def test_a_circle_has_no_leg() -> None:
    course = np.linspace(0.0, 4 * np.pi, 800)
    track = track_of(course)
    assert straight_legs(track) == []
    assert np.isnan(rpe_legs(track, track)[0].value)


def test_a_short_track_has_no_leg() -> None:
    assert straight_legs(track_of(np.zeros(20))) == []


def test_a_scale_error_drifts_by_its_share_of_each_leg(two_legs: Trajectory) -> None:
    scaled = replace(two_legs, x=1.01 * two_legs.x, y=1.01 * two_legs.y)
    shift, turn = rpe_legs(scaled, two_legs)
    assert shift.value == pytest.approx(0.92, abs=0.03)
    assert turn.value == 0.0
    assert "2 straight legs" in shift.how


def test_a_rigid_motion_of_the_track_changes_nothing(two_legs: Trajectory) -> None:
    c, s = np.cos(0.4), np.sin(0.4)
    x, y = c * two_legs.x - s * two_legs.y + 7.0, s * two_legs.x + c * two_legs.y - 3.0
    shift, turn = rpe_legs(replace(two_legs, x=x, y=y, yaw=two_legs.yaw + 0.4), two_legs)
    assert shift.value == pytest.approx(0.0, abs=1e-9)
    assert turn.value == pytest.approx(0.0, abs=1e-12)
