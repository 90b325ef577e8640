"""Health of a recording: what is in it, and what looks wrong before any work is spent on it."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from frontend.arrays import FloatArray
from frontend.bottom import BottomConfig, find_bottom
from frontend.frames import heading_from_yaw, wrap_angle
from frontend.recording import Recording

# Samples looked at: enough for a percentile, few enough for an answer at once.
_N_SAMPLED_PINGS = 300
_N_TRACK_POINTS = 1000
# A pause is this many usual intervals; a jump is faster than any vehicle that flies a side-scan sonar [m/s].
_PAUSE, _MAX_SPEED = 5.0, 15.0
# A sensor that says the same for so long [s], and for this share of the dive, is frozen.
_FROZEN_TIME, _FROZEN_SHARE = 10.0, 0.1
_MAX_CRAB = np.radians(8.0)
_MAX_PITCH = np.radians(10.0)
_SATURATED_SHARE, _SIDE_RATIO = 0.01, 3.0
# Of a straight track the way from end to end is this share of the distance run; an arc of 50 degrees has less.
_STRAIGHT = 0.97


@dataclass(frozen=True)
class Finding:
    """Something suspicious.

    Parameters
    ----------
    what : str
        What was seen, with figures.
    advice : str
        What it may mean, and what to do.
    """

    what: str
    advice: str


@dataclass(frozen=True)
class Health:
    """What a recording holds.

    Parameters
    ----------
    rows : tuple of (str, str)
        What and its value, units included, in the order to print.
    findings : tuple of Finding
        What looks wrong; empty for a recording without fault.
    """

    rows: tuple[tuple[str, str], ...]
    findings: tuple[Finding, ...]


def examine(recording: Recording) -> Health:
    """Examine a recording.

    Parameters
    ----------
    recording : Recording
        The recording.

    Returns
    -------
    health : Health
        What it holds and what looks suspicious.
    """
    checks = (_pings, _times, _track, _heading, _attitude, _altitude, _frozen, _sound, _echoes)
    rows: list[tuple[str, str]] = []
    findings: list[Finding] = []
    for check in checks:
        for line in check(recording):
            findings.append(line) if isinstance(line, Finding) else rows.append(line)
    return Health(tuple(rows), tuple(findings))


_Lines = Iterator[tuple[str, str] | Finding]


def _span(values: FloatArray, unit: str) -> str:
    """Least and greatest value, or one where they print alike."""
    low, high = (f"{value:.4g}" for value in (np.nanmin(values), np.nanmax(values)))
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def _thinned(recording: Recording) -> Recording:
    return recording[:: -(-recording.n_pings // _N_SAMPLED_PINGS)]


def _pings(recording: Recording) -> _Lines:
    dropped = f", {recording.n_dropped} dropped" if recording.n_dropped else ""
    yield "pings", f"{recording.n_pings} of {recording.n_samples} samples a side{dropped}"
    yield "slant range", _span(recording.slant_range_max, "m")
    yield "sample spacing", _span(1e3 * recording.sample_spacing, "mm")
    frequency = recording.sonar.frequency
    yield "frequency", f"{frequency / 1e3:.4g} kHz" if np.isfinite(frequency) else "unknown"
    yield "samples are", str(recording.sonar.quantity)
    if recording.n_dropped > 0.1 * recording.n_pings:
        share = recording.n_dropped / (recording.n_pings + recording.n_dropped)
        yield Finding(f"{share:.0%} of the pings could not be used", "look at the notes for the reason")


def _times(recording: Recording) -> _Lines:
    time = recording.ping_time
    start = datetime.fromtimestamp(time[0], UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    yield "start", start
    yield "duration", f"{time[-1] - time[0]:.1f} s"
    if recording.n_pings < 2:
        yield Finding("there is one ping only", "a window of many pings is wanted")
        return
    steps = np.diff(time)
    usual = float(np.median(steps))
    yield "ping rate", f"{1 / usual:.3g} Hz"
    travel = float(np.median(2 * recording.slant_range_max / recording.sound_speed))
    if usual < 0.95 * travel:
        yield Finding(
            f"pings follow each other in {1e3 * usual:.0f} ms, but sound needs {1e3 * travel:.0f} ms for the range",
            "range or times are wrong, or echoes of the ping before are mixed in",
        )
    pauses = steps[steps > max(_PAUSE * usual, 1.0)]
    if pauses.size:
        yield Finding(
            f"time has gaps ({pauses.size}x), the longest {pauses.max():.1f} s",
            "no shape is known there; odometry over a gap is as good as the navigation",
        )
    if time[0] < 86400 * 365:
        yield Finding(f"the clock says {start}", "the recorder's date was not set; times are relative")


def _track(recording: Recording) -> _Lines:
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
    yield "speed", f"{mean:.3g} m/s along the track" + (f", {_span(recorded, 'm/s')} recorded" if recorded.size else "")
    yield "course", _shape(recording)
    jumps = np.diff(trajectory.distance)[speeds > _MAX_SPEED]
    if jumps.size:
        yield Finding(
            f"the position jumps ({jumps.size}x), by up to {jumps.max():.1f} m",
            "navigation was corrected there; odometry across a jump is wrong",
        )
    if distance < recording.slant_range_max[0] / 10:
        yield Finding(f"the vehicle moves {distance:.1f} m in all", "without a track there is nothing to reconstruct")
    elif recorded.size and not 0.6 < np.median(recorded) / max(mean, 1e-9) < 1.7:
        yield Finding(
            f"recorded speed is {np.median(recorded):.2f} m/s, the track's {mean:.2f} m/s",
            "a unit is wrong, or the speed is through water in a strong current",
        )


def _shape(recording: Recording) -> str:
    """Straight or turning, and how much of the track is passed again."""
    trajectory = recording.trajectory_dr
    chord = np.hypot(trajectory.x[-1] - trajectory.x[0], trajectory.y[-1] - trajectory.y[0])
    turn = np.degrees(np.ptp(np.unwrap(trajectory.yaw)))
    is_straight = chord > _STRAIGHT * trajectory.distance[-1]
    shape = "straight" if is_straight else f"turning, {turn:.0f} deg between extreme headings"
    again = _passed_again(recording)
    return f"{shape}; {f'{again:.0%} of the track is passed again' if again else 'no place is passed twice'}"


def _passed_again(recording: Recording) -> float:
    """Share of the track that lies within half the range of a part more than two ranges before or after."""
    every = max(1, recording.n_pings // _N_TRACK_POINTS)
    trajectory, reach = recording.trajectory_dr[::every], float(np.median(recording.slant_range_max))
    apart = np.hypot(*(axis[:, None] - axis[None, :] for axis in (trajectory.x, trajectory.y)))
    along = recording.trajectory_dr.distance[::every]
    again = (apart < 0.5 * reach) & (np.abs(along[:, None] - along[None, :]) > 2 * reach)
    return float(again.any(axis=1).mean())


def _heading(recording: Recording) -> _Lines:
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


def _attitude(recording: Recording) -> _Lines:
    trajectory = recording.trajectory_dr
    for name, positive in (("roll", "starboard down"), ("pitch", "nose down")):
        angle = np.degrees(getattr(trajectory, name))
        yield name, "0 throughout" if not np.any(angle) else f"{_span(angle, 'deg')}, positive {positive}"
        if not np.any(angle):
            yield Finding(f"{name} is 0 in every ping", "it was not recorded; level flight is assumed")
    pitch = float(np.median(trajectory.pitch))
    if abs(pitch) > _MAX_PITCH:
        way = "down" if pitch > 0 else "up"
        yield Finding(
            f"the nose points {abs(np.degrees(pitch)):.0f} deg {way} in the middle of all pings",
            "the beam looks that far ahead or astern; altitude times its cosine is the first return",
        )


def _altitude(recording: Recording) -> _Lines:
    known = {name: getattr(recording, name)[np.isfinite(getattr(recording, name))] for name in ("altitude", "depth")}
    for name, values in known.items():
        share = f", missing in {1 - values.size / recording.n_pings:.0%}" if values.size < recording.n_pings else ""
        yield name, _span(values, "m") + share if values.size else "not recorded"
    try:
        # Damaged echoes may overflow on the way; what comes of them is a finding, not a warning.
        with np.errstate(all="ignore"):
            bottom = find_bottom(_thinned(recording), BottomConfig())
    except ValueError:
        yield Finding(
            "no first bottom return is seen", "range, sample order or altitude may be wrong: look at the lines"
        )
        return
    ratio = float(np.median(bottom.altitude)) / float(np.median(recording.slant_range_max))
    yield "altitude over range", f"{ratio:.0%}"
    if not 0.02 < ratio < 0.5:
        yield Finding(
            f"altitude is {ratio:.0%} of the range", "side-scan sonar sees shape best from about a tenth of its range"
        )
    if abs(bottom.altimeter_scale - 1) > 0.05:
        yield Finding(
            f"the first bottom return is {bottom.altimeter_scale:.2f} times the recorded altitude",
            "altimeter, sound speed or range is off by that scale; the echoes are trusted",
        )


def _frozen(recording: Recording) -> _Lines:
    """Series that stay the same to the last bit for long while the vehicle moves on."""
    trajectory = recording.trajectory_dr
    series = {name: getattr(trajectory, name) for name in ("roll", "pitch", "yaw")} | {"altitude": recording.altitude}
    time = recording.ping_time
    for name, values in series.items():
        starts = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0]))
        ends = np.append(starts[1:], len(values)) - 1
        held = time[ends] - time[starts]
        longest = float(held.max())
        was_recorded = np.any(np.nan_to_num(values) != 0)
        if was_recorded and longest > max(_FROZEN_TIME, _FROZEN_SHARE * (time[-1] - time[0])):
            start = float(time[starts[held.argmax()]] - time[0])
            yield Finding(
                f"{name} does not change for {longest:.0f} s from {start:.0f} s on", "the sensor or its line was frozen"
            )


def _sound(recording: Recording) -> _Lines:
    yield "sound speed", _span(recording.sound_speed, "m/s")
    if np.any((recording.sound_speed < 1350) | (recording.sound_speed > 1650)):
        yield Finding("sound speed is not that of water", "ranges are scaled by it: check the recorder's setting")


def _echoes(recording: Recording) -> _Lines:
    thinned = _thinned(recording)
    # Behind a tenth of the range: the transmission itself saturates any receiver.
    first = recording.n_samples // 10
    levels = {}
    for side in ("port", "starboard"):
        echoes = getattr(thinned, side)[:, first:]
        known = echoes[np.isfinite(echoes)]
        if not known.size or np.ptp(known) == 0:
            yield side, "no echoes"
            yield Finding(f"{side} holds no echoes", "the channel was off; only one side can be reconstructed")
            continue
        low, middle, high = np.percentile(known, [1, 50, 99])
        levels[side] = float(np.mean(np.abs(known)))
        yield side, f"1 %, 50 %, 99 % of samples below {low:.4g}, {middle:.4g}, {high:.4g}"
        saturated = float(np.mean(known == known.max()))
        if saturated > _SATURATED_SHARE:
            yield Finding(
                f"{saturated:.1%} of the {side} samples are at the greatest value, {known.max():.4g}",
                "the receiver or recorder saturates: brightness above is lost",
            )
    if len(levels) == 2:
        ratio = levels["port"] / max(levels["starboard"], 1e-30)
        dark = "starboard" if ratio > 1 else "port"
        if max(ratio, 1 / max(ratio, 1e-30)) > _SIDE_RATIO:
            yield Finding(
                f"{dark} is {max(ratio, 1 / ratio):.1f} times darker than the other side", "its gain or cable is off"
            )
