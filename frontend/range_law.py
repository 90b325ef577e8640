"""Beam pattern over angle and range law over slant range, fitted together to the mean echoes of a flat floor."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import spsolve

from frontend.arrays import BoolArray, FloatArray, IntArray

N_RANGES = 40  # cells of range over which equal angles are compared

# Standard deviations of what is expected: a mean of many echoes (texture, slopes), second and first differences of the
# beam pattern from knot to knot, power of range about spreading over a floor, absorption left over [1/m], what a
# recorder's gain adds to that, and its second differences from cell to cell. Logarithms of intensity.
_CELL, _BEND, _SLOPE = 0.1, 0.25, 10.0
_SPREADING, _POWER, _ABSORPTION, _GAIN, _GAIN_BEND = 3.0, 0.5, 0.03, 0.3, 0.05
_OUTLIER, _N_ROUNDS = 0.3, 4


@dataclass(frozen=True)
class Excess:
    """Echoes above the noise floor against those of a flat floor.

    Parameters
    ----------
    angle : ndarray, shape (N, 2, M)
        Angle from the body's nadir [rad].
    level : ndarray, shape (N, 2, M)
        Echo above the floor's, as a ratio of intensities.
    is_usable : ndarray of bool, shape (N, 2, M)
        Which of them count.
    slant_range : ndarray, shape (N, M)
        Slant range of each sample [m]; a recorder's range may change during the dive.
    """

    angle: FloatArray
    level: FloatArray
    is_usable: BoolArray
    slant_range: FloatArray


@dataclass(frozen=True)
class RangeLaw:
    """Logarithm of intensity over slant range.

    Parameters
    ----------
    power : float
        Power of range with which echoes fall.
    absorption : float
        What they fall besides [1/m].
    gain : ndarray, shape (J,)
        What the recorder adds, at evenly spaced ranges.
    slant_range : ndarray, shape (J,)
        Those ranges [m].
    """

    power: float
    absorption: float
    gain: FloatArray
    slant_range: FloatArray

    def __call__(self, slant_range: FloatArray) -> FloatArray:
        """Logarithm of intensity at some ranges [m]; the gain beyond the last is the last."""
        gain = np.interp(slant_range, self.slant_range, self.gain)
        return np.asarray(-self.power * np.log(slant_range) - self.absorption * slant_range + gain)


def angle_knots(angle: FloatArray, first: float, step: float, n: int) -> IntArray:
    """Nearest of n evenly spaced knots; angles beyond count at the ends.

    Parameters
    ----------
    angle : ndarray
        Angles [rad].
    first, step : float
        First knot and distance between knots [rad].
    n : int
        Number of knots.

    Returns
    -------
    knot : ndarray of int
        Same shape as the angles.
    """
    return np.clip(np.round((angle - first) / step).astype(np.int64), 0, n - 1)


def fit_beam_and_range(excess: Excess, first: float, step: float, n_knots: int) -> tuple[FloatArray, RangeLaw]:
    """Beam pattern of each side and range law that together explain the mean echo at each angle and range.

    Parameters
    ----------
    excess : Excess
        Echoes of pings at several altitudes: at one altitude every angle has one range and only the sum is known.
    first, step : float
        First knot and distance between knots of the beam pattern [rad].
    n_knots : int
        Number of knots.

    Returns
    -------
    log_beam : ndarray, shape (2, n_knots)
        Beam pattern; straight on where nothing is seen.
    law : RangeLaw
        The range law.

    Notes
    -----
    Least squares on logarithms of means, made robust by weights: unknowns are the patterns, the power of range, an
    absorption and a slowly changing gain, each with the size that physics lets expect.
    """
    reach = float(excess.slant_range.max())
    centre = (np.arange(N_RANGES) + 0.5) * reach / N_RANGES
    cells = _histogram(excess, reach, (first, step, n_knots))
    known = (cells[1] > 0) & (cells[0] > 0)
    sums, counts, *totals = (values[known] for values in cells)
    offset, log_range, mean_range = (total / counts for total in totals)
    side, segment, column = np.nonzero(known)
    value = np.log(sums / counts)
    design = _design((side * n_knots + segment, offset), (log_range, mean_range, column), 2 * n_knots)
    precision, expected = _prior(n_knots)
    weight = 1.0 / (_CELL**2 + 1.0 / counts)
    x = _solve(design, value, weight, precision, expected)
    for _ in range(_N_ROUNDS):
        rest = np.abs(value - design @ x)
        x = _solve(design, value, weight / np.maximum(rest / _OUTLIER, 1.0), precision, expected)
    law = RangeLaw(float(x[2 * n_knots]), float(x[2 * n_knots + 1]), x[2 * n_knots + 2 :], centre)
    return x[: 2 * n_knots].reshape(2, n_knots), law


def _histogram(excess: Excess, reach: float, knots: tuple[float, float, int]) -> FloatArray:
    """Shape (5, 2, K, N_RANGES): sums of level, one, offset from the knot before, logarithm of range, and range."""
    first, step, n = knots
    column = np.minimum((excess.slant_range * (N_RANGES / reach)).astype(np.int64), N_RANGES - 1)
    result = np.zeros((5, 2, n * N_RANGES))
    log_range = np.log(excess.slant_range)
    for side in range(2):
        good = excess.is_usable[:, side]
        position = np.clip((excess.angle[:, side][good] - first) / step, 0.0, n - 1.001)
        segment = position.astype(np.int64)
        cell = segment * N_RANGES + column[good]
        place = (position - segment, log_range[good], excess.slant_range[good])
        for k, values in enumerate((excess.level[:, side][good], np.ones(cell.size), *place)):
            result[k, side] = np.bincount(cell, values, n * N_RANGES)
    return result.reshape(5, 2, n, N_RANGES)


def _design(beam: tuple[IntArray, FloatArray], law: tuple[FloatArray, FloatArray, IntArray], n_beam: int) -> csr_array:
    """Rows: cells with echoes; columns: beam knots, between which it is linear, power, absorption, gain."""
    (knot, offset), (log_range, mean_range, cell) = beam, law
    n, one = knot.size, np.ones(knot.size)
    values = np.stack([1.0 - offset, offset, -log_range, -mean_range, one], axis=1)
    power = np.full(n, n_beam)
    columns = np.stack([knot, knot + 1, power, power + 1, power + 2 + cell], axis=1)
    shape = (n, n_beam + 2 + N_RANGES)
    return csr_array((values.ravel(), columns.ravel(), np.arange(n + 1) * 5), shape=shape)


def _prior(n_knots: int) -> tuple[csr_array, FloatArray]:
    """Inverse covariance and expected values of the unknowns."""
    n_beam = 2 * n_knots
    precision = np.zeros((n_beam + 2 + N_RANGES,) * 2)
    for k in range(2):
        part = slice(k * n_knots, (k + 1) * n_knots)
        precision[part, part] = _differences(n_knots, 2) / _BEND**2 + _differences(n_knots, 1) / _SLOPE**2
    precision[n_beam, n_beam], precision[n_beam + 1, n_beam + 1] = 1 / _POWER**2, 1 / _ABSORPTION**2
    gain = slice(n_beam + 2, None)
    precision[gain, gain] = np.eye(N_RANGES) / _GAIN**2 + _differences(N_RANGES, 2) / _GAIN_BEND**2
    expected = np.zeros(len(precision))
    expected[n_beam] = _SPREADING
    return csr_array(precision + 1e-9 * np.eye(len(precision))), expected


def _differences(n: int, order: int) -> FloatArray:
    step = np.diff(np.eye(n), order, axis=0)
    return np.asarray(step.T @ step)


def _solve(
    design: csr_array, value: FloatArray, weight: FloatArray, precision: csr_array, expected: FloatArray
) -> FloatArray:
    normal = csc_array(design.T @ diags_array(weight) @ design + precision)
    # a sparse factorisation works on one thread: the same bytes on any machine's number of them
    return np.asarray(spsolve(normal, design.T @ (weight * value) + precision @ expected))
