"""A series: one quantity over times of its own, and how it is brought to the times of pings."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from frontend.arrays import FloatArray

# A series answers this many usual intervals beyond its ends: the last fix of a log is as old as the next was to come.
_N_INTERVALS_BEYOND = 2.0
# Beyond this, some 3000 years from 1970, doubles cannot tell a hundredth of a millisecond: no time of a dive [s].
_MAX_TIME = 1e11
# No coordinate, angle or speed is larger, in any unit; and what is this near to zero is zero: slopes stay finite.
_MAX_VALUE, _NOTHING = 1e9, 1e-12


@dataclass(frozen=True)
class Series:
    """One quantity over time.

    Parameters
    ----------
    time : ndarray, shape (K,)
        Seconds since 1970 UTC, strictly increasing, at least one.
    values : ndarray, shape (K,)
        Finite values.
    """

    time: FloatArray
    values: FloatArray

    @property
    def interval(self) -> float:
        """Usual time between values [s]; 0 for a single one."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0


def make_series(time: FloatArray, values: FloatArray) -> Series | None:
    """A series of what was recorded, in order.

    Parameters
    ----------
    time, values : ndarray, shape (K,)
        As recorded: any order, NaN where unknown; beyond 1e11 s or 1e9 they are taken for unknown.

    Returns
    -------
    series : Series or None
        The known values in the order of time, the first of those that share a time; None where none is known.
    """
    known = np.flatnonzero((np.abs(time) < _MAX_TIME) & (np.abs(values) < _MAX_VALUE))
    if not known.size:
        return None
    time, values = (np.where(np.abs(numbers) < _NOTHING, 0.0, numbers) for numbers in (time, values))
    at, first = np.unique(time[known], return_index=True)
    return Series(at, values[known][first])


def covers(series: Series, time: FloatArray) -> FloatArray:
    """Where a series has something to say.

    Parameters
    ----------
    series : Series
        The series.
    time : ndarray, shape (N,)
        Times asked for [s].

    Returns
    -------
    covered : ndarray, shape (N,)
        1 within the series and up to two usual intervals beyond its ends, NaN elsewhere.
    """
    beyond = _N_INTERVALS_BEYOND * series.interval
    inside = (time >= series.time[0] - beyond) & (time <= series.time[-1] + beyond)
    return np.where(inside, 1.0, np.nan)


def interpolate(series: Series, time: FloatArray) -> FloatArray:
    """Values of a series between its own times.

    Parameters
    ----------
    series : Series
        The series.
    time : ndarray, shape (N,)
        Times asked for [s].

    Returns
    -------
    values : ndarray, shape (N,)
        Linear between values, the outermost held for two intervals; NaN further out.
    """
    return np.interp(time, series.time, series.values) * covers(series, time)


def interpolate_angle(series: Series, time: FloatArray) -> FloatArray:
    """Angles of a series between its own times.

    Parameters
    ----------
    series : Series
        Angles [rad]; they may wrap.
    time : ndarray, shape (N,)
        Times asked for [s].

    Returns
    -------
    angles : ndarray, shape (N,)
        As `interpolate`, the short way round; not wrapped.
    """
    return interpolate(Series(series.time, np.unwrap(series.values)), time)


def interpolate_position(series: Series, time: FloatArray) -> FloatArray:
    """Coordinates of a vehicle between its fixes.

    Parameters
    ----------
    series : Series
        One coordinate, any unit.
    time : ndarray, shape (N,)
        Times asked for [s].

    Returns
    -------
    coordinate : ndarray, shape (N,)
        Monotone cubic between fixes, at the outermost speed for two intervals beyond them; NaN further out.
    """
    at, values = series.time, series.values
    if len(at) < 2:
        return interpolate(series, time)
    inside = PchipInterpolator(at - at[0], values)(np.clip(time, at[0], at[-1]) - at[0])
    speed_before, speed_after = ((values[k + 1] - values[k]) / (at[k + 1] - at[k]) for k in (0, len(at) - 2))
    beyond = speed_before * np.minimum(time - at[0], 0.0) + speed_after * np.maximum(time - at[-1], 0.0)
    return np.asarray((inside + beyond) * covers(series, time))
