"""The trajectory of an XTF file: its navigation brought into the local frame, held values interpolated."""

import numpy as np

from frontend.arrays import FloatArray, IntArray
from frontend.frames import attitude_from_nautical
from frontend.georeference import Georeference
from frontend.trajectory import Trajectory
from sssslam.readers.held_navigation import fill_unknown, fix_pings, interpolate_positions, interpolate_series
from sssslam.readers.xtf_navigation import RawNavigation

_KNOT = 1852 / 3600
# Speed along the track over that recorded at which the record must be metres per second and not knots.
_METRES_PER_SECOND = (0.8, 1.25)
_N_COURSE = 5


def make_trajectory(
    navigation: RawNavigation, time: FloatArray, georeference: Georeference | None, grid_origin: tuple[float, float]
) -> tuple[Trajectory, list[str]]:
    """Bring the navigation of good pings into the world frame.

    Parameters
    ----------
    navigation : RawNavigation
        Navigation as recorded, positions known.
    time : ndarray, shape (N,)
        Ping times, strictly increasing [s].
    georeference : Georeference or None
        The local frame; None where positions are grid metres.
    grid_origin : tuple of float
        Grid easting and northing of the local frame's origin [m].

    Returns
    -------
    trajectory : Trajectory
        Body poses in the world frame.
    notes : list of str
        What was interpolated or assumed.
    """
    fixes = fix_pings(navigation.east, navigation.north)
    x, y, notes = _local_positions(navigation, time, fixes, georeference, grid_origin)
    roll, pitch, yaw, more = _attitude(navigation, time, fixes, (x, y))
    depth = navigation.depth
    z = -_steady(fill_unknown(time, depth), time, fixes) if np.isfinite(depth).any() else np.zeros(len(time))
    return Trajectory(time, x, y, z, roll, pitch, yaw), notes + more


def _local_positions(
    navigation: RawNavigation,
    time: FloatArray,
    fixes: IntArray,
    georeference: Georeference | None,
    grid_origin: tuple[float, float],
) -> tuple[FloatArray, FloatArray, list[str]]:
    """x and y in the local frame, interpolated where a position is held over several pings."""
    east = np.unwrap(navigation.east, period=360) if georeference else navigation.east
    north, notes = navigation.north, []
    if len(fixes) == 1 and len(time) > 1:
        notes = ["the position never changes"]
    elif len(fixes) < len(time):
        east, north = interpolate_positions(time, east, north, fixes)
        notes = [f"positions change in {len(fixes)} of {len(time)} pings only and are interpolated between"]
    if georeference:
        return *georeference.to_local(north, east), notes
    return east - grid_origin[0], north - grid_origin[1], notes


def _steady(values: FloatArray, time: FloatArray, fixes: IntArray) -> FloatArray:
    """A series interpolated between position fixes if it arrives with them."""
    return interpolate_series(time, values, fixes) if 1 < len(fixes) < len(time) else values


def _attitude(
    navigation: RawNavigation, time: FloatArray, fixes: IntArray, position: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray, list[str]]:
    """Roll, pitch and yaw; level and along the course where they are not recorded."""
    notes, angles = [], []
    for name in ("roll", "pitch", "heading"):
        angle = getattr(navigation, name)
        if not np.isfinite(angle).any():
            assumed = "the course over ground" if name == "heading" else "0"
            notes.append(f"{name} is not recorded: {assumed} is assumed")
            angle = _course(*position) if name == "heading" else np.zeros(len(time))
        elif np.isnan(angle).any():
            notes.append(
                f"{name} is missing or implausible in {np.isnan(angle).sum()} of {len(time)} pings and is interpolated"
            )
        unwrapped = angle.copy()
        unwrapped[np.isfinite(angle)] = np.unwrap(angle[np.isfinite(angle)])
        angles.append(_steady(fill_unknown(time, unwrapped), time, fixes))
    return *attitude_from_nautical(*angles), notes


def _course(x: FloatArray, y: FloatArray) -> FloatArray:
    """Heading of the track over several pings; NaN where it stands still, 0 where it always does [rad]."""
    before, after = np.maximum(np.arange(len(x)) - _N_COURSE, 0), np.minimum(np.arange(len(x)) + _N_COURSE, len(x) - 1)
    east, north = x[after] - x[before], y[after] - y[before]
    course = np.where(np.hypot(east, north) > 0, np.arctan2(east, north), np.nan)
    return course if np.isfinite(course).any() else np.zeros(len(x))


def speed_in_metres(recorded: FloatArray, trajectory: Trajectory) -> tuple[FloatArray, list[str]]:
    """Speed from knots, unless the track shows that it was metres per second.

    Parameters
    ----------
    recorded : ndarray, shape (N,)
        Speed as recorded, knots by the format.
    trajectory : Trajectory
        The track.

    Returns
    -------
    speed : ndarray, shape (N,)
        Speed [m/s].
    notes : list of str
        The unit, where it is not the format's.
    """
    duration = trajectory.time[-1] - trajectory.time[0]
    usual = float(np.median(recorded[np.isfinite(recorded)])) if np.isfinite(recorded).any() else 0.0
    ratio = trajectory.distance[-1] / duration / usual if duration > 0 and usual > 0 else 0.0
    if _METRES_PER_SECOND[0] < ratio < _METRES_PER_SECOND[1]:
        return recorded.copy(), ["speed fits the track in metres per second and not in knots: taken so"]
    return recorded * _KNOT, []
