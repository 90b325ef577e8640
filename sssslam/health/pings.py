"""Health of the pings: how many, how long, when."""

from datetime import UTC, datetime

import numpy as np

from frontend.recording import Recording
from sssslam.health.finding import Finding, Lines, span

# A pause is this many usual intervals [1], and a second.
_PAUSE = 5.0
# What readers say of times that they mended, and what it means.
_MENDED = {
    "repeat or come in bursts": "the recorder stamps pings when they reach it; the even rate of the sonar is restored",
    "clock was set back": "navigation from another clock will not fit after it: estimate --clock-offset for each part",
    "were missing or astray": "a damaged line or clock; places of these pings are as good as the guess",
    "not later than the one before": "a coarse clock; the pings between are spread evenly",
}


def examine_pings(recording: Recording) -> Lines:
    """Look at the pings and their times.

    Parameters
    ----------
    recording : Recording
        The recording.

    Yields
    ------
    line : tuple of str or Finding
        What and its value, or something suspicious.
    """
    yield from _pings(recording)
    yield from _times(recording)
    yield from _clock(recording)


def _pings(recording: Recording) -> Lines:
    dropped = f", {recording.n_dropped} dropped" if recording.n_dropped else ""
    yield "pings", f"{recording.n_pings} of {recording.n_samples} samples a side{dropped}"
    yield "slant range", span(recording.slant_range_max, "m")
    yield "sample spacing", span(1e3 * recording.sample_spacing, "mm")
    frequency = recording.sonar.frequency
    yield "frequency", f"{frequency / 1e3:.4g} kHz" if np.isfinite(frequency) else "unknown"
    yield "samples are", str(recording.sonar.quantity)
    if recording.n_dropped > 0.1 * recording.n_pings:
        share = recording.n_dropped / (recording.n_pings + recording.n_dropped)
        yield Finding(f"{share:.0%} of the pings could not be used", "look at the notes for the reason")


def _times(recording: Recording) -> Lines:
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


def _clock(recording: Recording) -> Lines:
    """What the reader had to mend about times, with what that means."""
    for note in recording.notes:
        advice = next((advice for words, advice in _MENDED.items() if words in note), None)
        if advice is not None:
            yield Finding(note, advice)
