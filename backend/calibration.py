"""Calibration: constant errors of the sensors, solved for beside the poses once the closures that hold are chosen."""

from dataclasses import dataclass, replace

import numpy as np

from backend.arrays import FloatArray
from backend.block_cholesky import factorise
from backend.bordered import Bordered, bordered, log_whitening
from backend.constant_errors import corrected_steps
from backend.pose_kernels import moved
from backend.problem import Estimate, Problem
from backend.terms import RelativeTerms

_MAX_STEPS = 20
_SETTLED = 1e-4  # error left to gain [1]
_DOUBT = 3.0  # log of how much better errors that change must explain closures than constant ones, which are usual


@dataclass(frozen=True)
class Calibration:
    """A graph whose constant errors are solved for.

    Parameters
    ----------
    problem : Problem
        By what was measured without them.
    estimate : Estimate
        Poses of its minimum.
    covariances : ndarray, shape (S, 6, 6)
        Of each pose along its body's own axes, the constant errors as uncertain as they are left.
    """

    problem: Problem
    estimate: Estimate
    covariances: FloatArray


def calibrated(problem: Problem, estimate: Estimate) -> Calibration | None:
    """Solve for the constant errors of the sensors too.

    Parameters
    ----------
    problem : Problem
        The graph, with constant errors.
    estimate : Estimate
        Its solution with odometry whose errors are all independent.

    Returns
    -------
    calibration : Calibration or None
        None where errors that change from step to step explain the closures much better, or no minimum is found.
    """
    assert problem.constants is not None
    problem = replace(problem, constants=problem.constants.of_steps())
    squares = bordered(problem, estimate.holding, estimate.odometry_scale)
    try:
        T, size = _minimum(squares, estimate.T_world_anchor)
        found = squares.equations(T, size)
        log_evidence = squares.log_whitening() - squares.error(T, size) - 0.5 * found.log_determinant
        if log_evidence + _DOUBT < _log_evidence_of_changing(problem, estimate):
            return None
    except np.linalg.LinAlgError:
        return None
    held = _without(problem, squares.at(size).relative)
    return Calibration(held, replace(estimate, T_world_anchor=T), found.covariances)


def uncalibrated_covariances(problem: Problem, estimate: Estimate) -> FloatArray:
    """Covariances of poses where the constant errors are not solved for, but are there.

    Parameters
    ----------
    problem : Problem
        The graph, with constant errors.
    estimate : Estimate
        Its solution.

    Returns
    -------
    covariances : ndarray, shape (S, 6, 6)
        Along each body's own axes, rotation first; where no closure holds, those of dead reckoning itself.
    """
    holding, scale = estimate.holding, estimate.odometry_scale
    squares = bordered(problem, holding, scale)
    if holding.size:
        squares = replace(squares, least_squares=problem.least_squares(scale, holding))
    return squares.equations(estimate.T_world_anchor, np.zeros(squares.tangents.shape[2])).unsolved_covariances(scale)


def _minimum(squares: Bordered, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gauss's and Newton's steps in poses and constant errors."""
    size = np.zeros(squares.tangents.shape[2])
    error = squares.error(T, size)
    for _ in range(_MAX_STEPS):
        delta, change, foretold = squares.equations(T, size).step
        there, other = moved(T, delta), size + change
        reached = squares.error(there, other)
        if reached <= error:
            T, size, error = there, other, reached
        if foretold <= _SETTLED:
            return T, size
        if error != reached:
            break
    raise np.linalg.LinAlgError("steps for poses and constant errors do not settle")


def _log_evidence_of_changing(problem: Problem, estimate: Estimate) -> float:
    """Logarithm of how likely all that was measured is where errors are independent from step to step; Laplace."""
    squares, T = problem.least_squares(estimate.odometry_scale, estimate.holding), estimate.T_world_anchor
    diagonal, below, _ = squares.normal_equations(T)
    log_determinant = factorise(squares.pattern, diagonal, below).log_determinant
    return log_whitening(squares.relative, len(T)) - squares.error(T) - 0.5 * log_determinant


def _without(problem: Problem, terms: RelativeTerms) -> Problem:
    """The graph as if its sensors had no constant errors, by what was measured without them."""
    constants, n = problem.constants, len(problem.T_world_anchor_dr)
    assert constants is not None
    T = problem.T_world_anchor_dr.copy()
    T[0] = terms.T_target_source[0]
    return replace(
        problem,
        T_world_anchor_dr=T,
        first_pose_sigmas=constants.first_pose(problem.first_pose_sigmas)[1],
        odometry=corrected_steps(problem.odometry, terms.T_target_source[1:n], constants),
        constants=None,
    )
