"""Health of the track: its speed, its shape, its jumps, and heading against course."""

import numpy as np

from frontend.arrays import BoolArray, FloatArray
from frontend.frames import heading_from_yaw, wrap_angle
from frontend.recording import Recording
from sssslam.health.finding import Finding, Lines, span

_N_TRACK_POINTS = 1000
# A jump is faster than any vehicle that flies a side-scan sonar [m/s].
_MAX_SPEED = 15.0
_MAX_CRAB = np.radians(8.0)
# Of a straight track the way from end to end is this share of the distance run; an arc of 50 degrees has less.
_STRAIGHT = 0.97
_LEAST_LOOP = 1 / 3  # of the range
_CAME_BACK = 3.0  # times the way across is the way along: half a circle has 1.6


def examine_track(recording: Recording) -> Lines:
    """Look at the track and at the heading along it.

    Parameters
    ----------
    recording : Recording
        The recording.

    Yields
    ------
    line : tuple of str or Finding
        What and its value, or something suspicious.
    """
    yield from _track(recording)
    yield from _heading(recording)


def _track(recording: Recording) -> Lines:
    trajectory, place = recording.trajectory_dr, recording.georeference
    where = f"{place.latitude:.6f}, {place.longitude:.6f} deg" if place else "unknown, local metres"
    yield "origin", where
    distance = float(trajectory.distance[-1])
    yield "distance", f"{distance:.1f} m"
    if recording.n_pings < 2:
        return
    yield "ping spacing", f"{recording.ping_spacing:.3g} m"
    speeds = np.diff(trajectory.distance) / np.diff(trajectory.time)
    recorded = recording.speed[np.isfinite(recording.speed)]
    mean = distance / float(trajectory.time[-1] - trajectory.time[0])
    yield "speed", f"{mean:.3g} m/s along the track" + (f", {span(recorded, 'm/s')} recorded" if recorded.size else "")
    yield "course", _shape(recording)
    jumps = _jumps(np.diff(trajectory.distance), speeds > _MAX_SPEED)
    if jumps.size:
        yield Finding(
            f"the position jumps ({jumps.size}x), by up to {jumps.max():.1f} m",
            "navigation was corrected there: odometry, or a reference, is wrong across a jump",
        )
    if distance < recording.slant_range_max[0] / 10:
        yield Finding(f"the vehicle moves {distance:.1f} m in all", "without a track there is nothing to reconstruct")
    elif recorded.size and not 0.6 < np.median(recorded) / max(mean, 1e-9) < 1.7:
        yield Finding(
            f"recorded speed is {np.median(recorded):.2f} m/s, the track's {mean:.2f} m/s",
            "a unit is wrong, or the speed is through water in a strong current",
        )


def _jumps(steps: FloatArray, is_fast: BoolArray) -> FloatArray:
    """Lengths of the jumps; what a reader spread over several pings is one [m]."""
    starts = np.flatnonzero(is_fast & ~np.concatenate([[False], is_fast[:-1]]))
    return np.add.reduceat(np.where(is_fast, steps, 0.0), starts) if starts.size else starts.astype(np.float64)


def _shape(recording: Recording) -> str:
    """Straight or turning, and how much of the track is passed again."""
    trajectory = recording.trajectory_dr
    chord = np.hypot(trajectory.x[-1] - trajectory.x[0], trajectory.y[-1] - trajectory.y[0])
    turn = np.degrees(np.ptp(np.unwrap(trajectory.yaw)))
    is_straight = chord > _STRAIGHT * trajectory.distance[-1]
    shape = "straight" if is_straight else f"turning, {turn:.0f} deg between extreme headings"
    again, crossings = _passed_again(recording), count_crossings(recording)
    crossed = f"; it crosses itself {crossings}x" if crossings else ""
    return f"{shape}; {f'{again:.0%} of the track is passed again' if again else 'no place is passed twice'}{crossed}"


def _passed_again(recording: Recording) -> float:
    """Share of the track that lies within half the range of a part it came back to, not merely went on from."""
    every = max(1, recording.n_pings // _N_TRACK_POINTS)
    trajectory, reach = recording.trajectory_dr[::every], float(np.median(recording.slant_range_max))
    apart = np.hypot(*(axis[:, None] - axis[None, :] for axis in (trajectory.x, trajectory.y)))
    along = recording.trajectory_dr.distance[::every]
    between = np.abs(along[:, None] - along[None, :])
    again = (apart < 0.5 * reach) & (between > np.maximum(_LEAST_LOOP * reach, _CAME_BACK * apart))
    return float(again.any(axis=1).mean())


def count_crossings(recording: Recording) -> int:
    """How often a track crosses itself.

    Parameters
    ----------
    recording : Recording
        The recording.

    Returns
    -------
    n_crossings : int
        Pairs of steps that cross, a third of the range or more apart along the track: less is jitter of the fixes.
    """
    every = max(1, recording.n_pings // _N_TRACK_POINTS)
    trajectory, along = recording.trajectory_dr[::every], recording.trajectory_dr.distance[::every]
    x, y = trajectory.x, trajectory.y

    def side(k: slice, m: slice) -> FloatArray:
        """On which side of each step (rows) each point lies."""
        dx, dy = np.diff(x)[:, None], np.diff(y)[:, None]
        return np.asarray(dx * (y[None, k] - y[m, None]) - dy * (x[None, k] - x[m, None]))

    start, end = slice(None, -1), slice(1, None)
    splits = side(start, start) * side(end, start) < 0
    is_apart = along[None, :-1] - along[1:, None] > _LEAST_LOOP * float(np.median(recording.slant_range_max))
    return int(np.count_nonzero(splits & splits.T & is_apart))


def _heading(recording: Recording) -> Lines:
    trajectory = recording.trajectory_dr
    heading = np.degrees(heading_from_yaw(trajectory.yaw))
    yield "heading", f"{heading[0]:.0f} deg at the start, {heading[-1]:.0f} deg at the end"
    k = min(10, recording.n_pings - 1)
    east, north = (axis[k:] - axis[: len(axis) - k] for axis in (trajectory.x, trajectory.y))
    is_moving = np.hypot(east, north) > 0.2 * max(recording.ping_spacing, 1e-3) * k if k else np.zeros(1, dtype=bool)
    if not is_moving.any():
        return
    course = np.arctan2(north, east)[is_moving]
    crab = wrap_angle(trajectory.yaw[k // 2 :][: len(is_moving)][is_moving] - course)
    middle = float(np.angle(np.exp(1j * crab).mean()))
    if abs(middle) > np.radians(150):
        yield Finding("heading is opposite to the course", "heading or direction of the file is turned round")
    elif abs(middle) > _MAX_CRAB:
        side = "left" if middle > 0 else "right"
        yield Finding(
            f"heading is {abs(np.degrees(middle)):.0f} deg {side} of the course on average",
            "current, or a compass without declination or alignment; the seafloor is placed by the heading",
        )
