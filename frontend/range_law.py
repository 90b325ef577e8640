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
_CELL, _BEND, _SLOPE = 0.1, 0.25, 1.0
_SPREADING, _POWER, _ABSORPTION, _GAIN, _GAIN_BEND = 3.0, 1.0, 0.03, 0.3, 0.05
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
    sums, counts = _histogram(excess, reach, (first, step, n_knots))
    known = (counts > 0) & (sums > 0)
    side, knot, cell = np.nonzero(known)
    value = np.log(sums[known] / counts[known])
    design = _design(side * n_knots + knot, cell, centre, 2 * n_knots)
    precision, expected = _prior(n_knots)
    weight = 1.0 / (_CELL**2 + 1.0 / counts[known])
    x = _solve(design, value, weight, precision, expected)
    for _ in range(_N_ROUNDS):
        rest = np.abs(value - design @ x)
        x = _solve(design, value, weight / np.maximum(rest / _OUTLIER, 1.0), precision, expected)
    law = RangeLaw(float(x[2 * n_knots]), float(x[2 * n_knots + 1]), x[2 * n_knots + 2 :], centre)
    return x[: 2 * n_knots].reshape(2, n_knots), law


def _histogram(excess: Excess, reach: float, knots: tuple[float, float, int]) -> tuple[FloatArray, FloatArray]:
    """Shape (2, K, N_RANGES): sums and counts over side, angle knot and range."""
    shape = (knots[2], N_RANGES)
    column = np.minimum((excess.slant_range * (N_RANGES / reach)).astype(np.int64), N_RANGES - 1)
    sums, counts = np.zeros((2, *shape)), np.zeros((2, *shape))
    for side in range(2):
        good = excess.is_usable[:, side]
        cell = angle_knots(excess.angle[:, side][good], *knots) * N_RANGES + column[good]
        sums[side] = np.bincount(cell, excess.level[:, side][good], sums[side].size).reshape(shape)
        counts[side] = np.bincount(cell, minlength=sums[side].size).reshape(shape)
    return sums, counts


def _design(beam: IntArray, cell: IntArray, centre: FloatArray, n_beam: int) -> csr_array:
    """Rows: cells with echoes; columns: beam knots, power, absorption, gain."""
    n = beam.size
    one = np.ones(n)
    values = np.stack([one, -np.log(centre[cell]), -centre[cell], one], axis=1)
    columns = np.stack([beam, np.full(n, n_beam), np.full(n, n_beam + 1), n_beam + 2 + cell], axis=1)
    shape = (n, n_beam + 2 + N_RANGES)
    return csr_array((values.ravel(), columns.ravel(), np.arange(n + 1) * 4), shape=shape)


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
