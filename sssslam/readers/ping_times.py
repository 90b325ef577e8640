"""Ping times: from the stamps of a file to seconds that increase strictly."""

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from frontend.arrays import BoolArray, FloatArray

# Least and greatest year, month, day, hour, minute, second (a leap second is the 61st).
_FIELD_BOUNDS = ((1970, 2200), (1, 12), (1, 31), (0, 23), (0, 59), (0, 61))
# A stamp this far [s] from its neighbours is damage, and a step back by more is a clock that was set.
_STEP = 1.0
# Stamps come in bursts when this share of the intervals is below this part of the usual interval.
_BURST_SHARE, _BURST_PART = 0.05, 0.25
# Up to this share of repeated stamps each is repaired by its neighbours; beyond, the clock is coarser than the pings.
_FEW = 0.05
# A line is fitted to the stamps of this many bursts, at least this many pings.
_N_BURSTS, _MIN_PINGS = 4, 9


def seconds_since_1970(fields: FloatArray) -> FloatArray:
    """Seconds since 1970 UTC of civil dates and times.

    Parameters
    ----------
    fields : ndarray, shape (6, N)
        Year, month, day, hour, minute and second; seconds may have a fraction.

    Returns
    -------
    time : ndarray, shape (N,)
        Seconds since 1970 UTC; NaN where a field is out of its range.
    """
    low, high = np.array(_FIELD_BOUNDS, dtype=np.float64).T[:, :, None]
    valid = np.all((fields >= low) & (fields <= high), axis=0)
    year, month, day, hour, minute, second = fields
    months = np.where(valid, (year - 1970) * 12 + month - 1, 0).astype("datetime64[M]")
    days = months.astype("datetime64[D]").astype(np.int64) + day - 1
    return np.where(valid, ((days * 24 + hour) * 60 + minute) * 60 + second, np.nan)


def repair_times(stamps: FloatArray, nominal_interval: float) -> tuple[FloatArray, list[str]]:
    """Make ping times that increase strictly, as near to the stamps as can be.

    Parameters
    ----------
    stamps : ndarray, shape (N,)
        Times as recorded, in the order of the pings [s]; NaN where unknown.
    nominal_interval : float
        Time between pings where the stamps do not tell [s].

    Returns
    -------
    time : ndarray, shape (N,)
        Strictly increasing times [s]; the stamps themselves where those increase evenly.
    notes : list of str
        What was changed, a sentence each.
    """
    interval = _typical_interval(stamps, nominal_interval)
    notes = []
    time, n = _without_strays(stamps, interval)
    if n:
        notes.append(f"{n} of {len(time)} ping times were missing or astray and are interpolated")
    time, n = _without_steps_back(time, interval)
    if n:
        notes.append(f"the clock was set back ({n}x); the pings after it follow on at the usual rate")
    is_late = _is_not_later(time)
    if is_late.mean() > _FEW or _is_bursty(time, interval):
        notes.append(
            f"ping times repeat or come in bursts and are re-spread: {is_late.sum()} of {len(time)} are not later"
            " than the one before"
        )
        time = _spread(time, interval)
    elif is_late.any():
        notes.append(f"ping times not later than the one before, interpolated: {is_late.sum()}")
        time = _interpolate(np.where(is_late, np.nan, time), interval)
    return _strictly_increasing(time, interval), notes


