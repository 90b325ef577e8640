"""Echo levels in coarse cells of slant range, a few pings together: what the bottom is looked for in."""

from dataclasses import dataclass

import numba
import numpy as np

from frontend.arrays import AnyArray, FloatArray
from frontend.recording import Quantity, Recording

_N_SAMPLED_PINGS = 60
_CHUNK = 512


@dataclass(frozen=True)
class Cells:
    """Mean echo levels, C cells a group of pings.

    Parameters
    ----------
    level : ndarray, shape (2, G, C)
        Logarithm of the echo, port and starboard; NaN where a cell holds no sample.
    width : float
        Width of a cell in slant range, the first from 0 [m].
    group : int
        Pings a group; the last group may have fewer.
    """

    level: FloatArray
    width: float
    group: int

    @property
    def slant_range(self) -> FloatArray:
        """Shape (C,): near edge of each cell [m]."""
        return np.asarray(np.arange(self.level.shape[2]) * self.width)

    @property
    def middle_ping(self) -> FloatArray:
        """Shape (G,): middle of each group, in pings."""
        return np.asarray(np.arange(self.level.shape[1]) * self.group + 0.5 * (self.group - 1))


def level_cells(recording: Recording, width: float, group: int) -> Cells:
    """Average levels over cells of range and groups of pings.

    Parameters
    ----------
    recording : Recording
        Sample spacing may differ from ping to ping.
    width : float
        Width of a cell [m].
    group : int
        Pings a group.

    Returns
    -------
    cells : Cells
        Pings that are silent throughout are left out of their group.
    """
    n_cells = max(1, int(recording.slant_range_max.max() / width))
    n_groups = -(-recording.n_pings // group)
    sums, counts = np.zeros((2, n_groups, n_cells)), np.zeros((2, n_groups, n_cells))
    chunk = -(-_CHUNK // group) * group
    for side, echoes in enumerate((recording.port, recording.starboard)):
        bounds = level_bounds(echoes, recording.sonar.quantity)
        for first in range(0, recording.n_pings, chunk):
            level = echo_level(echoes[first : first + chunk], recording.sonar.quantity, bounds)
            scale = recording.sample_spacing[first : first + chunk] / width
            rows = slice(first // group, first // group + chunk // group)
            _add(level, scale, group, sums[side, rows], counts[side, rows])
    return Cells(np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0), width, group)


def level_bounds(echoes: AnyArray, quantity: Quantity) -> tuple[float, float]:
    """Least and greatest number that is believed of a side.

    Parameters
    ----------
    echoes : ndarray, shape (N, M)
        Recorded numbers.
    quantity : Quantity
        What they are.

    Returns
    -------
    low, high : float
        Low is above zero unless the numbers are logarithms.
    """
    some = echoes[:: max(1, len(echoes) // _N_SAMPLED_PINGS)]
    known = some[np.isfinite(some) & ((some > 0) | (quantity == Quantity.LOG))].astype(np.float64)
    if known.size == 0:
        return 1.0, 2.0
    low, high = np.percentile(known, [1.0, 99.0])
    return (2 * low - high, 2 * high - low) if quantity == Quantity.LOG else (float(low), float(1e3 * high))


def echo_level(echoes: AnyArray, quantity: Quantity, bounds: tuple[float, float]) -> AnyArray:
    """Logarithms of recorded numbers, or the numbers themselves where they are logarithms.

    Parameters
    ----------
    echoes : ndarray
        Recorded numbers.
    quantity : Quantity
        What they are.
    bounds : tuple of float
        Least and greatest number believed; others count as these.

    Returns
    -------
    level : ndarray of float32
        NaN stays NaN.
    """
    low, high = (np.float32(min(bound, 1e38)) for bound in bounds)
    bounded = np.clip(np.asarray(echoes, dtype=np.float32), low, high)
    return bounded if quantity == Quantity.LOG else np.log(bounded)


@numba.njit(cache=True)
def _add(level, scale, group, sums, counts):  # type: ignore[no-untyped-def]
    """Sum samples into cells; a ping without any change in it says nothing."""
    for ping in range(level.shape[0]):
        first, changes = level[ping, 0], False
        for k in range(level.shape[1]):
            if level[ping, k] != first and not np.isnan(level[ping, k]):
                changes = True
                break
        if not changes:
            continue
        row = ping // group
        for k in range(level.shape[1]):
            cell = int((k + 0.5) * scale[ping])
            if cell < sums.shape[1] and not np.isnan(level[ping, k]):
                sums[row, cell] += level[ping, k]
                counts[row, cell] += 1.0
