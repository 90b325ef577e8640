"""The clock of a navigation log against that of the sonar, from what both have seen."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize_scalar

from frontend.arrays import FloatArray
from frontend.bottom import BottomConfig, find_bottom
from frontend.recording import Recording
from sssslam.navigation.log import NavigationLog
from sssslam.navigation.series import Series, interpolate

_MAX_OFFSET = 60.0
_STEP, _MAX_STEPS = 0.25, 20_000
_SMOOTHING = 2.0  # intervals of the coarser series
# Believed from this correlation on, and if no other offset leaves less than so many times the unexplained variance.
_LEAST_CORRELATION, _AMBIGUOUS = 0.5, 1.2
_LEAST_OVERLAP, _LEAST_PINGS = 0.5, 20


@dataclass(frozen=True)
class ClockOffset:
    """How far two clocks are apart.

    Parameters
    ----------
    offset : float
        Seconds to add to the times of the log to get those of the sonar.
    sigma : float
        Standard deviation [s].
    correlation : float
        Of the two series at that offset [1].
    how : str
        Which two series.
    """

    offset: float
    sigma: float
    correlation: float
    how: str

    def __str__(self) -> str:
        return (
            f"clock offset {self.offset:+.3f} s, standard deviation {self.sigma:.3f} s, from {self.how} "
            f"(correlation {self.correlation:.2f})"
        )


def estimate_clock_offset(recording: Recording, log: NavigationLog) -> tuple[ClockOffset, list[str]]:
    """Estimate how far the clock of a log is from that of the sonar.

    Parameters
    ----------
    recording : Recording
        The echoes and the navigation that came with them.
    log : NavigationLog
        Navigation on another clock.

    Returns
    -------
    offset : ClockOffset
        Of the pair of series that tells it best.
    notes : list of str
        What that pair and the others say.

    Raises
    ------
    ValueError
        If no pair of series tells an offset within a minute.

    Notes
    -----
    Pairs are the first bottom return with the altitude of the log, and heading, roll, pitch, depth and speed of the
    recording with those of the log, both smoothed. For each, the offset leaves least of the recording's series
    unexplained by a scale and a shift of the log's. Its variance is that of least squares,
    ``s^2 / sum((a dx/dt)^2)``, times ``1 + 2 sum(rho_k)`` for residuals that are correlated from ping to ping.
    """
    found = [f for seen, x, how in _pairs(recording, log) if (f := _offset(recording.ping_time, seen, x, how))]
    if not found:
        names = ", ".join(log.series)
        raise ValueError(
            f"{log.source}: the clock offset cannot be told from {names}: nothing there varies as the echoes or the "
            f"recorded navigation do, within {_MAX_OFFSET:.0f} s; --clock-offset SECONDS is wanted"
        )
    best = min(found, key=lambda f: f.sigma)
    others = [f"{f}: not used" for f in found if f is not best]
    return best, [str(best), *others]


def _pairs(recording: Recording, log: NavigationLog) -> Iterator[tuple[FloatArray, Series, str]]:
    """What the recording saw, what the log says of the same, and the words for it."""
    trajectory = recording.trajectory_dr
    if "altitude" in log.series:
        altitude = _echo_altitude(recording)
        if altitude is not None:
            yield altitude, log.series["altitude"], "altitude against the first bottom return"
    recorded = {name: getattr(trajectory, name) for name in ("roll", "pitch")}
    recorded |= {name: getattr(recording, name) for name in ("depth", "speed")}
    if "yaw" in log.series:
        heading = Series(log.series["yaw"].time, np.unwrap(log.series["yaw"].values))
        yield np.unwrap(trajectory.yaw), heading, "heading against heading"
    for name, values in recorded.items():
        if name in log.series:
            yield values, log.series[name], f"{name} against {name}"


def _echo_altitude(recording: Recording) -> FloatArray | None:
    """Altitude from the echoes alone; None where they show no bottom."""
    try:
        alone = replace(recording, altitude=np.full(recording.n_pings, np.nan))
        return find_bottom(alone, BottomConfig()).altitude
    except ValueError:
        return None


def _offset(time: FloatArray, seen: FloatArray, said: Series, how: str) -> ClockOffset | None:
    """The offset of one pair of series; None where they do not tell."""
    known = np.isfinite(seen)
    time, seen = time[known], seen[known]
    if len(time) < _LEAST_PINGS or np.ptp(seen) == 0 or np.ptp(said.values) == 0:
        return None
    seen, said = _smoothed(time, seen, said)
    step = max(_STEP, (time[-1] - time[0]) / _MAX_STEPS)
    grid = np.arange(time[0], time[-1], step)
    on_grid = np.interp(grid, time, seen)
    offsets = np.arange(-_MAX_OFFSET, _MAX_OFFSET + step / 2, step)
    left = np.array([_unexplained(grid, on_grid, said, offset) for offset in offsets])
    best = int(np.argmin(left))
    if not left[best] < 1 - _LEAST_CORRELATION**2 or best in (0, len(offsets) - 1) or _has_rival(left, best):
        return None
    near = offsets[best]
    fine = minimize_scalar(
        lambda offset: _unexplained(time, seen, said, offset), bounds=(near - step, near + step), method="bounded"
    )
    return _judged(time, seen, said, float(fine.x), how)


def _smoothed(time: FloatArray, seen: FloatArray, said: Series) -> tuple[FloatArray, Series]:
    """Both series over the same few intervals: noise that is averaged between two values, and not at them, draws."""
    interval = float(np.median(np.diff(time)))
    width = _SMOOTHING * max(interval, said.interval)
    of_log = _averaged(said.values, width / max(said.interval, 1e-6))
    return _averaged(seen, width / interval), Series(said.time, of_log)


def _averaged(values: FloatArray, sigma: float) -> FloatArray:
    """Three running means: nearly a Gaussian of that many values, and as fast however many there are."""
    size = min(2 * round(sigma) + 1, 2 * ((len(values) - 1) // 2) + 1)
    for _ in range(3):
        values = uniform_filter1d(values, size, mode="nearest")
    return values


def _unexplained(time: FloatArray, seen: FloatArray, said: Series, offset: float) -> float:
    """Share of the variance that the log leaves; 1 where it overlaps too little or goes the other way."""
    x = interpolate(said, time - offset)
    known = np.isfinite(x)
    if known.mean() < _LEAST_OVERLAP or np.ptp(x[known]) == 0 or np.ptp(seen[known]) == 0:
        return 1.0
    correlation = float(np.corrcoef(x[known], seen[known])[0, 1])
    return 1 - max(correlation, 0.0) ** 2


def _has_rival(left: FloatArray, best: int) -> bool:
    """Whether another offset, over a rise away, is nearly as good: a series that repeats itself."""
    high = _AMBIGUOUS * max(left[best], 1e-3)
    is_low = left < high
    low, up = best, best
    while low > 0 and is_low[low - 1]:
        low -= 1
    while up < len(left) - 1 and is_low[up + 1]:
        up += 1
    return bool(is_low[:low].any() or is_low[up + 1 :].any())


def _judged(time: FloatArray, seen: FloatArray, said: Series, offset: float, how: str) -> ClockOffset | None:
    """The offset with its standard deviation and correlation."""
    x = interpolate(said, time - offset)
    known = np.isfinite(x)
    t, x, y = time[known], x[known], seen[known]
    scale, shift = np.polyfit(x, y, 1)
    residual = y - scale * x - shift
    rate = np.gradient(x, t)
    energy = float(np.sum((scale * rate) ** 2))
    if energy == 0:
        return None
    spread = float(np.sum(residual**2)) / max(len(x) - 3, 1)
    sigma = float(np.sqrt(spread / energy * _repetition(residual)))
    return ClockOffset(offset, sigma, float(np.corrcoef(x, y)[0, 1]), how)


def _repetition(residual: FloatArray) -> float:
    """How many residuals in a row say the same: 1 + 2 sum(rho_k) up to the first lag that is not positive."""
    n = len(residual)
    spectrum = np.abs(np.fft.rfft(residual, 2 * n)) ** 2
    rho = np.fft.irfft(spectrum)[:n] / max(float(np.sum(residual**2)), 1e-30)
    until = int(np.argmax(rho <= 0)) if (rho <= 0).any() else n
    return float(1 + 2 * rho[1:until].sum())
