"""Straight legs of a track, and how far the drift goes over each."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import wrap_angle
from frontend.trajectory import Trajectory
from sssslam.evaluation.association import associate
from sssslam.evaluation.metric import Metric, root_mean_square

_HALF_WINDOW = 10.0  # m of track before and after a pose, over which it turns little on a leg
_MAX_TURN = np.deg2rad(10.0)
_MIN_LENGTH = 30.0  # m


def straight_legs(trajectory: Trajectory) -> list[tuple[int, int]]:
    """Find where a track runs straight.

    Parameters
    ----------
    trajectory : Trajectory
        The track.

    Returns
    -------
    legs : list of tuple of int
        First and last pose of every leg: at least 30 m on which the course turns less than 10 degrees in 20 m.
    """
    along, yaw = trajectory.distance, np.unwrap(trajectory.yaw)
    if len(trajectory) < 2 or along[-1] < _MIN_LENGTH:
        return []
    run = along + 1e-9 * np.arange(along.size)  # a vehicle that stands still goes on
    before, after = (np.interp(np.clip(run + d, run[0], run[-1]), run, yaw) for d in (-_HALF_WINDOW, _HALF_WINDOW))
    straight = np.concatenate([[False], np.abs(after - before) < _MAX_TURN, [False]])
    first, past = np.flatnonzero(np.diff(straight.astype(np.int8))).reshape(-1, 2).T
    legs = zip(first.tolist(), (past - 1).tolist(), strict=True)
    return [(begin, end) for begin, end in legs if along[end] - along[begin] >= _MIN_LENGTH]


def rpe_legs(trajectory: Trajectory, trajectory_ref: Trajectory) -> tuple[Metric, Metric]:
    """Relative pose error from begin to end of each straight leg of the reference.

    Parameters
    ----------
    trajectory, trajectory_ref : Trajectory
        The track and the reference, on the same clock.

    Returns
    -------
    translation, yaw : Metric
        Root mean squares of the horizontal shift [m] and of the turn [rad] between level frames; NaN without a leg.
    """
    matched, matched_ref, _ = associate(trajectory, trajectory_ref)
    legs = np.array(straight_legs(matched_ref), dtype=np.int64).reshape(-1, 2)
    shift = _relative_shift(matched, legs) - _relative_shift(matched_ref, legs)
    turn = wrap_angle(np.diff(matched.yaw[legs], axis=1) - np.diff(matched_ref.yaw[legs], axis=1))[:, 0]
    how = f"between level frames from begin to end of {len(legs)} straight legs"
    return (
        Metric("rpe_leg", root_mean_square(np.linalg.norm(shift, axis=1)), "m", f"horizontal, {how}"),
        Metric("rpe_yaw_leg", root_mean_square(turn), "rad", how),
    )


def _relative_shift(trajectory: Trajectory, legs: np.ndarray) -> FloatArray:
    """Position of the last pose of each leg in the level frame of the first, shape (L, 2)."""
    dx, dy = (np.diff(axis[legs], axis=1)[:, 0] for axis in (trajectory.x, trajectory.y))
    c, s = np.cos(trajectory.yaw[legs[:, 0]]), np.sin(trajectory.yaw[legs[:, 0]])
    return np.stack([c * dx + s * dy, c * dy - s * dx], axis=-1)
