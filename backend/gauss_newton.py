"""Down to the least squares of a graph: Gauss's and Newton's steps, and damped ones where those go uphill."""

from dataclasses import dataclass

import numpy as np

from backend.arrays import FloatArray
from backend.block_cholesky import factorise
from backend.least_squares import LeastSquares
from backend.pose_kernels import moved

_MAX_STEPS = 20  # of Gauss and Newton; whatever takes longer is damped
_SETTLED = 1e-4  # error left to gain before the last step [1]; that step leaves a hundredth of a sigma at most
_ROUGH_SHARE = 1e-3  # of the error that is left to gain; it moves no residual by a tenth of its sigma
_MAX_DAMPED = 100  # damped steps
_LEAST_DAMPING, _MOST_DAMPING = 1e-5, 1e10  # of Levenberg and Marquardt, in the units of the information


@dataclass(frozen=True)
class _Step:
    """Where a step leads, the error there and what the quadratic model had foretold to gain."""

    T: FloatArray
    error: float
    foretold: float


def minimum(least_squares: LeastSquares, T_start: FloatArray) -> FloatArray:
    """Minimise a sum of squares.

    Parameters
    ----------
    least_squares : LeastSquares
        What is minimised.
    T_start : ndarray, shape (S, 4, 4)
        Poses to start from.

    Returns
    -------
    T : ndarray, shape (S, 4, 4)
        The poses of the minimum.
    """
    return _descend(least_squares, T_start, 0.0)


def rough_minimum(least_squares: LeastSquares, T_start: FloatArray) -> FloatArray:
    """Go most of the way to the minimum: enough to judge residuals by.

    Parameters
    ----------
    least_squares : LeastSquares
        What is minimised.
    T_start : ndarray, shape (S, 4, 4)
        Poses to start from.

    Returns
    -------
    T : ndarray, shape (S, 4, 4)
        Poses near the minimum.
    """
    return _descend(least_squares, T_start, _ROUGH_SHARE)


def one_step(least_squares: LeastSquares, T_start: FloatArray) -> FloatArray:
    """Go one step down.

    Parameters
    ----------
    least_squares : LeastSquares
        What is minimised.
    T_start : ndarray, shape (S, 4, 4)
        Poses to start from.

    Returns
    -------
    T : ndarray, shape (S, 4, 4)
        After a step of Gauss and Newton, or a damped one if that went uphill.
    """
    error = least_squares.error(T_start)
    step = _step(least_squares, T_start, 0.0)
    if step is None or step.error > error:
        step = _damped_step(least_squares, T_start, _LEAST_DAMPING)[0]
    return T_start if step is None else step.T


def covariances(least_squares: LeastSquares, T_world_anchor: FloatArray) -> FloatArray:
    """Covariance of each pose by itself.

    Parameters
    ----------
    least_squares : LeastSquares
        What is minimised.
    T_world_anchor : ndarray, shape (S, 4, 4)
        The poses of its minimum.

    Returns
    -------
    covariances : ndarray, shape (S, 6, 6)
        Along each body's own axes, rotation first [rad**2, rad m, m**2].
    """
    diagonal, below, _ = least_squares.normal_equations(T_world_anchor)
    return factorise(least_squares.pattern, diagonal, below).inverse_diagonal()


def _descend(least_squares: LeastSquares, T: FloatArray, share: float) -> FloatArray:
    """Steps until the quadratic model says that next to nothing is left to gain, or such a share of the error."""
    error = least_squares.error(T)
    for _ in range(_MAX_STEPS):
        step = _step(least_squares, T, 0.0)
        if step is None:
            break
        is_settled = step.foretold <= max(_SETTLED, share * step.error)
        if step.error <= error:
            T, error = step.T, step.error
        elif not is_settled:
            break
        if is_settled:
            return T
    return _descend_damped(least_squares, T)


def _descend_damped(least_squares: LeastSquares, T: FloatArray) -> FloatArray:
    """Levenberg's and Marquardt's steps, where undamped ones go uphill or the poses are not fully determined."""
    damping = _LEAST_DAMPING
    for _ in range(_MAX_DAMPED):
        step, damping = _damped_step(least_squares, T, damping)
        if step is None:
            break
        if step.foretold <= _SETTLED and damping <= _LEAST_DAMPING:  # a heavily damped step gains little anywhere
            return step.T
        T, damping = step.T, max(0.1 * damping, _LEAST_DAMPING)
    return T


def _damped_step(least_squares: LeastSquares, T: FloatArray, damping: float) -> tuple[_Step | None, float]:
    """The first step down as damping grows, and that damping; none where nothing leads down."""
    error = least_squares.error(T)
    while damping <= _MOST_DAMPING:
        step = _step(least_squares, T, damping)
        if step is not None and step.error <= error:
            return step, damping
        damping *= 10.0
    return None, damping


def _step(least_squares: LeastSquares, T: FloatArray, damping: float) -> _Step | None:
    """A step of Gauss and Newton, or a damped one; none where the poses are not determined so."""
    diagonal, below, gradient = least_squares.normal_equations(T)
    try:
        factor = factorise(least_squares.pattern, diagonal + damping * np.eye(6), below)
    except np.linalg.LinAlgError:
        return None
    delta = -factor.solve(gradient)
    there = moved(T, delta)
    # what the model gains: half of it where nothing damps
    foretold = -0.5 * float((gradient * delta).sum()) + 0.5 * damping * float((delta**2).sum())
    return _Step(there, least_squares.error(there), foretold)
