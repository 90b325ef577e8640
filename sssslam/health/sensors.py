"""Health of the sensors: attitude, altitude against the first bottom return, sound speed, what is frozen."""

import numpy as np

from frontend.bottom import Bottom, BottomConfig, find_bottom
from frontend.recording import Recording
from sssslam.health.finding import Finding, Lines, span, thinned

# A sensor that says the same for so long [s], and for this share of the dive, is frozen.
_FROZEN_TIME, _FROZEN_SHARE = 10.0, 0.1
_MAX_PITCH = np.radians(10.0)
# The altimeter's scale that is told, the share of pings that show the bottom, and a speed at which positions change.
_MAX_SCALE, _LEAST_SEEN, _MOVING = 0.05, 0.5, 0.3
_AT_SURFACE = 0.3  # a depth sensor there says zero, or what its zero is off by [m]


def examine_sensors(recording: Recording) -> Lines:
    """Look at attitude, altitude, sound speed, and at what does not change.

    Parameters
    ----------
    recording : Recording
        The recording.

    Yields
    ------
    line : tuple of str or Finding
        What and its value, or something suspicious.
    """
    yield from _attitude(recording)
    yield from _altitude(recording)
    yield from _frozen(recording)
    yield from _sound(recording)


def _attitude(recording: Recording) -> Lines:
    trajectory = recording.trajectory_dr
    for name, positive in (("roll", "starboard down"), ("pitch", "nose down")):
        angle = np.degrees(getattr(trajectory, name))
        yield name, "0 throughout" if not np.any(angle) else f"{span(angle, 'deg')}, positive {positive}"
        if not np.any(angle):
            yield Finding(
                _unrecorded(recording, name), "level flight is assumed: echoes of a vehicle that tilts are placed wrong"
            )
    pitch = float(np.median(trajectory.pitch))
    if abs(pitch) > _MAX_PITCH:
        way = "down" if pitch > 0 else "up"
        yield Finding(
            f"the nose points {abs(np.degrees(pitch)):.0f} deg {way} in the middle of all pings",
            "the beam looks that far ahead or astern; altitude times its cosine is the first return",
        )


def _unrecorded(recording: Recording, name: str) -> str:
    """An angle that is 0 throughout, in the words of its reader where that said so."""
    said = (note for note in recording.notes if note.startswith(f"{name} is not recorded"))
    return next(said, f"{name} is 0 in every ping")


def _altitude(recording: Recording) -> Lines:
    known = {name: getattr(recording, name)[np.isfinite(getattr(recording, name))] for name in ("altitude", "depth")}
    for name, values in known.items():
        share = f", missing in {1 - values.size / recording.n_pings:.0%}" if values.size < recording.n_pings else ""
        yield name, span(values, "m") + share if values.size else "not recorded"
    try:
        # Damaged echoes may overflow on the way; what comes of them is a finding, not a warning.
        with np.errstate(all="ignore"):
            bottom = find_bottom(thinned(recording), BottomConfig())
    except ValueError:
        yield Finding(
            "no first bottom return is seen", "range, sample order or altitude may be wrong: look at the lines"
        )
        return
    yield from _bottom(recording, bottom)


def _bottom(recording: Recording, bottom: Bottom) -> Lines:
    """How well the bottom is seen, and how it agrees with the altimeter."""
    ratio = float(np.median(bottom.altitude)) / float(np.median(recording.slant_range_max))
    yield "altitude over range", f"{ratio:.0%}"
    returns = span(bottom.first_bottom_return, "m")
    if bottom.is_found is not None:
        shares = bottom.is_found.mean(axis=0)
        returns += f", seen in {shares[0]:.0%} of port and {shares[1]:.0%} of starboard pings"
        if shares.max() < _LEAST_SEEN:
            yield Finding(
                f"the bottom is seen in {shares.max():.0%} of the pings only",
                "altitude between them is interpolated or the altimeter's: look at the waterfall (--figure)",
            )
    yield "first bottom return", returns
    if not 0.02 < ratio < 0.5:
        yield Finding(
            f"altitude is {ratio:.0%} of the range", "side-scan sonar sees shape best from about a tenth of its range"
        )
    if abs(bottom.altimeter_scale - 1) > _MAX_SCALE:
        yield Finding(
            f"the first bottom return is {bottom.altimeter_scale:.2f} times the recorded altitude",
            "altimeter, sound speed or range is off by that scale; the echoes are trusted",
        )


def _frozen(recording: Recording) -> Lines:
    """Series that stay the same to the last bit for long while the vehicle moves on."""
    trajectory = recording.trajectory_dr
    series = {name: getattr(trajectory, name) for name in ("roll", "pitch", "yaw")}
    series["altitude"] = recording.altitude
    # What stays at the surface does not change its depth.
    series["depth"] = np.where(recording.depth < _AT_SURFACE, np.nan, recording.depth)
    if np.nanmax(recording.speed, initial=0.0) > _MOVING:
        series["position"] = trajectory.x + 1j * trajectory.y
    time = recording.ping_time
    for name, values in series.items():
        starts = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0]))
        held = time[np.append(starts[1:], len(values)) - 1] - time[starts]
        longest = float(held.max())
        was_recorded = np.any(np.nan_to_num(values) != 0)
        if was_recorded and longest > max(_FROZEN_TIME, _FROZEN_SHARE * (time[-1] - time[0])):
            start = float(time[starts[held.argmax()]] - time[0])
            yield Finding(
                f"{name} does not change for {longest:.0f} s from {start:.0f} s on", "the sensor or its line was frozen"
            )


def _sound(recording: Recording) -> Lines:
    yield "sound speed", span(recording.sound_speed, "m/s")
    if np.any((recording.sound_speed < 1350) | (recording.sound_speed > 1650)):
        yield Finding("sound speed is not that of water", "ranges are scaled by it: check the recorder's setting")
