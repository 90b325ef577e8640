"""Joining navigation: a log beside the sonar takes the place of what the recording has, by time."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from frontend.arrays import BoolArray, FloatArray
from frontend.frames import wrap_angle
from frontend.georeference import Georeference
from frontend.recording import Recording
from frontend.trajectory import Trajectory
from sssslam.navigation.log import DEGREES, GRID, LOCAL, NavigationLog
from sssslam.navigation.series import Series, interpolate, interpolate_angle, interpolate_position

# A pause this many usual intervals long, and as many seconds, is told.
_PAUSE_INTERVALS, _PAUSE = 5.0, 2.0
# Local metres this many lengths of the dive away from the recorded track lie in another frame.
_ELSEWHERE, _LEAST_NEAR = 2.0, 100.0
_LEAST_COVERED = 0.5


@dataclass(frozen=True)
class _Placed:
    """Positions of a log at the pings, and the frame they are in."""

    x: FloatArray
    y: FloatArray
    georeference: Georeference | None
    notes: list[str]


def join_navigation(recording: Recording, log: NavigationLog, clock_offset: float = 0.0) -> Recording:
    """Take the navigation of a recording from a log.

    Parameters
    ----------
    recording : Recording
        The echoes, with whatever navigation they have.
    log : NavigationLog
        Navigation recorded beside them.
    clock_offset : float
        Seconds to add to the times of the log to get those of the sonar.

    Returns
    -------
    recording : Recording
        The pings that the log covers; what it lacks stays as recorded. The notes say what was taken and how much of
        the dive it covers.

    Raises
    ------
    ValueError
        If the log covers no ping.
    """
    log = log.shifted(clock_offset)
    placed = _place(recording, log)
    is_covered = np.isfinite(placed.x) & np.isfinite(placed.y) & _any_covered(recording, log)
    if not is_covered.any():
        raise ValueError(f"{log.source}: covers no ping; {_spans(recording, log)}")
    joined = _with_series(recording, log, placed)[np.flatnonzero(is_covered)]
    n_lost = int((~is_covered).sum())
    notes = [*log.notes, *placed.notes, *_coverage(recording, log, is_covered, clock_offset)]
    return replace(
        joined,
        notes=(*recording.notes, *(f"{log.source}: {note}" for note in notes)),
        n_dropped=recording.n_dropped + n_lost,
    )


def _any_covered(recording: Recording, log: NavigationLog) -> BoolArray:
    """Pings at which at least one series of the log says something."""
    known = [np.isfinite(interpolate(series, recording.ping_time)) for series in log.series.values()]
    return np.any(known, axis=0)


def _place(recording: Recording, log: NavigationLog) -> _Placed:
    """Positions at the pings in the local frame: of the log if it has any, else as recorded."""
    time, recorded = recording.ping_time, recording.trajectory_dr
    pair = log.place
    if pair is None:
        return _Placed(recorded.x, recorded.y, recording.georeference, [])
    if pair == DEGREES:
        longitude = Series(log.series["longitude"].time, np.unwrap(log.series["longitude"].values, period=360))
        east, north = (interpolate_position(s, time) for s in (longitude, log.series["latitude"]))
        return _from_degrees(recording, east, north)
    x, y = (interpolate_position(log.series[name], time) for name in pair)
    return _from_grid(x, y) if pair == GRID else _from_local(recording, x, y)


def _from_degrees(recording: Recording, longitude: FloatArray, latitude: FloatArray) -> _Placed:
    covered = np.flatnonzero(np.isfinite(longitude) & np.isfinite(latitude))
    if not covered.size:
        return _Placed(longitude, latitude, recording.georeference, [])
    known, first = recording.georeference, covered[0]
    frame = known or Georeference(latitude=float(latitude[first]), longitude=float(longitude[first]))
    x, y = (np.full(len(longitude), np.nan) for _ in range(2))
    x[covered], y[covered] = frame.to_local(latitude[covered], longitude[covered])
    return _Placed(x, y, frame, _distance_note(recording, x, y) if known else [])


def _from_grid(easting: FloatArray, northing: FloatArray) -> _Placed:
    """Grid metres from their first covered fix; where the grid lies is unknown."""
    covered = np.flatnonzero(np.isfinite(easting) & np.isfinite(northing))
    if not covered.size:
        return _Placed(easting, northing, None, [])
    east, north = float(easting[covered[0]]), float(northing[covered[0]])
    note = f"positions are metres of an unnamed grid; the origin is easting {east:.3f}, northing {north:.3f}"
    return _Placed(easting - east, northing - north, None, [note])


def _from_local(recording: Recording, x: FloatArray, y: FloatArray) -> _Placed:
    """Local metres; in the frame of the recording if they lie near its track."""
    recorded = recording.trajectory_dr
    apart = np.hypot(x - recorded.x, y - recorded.y)
    near = max(_LEAST_NEAR, _ELSEWHERE * float(recorded.distance[-1]))
    if recording.georeference is None or not np.isfinite(apart).any() or np.nanmedian(apart) < near:
        return _Placed(x, y, recording.georeference, _distance_note(recording, x, y))
    return _Placed(x, y, None, ["positions are local metres far from the recorded track: their place is unknown"])


def _distance_note(recording: Recording, x: FloatArray, y: FloatArray) -> list[str]:
    apart = np.hypot(x - recording.trajectory_dr.x, y - recording.trajectory_dr.y)
    known = apart[np.isfinite(apart)]
    return (
        [f"positions are {np.median(known):.3g} m from those recorded, in the middle of all pings"]
        if known.size
        else []
    )


def _with_series(recording: Recording, log: NavigationLog, placed: _Placed) -> Recording:
    """All pings with the series of the log; positions are still unknown where it does not cover them."""
    time, recorded = recording.ping_time, recording.trajectory_dr
    angles = {name: getattr(recorded, name) for name in ("roll", "pitch", "yaw")}
    for name, before in angles.items():
        if name in log.series:
            angles[name] = wrap_angle(_angle_at(log.series[name], time, before))
    recorded_names = (name for name in ("altitude", "depth", "speed") if name in log.series)
    scalars: dict[str, Any] = {name: interpolate(log.series[name], time) for name in recorded_names}
    z = _height(recorded, log, scalars, time)
    x, y = (np.nan_to_num(axis) for axis in (placed.x, placed.y))
    same_frame = placed.georeference == recording.georeference
    return replace(
        recording,
        trajectory_dr=Trajectory(recorded.time, x, y, z, **angles),
        georeference=placed.georeference,
        truth=recording.truth if same_frame else None,
        **scalars,
    )


def _angle_at(series: Series, time: FloatArray, before: FloatArray) -> FloatArray:
    """A series at the pings; as recorded where it covers few, the nearest of its values where it just falls short."""
    angle = interpolate_angle(series, time)
    if np.isfinite(angle).mean() < _LEAST_COVERED:
        return before
    known = np.isfinite(angle)
    return np.interp(time, time[known], angle[known])


def _height(recorded: Trajectory, log: NavigationLog, scalars: dict[str, Any], time: FloatArray) -> FloatArray:
    """Height of the vehicle: z of the log, else its depth, else as recorded [m]."""
    z = interpolate(log.series["z"], time) if "z" in log.series else -scalars.get("depth", -recorded.z)
    return np.where(np.isfinite(z), z, recorded.z)


def _coverage(recording: Recording, log: NavigationLog, is_covered: BoolArray, clock_offset: float) -> list[str]:
    """What was taken, at which rate, and what it leaves out."""
    pair = log.place
    names = [*(["position"] if pair else []), *(n for n in log.series if n not in (*DEGREES, *LOCAL, *GRID))]
    interval = min((s.interval for s in log.series.values() if s.interval > 0), default=0.0)
    rate = f" at up to {1 / interval:.3g} Hz" if interval else ""
    notes = [
        f"{', '.join(names)} taken{rate}, clock offset {clock_offset:+.3f} s, "
        f"{is_covered.mean():.1%} of {recording.n_pings} pings covered"
    ]
    if not is_covered.all():
        notes.append(f"{int((~is_covered).sum())} pings outside its time are dropped")
    return notes + (_pause_note(log.series[pair[0]], recording.ping_time) if pair else [])


def _pause_note(series: Series, time: FloatArray) -> list[str]:
    """The longest pause between fixes during the dive, where it is long."""
    at = series.time[(series.time >= time[0]) & (series.time <= time[-1])]
    longest = float(np.diff(at).max(initial=0.0))
    is_long = longest > max(_PAUSE, _PAUSE_INTERVALS * series.interval)
    return [f"positions pause for up to {longest:.1f} s and are interpolated there"] if is_long else []


def _spans(recording: Recording, log: NavigationLog) -> str:
    """When both were recorded."""
    first, last = log.span
    times = [_written(t) for t in (first, last, recording.ping_time[0], recording.ping_time[-1])]
    return (
        f"it runs from {times[0]} to {times[1]}, the pings from {times[2]} to {times[3]}; "
        "one dive is wanted, or --clock-offset"
    )


def _written(time: float) -> str:
    try:
        return datetime.fromtimestamp(time, UTC).strftime("%Y-%m-%d %H:%M:%S")
    except (ValueError, OverflowError, OSError):
        return f"{time:.6g} s"
