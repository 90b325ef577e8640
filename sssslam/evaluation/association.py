"""Which poses of two tracks belong together: those of the same time."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from frontend.arrays import BoolArray, FloatArray
from frontend.frames import attitude_from_rotation, rotation_world_body
from frontend.trajectory import Trajectory

_MAX_GAP = (
    10.0  # usual intervals of the reference; over a longer pause a straight line between its poses is no reference
)
_TIME_TOLERANCE = 1e-6  # s: the decimals of a TUM file


def is_covered(trajectory_ref: Trajectory, time: ArrayLike) -> BoolArray:
    """Whether a reference has something to say at some times.

    Parameters
    ----------
    trajectory_ref : Trajectory
        The reference.
    time : array_like, shape (N,)
        Times on the same clock [s].

    Returns
    -------
    covered : ndarray of bool, shape (N,)
        True between the first and the last pose, but not in a pause of more than ten usual intervals.
    """
    time_ref, time = trajectory_ref.time, np.asarray(time, dtype=np.float64)
    inside = (time >= time_ref[0] - _TIME_TOLERANCE) & (time <= time_ref[-1] + _TIME_TOLERANCE)
    if len(time_ref) < 2:
        return inside
    intervals = np.diff(time_ref)
    before = np.clip(np.searchsorted(time_ref, time, side="right") - 1, 0, len(intervals) - 1)
    return np.asarray(inside & ((intervals <= _MAX_GAP * np.median(intervals))[before] | np.isin(time, time_ref)))


def interpolate(trajectory: Trajectory, time: ArrayLike) -> Trajectory:
    """Poses between the poses of a track: positions on straight lines, attitudes on great arcs.

    Parameters
    ----------
    trajectory : Trajectory
        At least one pose.
    time : array_like, shape (N,)
        Times [s]; those before the first and after the last pose get that pose.

    Returns
    -------
    interpolated : Trajectory
        One pose a time.
    """
    time = np.asarray(time, dtype=np.float64)
    x, y, z = (np.interp(time, trajectory.time, getattr(trajectory, name)) for name in ("x", "y", "z"))
    return Trajectory(time, x, y, z, *attitude_from_rotation(_interpolate_rotation(trajectory, time)))


def _interpolate_rotation(trajectory: Trajectory, time: FloatArray) -> FloatArray:
    rotation = rotation_world_body(trajectory.roll, trajectory.pitch, trajectory.yaw)
    if len(trajectory) == 1:
        return np.broadcast_to(rotation, (time.size, 3, 3))
    since = trajectory.time - trajectory.time[0]
    return np.asarray(
        Slerp(since, Rotation.from_matrix(rotation))(np.clip(time - trajectory.time[0], 0.0, since[-1])).as_matrix()
    )


def associate(trajectory: Trajectory, trajectory_ref: Trajectory) -> tuple[Trajectory, Trajectory, BoolArray]:
    """Pair the poses of a track with the reference at the same times.

    Parameters
    ----------
    trajectory : Trajectory
        The track, N poses.
    trajectory_ref : Trajectory
        The reference, on the same clock; it is interpolated.

    Returns
    -------
    matched, matched_ref : Trajectory
        As many poses each.
    is_matched : ndarray of bool, shape (N,)
        Which poses of the track they are.

    Raises
    ------
    ValueError
        If fewer than two poses have a partner.
    """
    covered = is_covered(trajectory_ref, trajectory.time)
    if np.count_nonzero(covered) < 2:
        raise ValueError(
            f"the reference must cover at least two poses of the run on the same clock: the run goes from "
            f"{trajectory.time[0]:.3f} to {trajectory.time[-1]:.3f} s, "
            f"the reference from {trajectory_ref.time[0]:.3f} to {trajectory_ref.time[-1]:.3f} s"
        )
    matched = trajectory[covered]
    return matched, interpolate(trajectory_ref, matched.time), covered