def _typical_interval(stamps: FloatArray, nominal_interval: float) -> float:
    """Median over spans of up to 50 pings, so that bursts and pauses do not count; nominal if no time passes [s]."""
    known = stamps[np.isfinite(stamps)]
    n = min(max(len(known) // 4, 1), 50)
    spans = known[n:] - known[:-n]
    return float(np.median(spans[spans > 0])) / n if np.any(spans > 0) else nominal_interval


def _without_strays(stamps: FloatArray, interval: float) -> tuple[FloatArray, int]:
    """Stamps with unknown ones, and ones far from the median of their neighbours, interpolated; and how many."""
    known = np.flatnonzero(np.isfinite(stamps))
    if not known.size:
        return interval * np.arange(len(stamps), dtype=np.float64), len(stamps)
    # A median over 11 leaves any increasing series as it is, gaps included.
    usual = median_filter(stamps[known], size=min(11, 2 * ((known.size - 1) // 2) + 1), mode="nearest")
    astray = np.abs(stamps[known] - usual) > max(_STEP, 20 * interval)
    cleaned = np.full(len(stamps), np.nan)
    cleaned[known[~astray]] = stamps[known[~astray]]
    return _interpolate(cleaned, interval), int(np.isnan(cleaned).sum())


def _interpolate(stamps: FloatArray, interval: float) -> FloatArray:
    """Unknown stamps interpolated over the number of the ping, and extrapolated at the usual interval."""
    index, known = np.arange(len(stamps)), np.flatnonzero(np.isfinite(stamps))
    first, last = known[0], known[-1]
    inside = np.interp(index, known, stamps[known])
    return inside + interval * (np.minimum(index - first, 0) + np.maximum(index - last, 0))


def _without_steps_back(time: FloatArray, interval: float) -> tuple[FloatArray, int]:
    """Times in which the clock is never set back, and how often it was."""
    steps = np.diff(time)
    is_back = steps < -_STEP
    shift = np.cumsum(np.where(is_back, interval - steps, 0.0))
    return np.concatenate([time[:1], time[1:] + shift]), int(is_back.sum())


def _is_not_later(time: FloatArray) -> BoolArray:
    """Pings whose time is not later than that of every ping before."""
    return np.concatenate([[False], time[1:] <= np.maximum.accumulate(time)[:-1]])


def _is_bursty(time: FloatArray, interval: float) -> bool:
    return len(time) > 1 and float(np.mean(np.diff(time) < _BURST_PART * interval)) > _BURST_SHARE


def _spread(time: FloatArray, interval: float) -> FloatArray:
    """Times on lines fitted to the stamps of several bursts; a pause separates the lines."""
    stamps = np.maximum.accumulate(time)
    burst_starts = np.flatnonzero(np.concatenate([[True], np.diff(stamps) > interval]))
    lengths = np.diff(np.append(burst_starts, len(time)))
    usual_pause = float(np.median(np.diff(stamps[burst_starts]))) if len(burst_starts) > 1 else 0.0
    pauses = 1 + np.flatnonzero(np.diff(stamps) > max(_STEP, 4 * usual_pause))
    window = max(_MIN_PINGS, 2 * (int(_N_BURSTS * np.percentile(lengths, 90)) // 2) + 1)
    return np.concatenate([_fit_lines(part, window) for part in np.split(stamps, pauses)])


def _fit_lines(stamps: FloatArray, window: int) -> FloatArray:
    """Middle values of lines fitted in a sliding window of an odd number of pings; at the ends, the outermost lines."""
    window = min(window, 2 * ((len(stamps) - 1) // 2) + 1)
    if window < 3:
        return stamps
    # Small numbers are averaged, since 1e9 s would cost seven digits. The middle of a fitted line is the mean.
    small, half = stamps - stamps[0], window // 2
    fitted = uniform_filter1d(small, window)
    place = np.arange(window) - half
    for ends, values in ((slice(None, half), small[:window]), (slice(-half, None), small[-window:])):
        fitted[ends] = (values.mean() + place * (place @ values) / (place @ place))[ends]
    return np.asarray(stamps[0] + fitted)


def _strictly_increasing(time: FloatArray, interval: float) -> FloatArray:
    """The times, raised where needed to lie a thousandth of an interval (at least 2 us) after the one before."""
    least = max(1e-3 * interval, 2e-6) * np.arange(len(time))
    raised = np.maximum.accumulate(time - least) + least
    return np.where(_is_not_later(time).any() | (np.diff(time, prepend=-np.inf) <= 0), raised, time)
