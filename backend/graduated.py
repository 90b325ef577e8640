"""Graduated non-convexity: which relative poses of a graph fit, by weights that harden from step to step."""

import numpy as np
from scipy.special import chdtri

from backend.arrays import FloatArray
from backend.gauss_newton import one_step, rough_minimum
from backend.least_squares import LeastSquares

_DIMENSIONS = 6  # of a relative pose
_CONTROL_STEP = 2.0  # of the control parameter; Yang et al. have 1.4, which gives the same weights
_MAX_STEPS = 40  # of the control parameter; from squared residuals 1e6 times the limit to weights of zero and one


def truncated_weights(
    least_squares: LeastSquares, n_doubtful: int, T_start: FloatArray, inlier_probability: float
) -> tuple[FloatArray, FloatArray]:
    """Weigh doubtful relative poses by graduated non-convexity with a truncated least-squares loss.

    Parameters
    ----------
    least_squares : LeastSquares
        The graph.
    n_doubtful : int
        The last so many D of its relative poses may be wrong.
    T_start : ndarray, shape (S, 4, 4)
        Poses to start from.
    inlier_probability : float
        Share of right measurements whose residual stays below the truncation.

    Returns
    -------
    weights : ndarray, shape (D,)
        One where a measurement fits, zero where it does not.
    T : ndarray, shape (S, 4, 4)
        The poses at the end.

    Notes
    -----
    GTSAM has this too. Here each step starts at the poses of the one before and stops early: only the weights matter.

    References
    ----------
    .. [1] Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020.
       :doi:`10.1109/LRA.2020.2965893`
    """
    limit, n_known = float(chdtri(_DIMENSIONS, 1.0 - inlier_probability)), len(least_squares.relative) - n_doubtful
    known = least_squares.relative.weights[:n_known]
    T, weights = rough_minimum(least_squares, T_start), np.ones(n_doubtful)
    squared = least_squares.squared_residuals(T)[n_known:]
    largest = float(squared.max(initial=0.0))
    if largest <= limit:
        return weights, T
    control = limit / (2.0 * largest - limit)
    for _ in range(_MAX_STEPS):
        weights = _weights(squared, limit, control)
        T = one_step(least_squares.weighted(np.concatenate([known, weights])), T)
        squared = least_squares.squared_residuals(T)[n_known:]
        if ((weights == 0.0) | (weights == 1.0)).all() and np.array_equal(weights, _weights(squared, limit, control)):
            break
        control *= _CONTROL_STEP
    return weights, T


def _weights(squared: FloatArray, limit: float, control: float) -> FloatArray:
    """Weights of squared residuals, eq. 14 of Yang et al."""
    between = np.sqrt(limit * control * (control + 1.0) / np.maximum(squared, 1e-12)) - control
    ratio = (control + 1.0) / control
    return np.where(squared >= limit * ratio, 0.0, np.where(squared <= limit / ratio, 1.0, np.clip(between, 0.0, 1.0)))
