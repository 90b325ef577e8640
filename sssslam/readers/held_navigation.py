"""Navigation slower than the pings: positions that stray, positions that are held until the next fix."""

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import median_filter

from frontend.arrays import BoolArray, FloatArray, IntArray

# A hold this many times longer than usual is a standstill if its speed is below this part of the usual.
_LONG_HOLD, _SLOW = 5.0, 0.3
# Fixes each way in a local fit, and the share of figures that must sit on a grid for it to be their resolution.
_N_NEIGHBOURS, _ON_GRID = 4, 0.95
# Differences this small, of the figures' size, come from writing decimals in binary.
_DECIMAL_NOISE = 1e-11
# A series belongs to the fixes if at most this share of its changes falls between them.
_BETWEEN_FIXES = 0.02


def stray_positions(east: FloatArray, north: FloatArray) -> BoolArray:
    """Positions far from those of their neighbours.

    Parameters
    ----------
    east, north : ndarray, shape (N,)
        Positions in the order of the pings [m].

    Returns
    -------
    is_stray : ndarray of bool, shape (N,)
        True where a position is further than 50 m, and than 20 usual steps, from the median of the 11 around it.
    """
    size = min(11, 2 * ((len(east) - 1) // 2) + 1)
    off = np.hypot(*(axis - median_filter(axis, size=size, mode="nearest") for axis in (east, north)))
    steps = np.hypot(np.diff(east), np.diff(north))
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    return np.asarray(off > max(50.0, 20 * usual))


def fix_pings(east: FloatArray, north: FloatArray) -> IntArray:
    """The pings at which a new position arrives.

    Parameters
    ----------
    east, north : ndarray, shape (N,)
        Positions as recorded, any unit.

    Returns
    -------
    fixes : ndarray of int, shape (K,)
        The first ping of each run of equal positions.
    """
    is_new = (np.diff(east) != 0) | (np.diff(north) != 0)
    return np.flatnonzero(np.concatenate([[True], is_new]))


def interpolate_positions(
    time: FloatArray, east: FloatArray, north: FloatArray, fixes: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Smooth positions between fixes.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Ping times [s].
    east, north : ndarray, shape (N,)
        Positions as recorded, held until the next fix; any unit, but the same on both axes.
    fixes : ndarray of int, shape (K,)
        Pings at which a new position arrives, at least 2.

    Returns
    -------
    east, north : ndarray, shape (N,)
        Positions without steps, within half the resolution of the recorded figures at each fix.

    Notes
    -----
    Monotone cubic interpolation through the fixes. A fix rounded to a grid is first moved, by half a cell at most,
    towards the quadratic that fits its neighbours. A vehicle that stands still stays where it is.
    """
    knots = np.union1d(fixes, _ends_of_standstills(time, east, north, fixes))
    return _interpolate_axis(time, east, knots), _interpolate_axis(time, north, knots)


def _ends_of_standstills(time: FloatArray, east: FloatArray, north: FloatArray, fixes: IntArray) -> IntArray:
    """Last pings of the holds in which the vehicle did not move."""
    duration = np.diff(time[fixes])
    speed = np.hypot(np.diff(east[fixes]), np.diff(north[fixes])) / duration
    is_still = (duration > _LONG_HOLD * np.median(duration)) & (speed < _SLOW * np.median(speed))
    ends = fixes[1:][is_still] - 1
    last_hold = time[-1] - time[fixes[-1]]
    return np.append(ends, len(time) - 1) if last_hold > _LONG_HOLD * np.median(duration) else ends


def _interpolate_axis(time: FloatArray, values: FloatArray, knots: IntArray) -> FloatArray:
    at = time[knots]
    smooth = _smooth_within_resolution(at, values[knots])
    inside = (
        PchipInterpolator(at, smooth)(np.minimum(time, at[-1])) if len(knots) > 1 else np.full(len(time), smooth[0])
    )
    # Behind the last fix the vehicle goes on at the speed of the last few.
    few = slice(-min(len(knots), _N_NEIGHBOURS + 1), None)
    speed = (smooth[-1] - smooth[few][0]) / (at[-1] - at[few][0]) if len(knots) > 1 else 0.0
    return np.asarray(inside + speed * np.maximum(time - at[-1], 0.0))


def _smooth_within_resolution(time: FloatArray, values: FloatArray) -> FloatArray:
    """Values moved towards a local quadratic, by no more than half their resolution."""
    half = resolution(values) / 2
    return values + np.clip(_local_quadratic(time, values) - values, -half, half) if half > 0 else values


def resolution(values: FloatArray) -> float:
    """Step of the grid that a series of figures sits on.

    Parameters
    ----------
    values : ndarray, shape (K,)
        Figures of one kind, in the order recorded.

    Returns
    -------
    step : float
        The smallest difference between the changes from one figure to the next, if all changes are multiples of it.
        Else 0; also where all changes are alike, which is an even speed as well as a grid.
    """
    changes = np.abs(np.diff(values))
    noise = _DECIMAL_NOISE * max(1.0, float(np.max(np.abs(values), initial=0.0)))
    sizes = np.unique(np.round(changes / noise)) * noise
    sizes = sizes[sizes > 0]
    if sizes.size < 2:
        return 0.0
    step = float(min(sizes[0], np.diff(sizes).min()))
    multiple = changes / step
    return step if np.mean(np.abs(multiple - np.round(multiple)) < 0.1) >= _ON_GRID else 0.0


def _local_quadratic(time: FloatArray, values: FloatArray) -> FloatArray:
    """At each fix, the quadratic in time that fits the fixes around it, near ones more."""
    if len(time) <= 2 * _N_NEIGHBOURS:
        return values
    padded = [np.pad(a, _N_NEIGHBOURS, constant_values=np.nan) for a in (time, values)]
    t, v = (np.lib.stride_tricks.sliding_window_view(a, 2 * _N_NEIGHBOURS + 1) for a in padded)
    reach = (_N_NEIGHBOURS + 1) * float(np.median(np.diff(time)))
    u = np.nan_to_num((t - time[:, None]) / reach, nan=2.0)
    weight = np.clip(1 - np.abs(u) ** 3, 0, None) ** 3
    powers = np.stack([np.ones_like(u), u, u**2], axis=-1)
    normal = np.einsum("ki,kia,kib->kab", weight, powers, powers) + 1e-9 * np.eye(3)
    offset = np.nan_to_num(v - values[:, None])
    fitted = np.linalg.solve(normal, np.einsum("ki,kia,ki->ka", weight, powers, offset)[..., None])
    return np.asarray(values + fitted[:, 0, 0])


def interpolate_series(time: FloatArray, values: FloatArray, fixes: IntArray) -> FloatArray:
    """Interpolate a series that changes only where a fix arrives.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Ping times [s].
    values : ndarray, shape (N,)
        The series as recorded; angles unwrapped.
    fixes : ndarray of int, shape (K,)
        Pings at which a new position arrives.

    Returns
    -------
    values : ndarray, shape (N,)
        Linear between the fixes; as recorded if the series also changes between them.
    """
    changes = 1 + np.flatnonzero(np.diff(values) != 0)
    between = np.setdiff1d(changes, fixes)
    if len(between) > _BETWEEN_FIXES * len(changes):
        return values.copy()
    return np.interp(time, time[fixes], values[fixes])


def fill_unknown(time: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate over unknown values.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Ping times [s].
    values : ndarray, shape (N,)
        A series with at least one known value; NaN where unknown.

    Returns
    -------
    values : ndarray, shape (N,)
        Linear between known values, the nearest before the first and behind the last.
    """
    known = np.isfinite(values)
    return np.where(known, values, np.interp(time, time[known], values[known]))
