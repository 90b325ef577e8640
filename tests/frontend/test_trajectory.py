"""Trajectories: there and back to poses, slices, distance run."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from frontend.trajectory import Trajectory


def track(x: list[float], y: list[float]) -> Trajectory:
    n = len(x)
    zero = np.zeros(n)
    return Trajectory(np.arange(n) + 5.0, np.array(x), np.array(y), zero - 20.0, zero, zero, zero)


def test_distance_is_horizontal_and_starts_at_zero() -> None:
    np.testing.assert_allclose(track([0, 3, 3, 0], [0, 4, 4, 8]).distance, [0, 5, 5, 10])


def test_a_single_ping_has_run_nowhere() -> None:
    np.testing.assert_array_equal(track([7.0], [1.0]).distance, [0.0])


# pitch away from the vertical, where yaw is not defined
@given(arrays(float, (6, 4), elements=st.floats(-1.5, 1.5)))
def test_poses_and_back_are_the_same_trajectory(values: np.ndarray) -> None:
    trajectory = Trajectory(np.arange(4.0), *values)
    again = Trajectory.from_poses(trajectory.time, trajectory.poses)
    for name in ("time", "x", "y", "z", "roll", "pitch", "yaw"):
        np.testing.assert_allclose(getattr(again, name), getattr(trajectory, name), atol=1e-13)


def test_poses_hold_positions_in_their_last_column() -> None:
    trajectory = track([1, 2], [3, 4])
    np.testing.assert_array_equal(trajectory.poses[:, :3, 3], trajectory.positions)
    np.testing.assert_array_equal(trajectory.positions, [[1, 3, -20], [2, 4, -20]])


def test_a_slice_and_a_choice_of_pings_are_trajectories() -> None:
    trajectory = track([0, 1, 2, 3], [0, 0, 0, 0])
    assert len(trajectory[1:3]) == 2
    np.testing.assert_array_equal(trajectory[np.array([3, 0])].x, [3, 0])
    np.testing.assert_array_equal(trajectory[trajectory.x > 1].time, [7, 8])


def test_joined_halves_are_the_whole() -> None:
    trajectory = track([0, 1, 2, 3], [5, 6, 7, 8])
    whole = trajectory[:1].joined(trajectory[1:])
    for name in ("time", "x", "y", "z", "roll", "pitch", "yaw"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(trajectory, name))
