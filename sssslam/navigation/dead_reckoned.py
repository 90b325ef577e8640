"""Dead-reckoned navigation: a track rebuilt from heading, speed and depth, its recorded positions kept as reference.

A boat or a surfaced vehicle records GNSS; without it, the same dive is one of the deep sea, and the GNSS says how well
it was corrected.
"""

from dataclasses import replace

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import wrap_angle
from frontend.recording import Recording, Truth
from frontend.trajectory import Trajectory
from sssslam.readers.held_navigation import fill_unknown

# Heading this close to the course of the positions, in the middle of all pings, was made of them [rad].
_MADE_OF_POSITIONS = float(np.radians(0.05))


def rebuild_dead_reckoned(recording: Recording) -> Recording:
    """Rebuild the track of a recording from heading, speed and depth alone.

    Parameters
    ----------
    recording : Recording
        With speed recorded in some pings at least.

    Returns
    -------
    recording : Recording
        Positions start at the first recorded one and follow heading and speed; attitude and height stay. The track as
        recorded, where the vehicle moves in it, is its truth: the reference. Fixes of a receiver are left out; the
        speed stands among the sensors as a ``speed_log``, unless that of one is there.

    Raises
    ------
    ValueError
        If no speed is recorded.

    Notes
    -----
    Between two pings the vehicle goes straight ahead, in the direction half way between their headings, at the mean of
    their speeds. Holds without current and drift to the side.
    """
    if not np.isfinite(recording.speed).any():
        raise ValueError(f"{_name(recording)} has no speed; dead reckoning wants heading and speed")
    recorded = recording.trajectory_dr
    speed = fill_unknown(recording.ping_time, recording.speed)
    x, y = integrate(recorded.time, recorded.yaw, speed)
    track = replace(recorded, x=recorded.x[0] + x, y=recorded.y[0] + y)
    log = {"speed_log": {"time": recording.ping_time, "speed": speed}}
    return replace(
        recording,
        trajectory_dr=track,
        truth=Truth(recorded) if recorded.distance[-1] > 0 else None,
        # what judges the track must not hold it
        sensors=log | {name: series for name, series in recording.sensors.items() if name != "gnss"},
        notes=(*recording.notes, *_notes(recording, track)),
    )


def integrate(time: FloatArray, yaw: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions of a vehicle that goes where it heads.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Times [s].
    yaw : ndarray, shape (N,)
        Direction counter-clockwise from east [rad]; may wrap.
    speed : ndarray, shape (N,)
        Speed ahead [m/s].

    Returns
    -------
    x, y : ndarray, shape (N,)
        East and north of the first position [m].

    Examples
    --------
    >>> x, y = integrate(np.array([0.0, 1.0]), np.zeros(2), np.array([1.0, 2.0]))
    >>> float(x[1]), float(y[1])
    (1.5, 0.0)
    """
    turn = wrap_angle(np.diff(yaw))
    run = np.diff(time) * (speed[1:] + speed[:-1]) / 2
    middle = yaw[:-1] + turn / 2
    steps = run * np.cos(middle), run * np.sin(middle)
    x, y = (np.concatenate([[0.0], np.cumsum(step)]) for step in steps)
    return x, y


def _notes(recording: Recording, track: Trajectory) -> list[str]:
    recorded, n_unknown = recording.trajectory_dr, int(np.isnan(recording.speed).sum())
    apart = float(np.hypot(track.x[-1] - recorded.x[-1], track.y[-1] - recorded.y[-1]))
    against = f", {recorded.distance[-1]:.1f} m as recorded, {apart:.1f} m apart at the end; those are the reference"
    reference = against if recorded.distance[-1] > 0 else ""
    notes = [f"positions are rebuilt from heading and speed: {track.distance[-1]:.1f} m{reference}"]
    if n_unknown:
        notes.append(f"speed is missing in {n_unknown} of {recording.n_pings} pings and is interpolated")
    if _follows_course(recorded):
        notes.append("heading is the course of the recorded positions: this dead reckoning is not independent of them")
    return notes


def _follows_course(trajectory: Trajectory) -> bool:
    """Whether heading was made of positions: the two agree better than any compass does."""
    k = min(5, len(trajectory) // 2)
    if k == 0 or trajectory.distance[-1] == 0:
        return False
    east, north = (axis[2 * k :] - axis[: -2 * k] for axis in (trajectory.x, trajectory.y))
    crab = wrap_angle(trajectory.yaw[k:-k] - np.arctan2(north, east))
    return bool(np.median(np.abs(crab)) < _MADE_OF_POSITIONS)


def _name(recording: Recording) -> str:
    return recording.source or "the recording"
