"""Solving a graph: choose closures, see which of them the graph bears out, withdraw what does harm."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from backend.arrays import FloatArray, IntArray
from backend.beliefs import Chooser, Offer, start_poses
from backend.calibration import calibrated, uncalibrated_covariances
from backend.consistency import ConsistencyConfig, is_enough
from backend.do_no_harm import DoNoHarmConfig, MapAgreement, harmful_closures
from backend.factors import between_factors
from backend.fixes import harmful_fixes
from backend.g2o import g2o_text
from backend.gauss_newton import covariances
from backend.graduated import truncated_weights
from backend.optimiser import optimise
from backend.problem import Belief, Estimate, Problem
from backend.solution import INLIER_WEIGHT, PoseGraphSolution, Withdrawal

_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Rules:
    """By what closures are chosen, kept and withdrawn.

    Parameters
    ----------
    choose : Chooser
        The way to choose.
    inlier_probability : float
        Share of true closures whose residual stays below the truncation.
    consistency : ConsistencyConfig
        Which sets are believed.
    do_no_harm : DoNoHarmConfig
        When a closure is withdrawn although the optimiser kept it.
    agreement : callable or None
        How well the maps of two anchors agree at a relative pose.
    rng : numpy.random.Generator
        Source of whatever is drawn.
    """

    choose: Chooser
    inlier_probability: float
    consistency: ConsistencyConfig
    do_no_harm: DoNoHarmConfig
    agreement: MapAgreement | None
    rng: np.random.Generator


def solve_problem(problem: Problem, rules: Rules, withdrawn: Mapping[int, str]) -> PoseGraphSolution:
    """Find the poses that agree best with all that can be trusted.

    Parameters
    ----------
    problem : Problem
        The graph.
    rules : Rules
        What can be trusted.
    withdrawn : mapping of int to str
        Closures to leave out, by their position, and why.

    Returns
    -------
    solution : PoseGraphSolution
        Poses, covariances and the verdict on each closure and each fix.
    """
    harmful = harmful_fixes(problem, rules.consistency.max_odometry_scale, rules.do_no_harm.residual_probability)
    for fix, reason in harmful.items():
        _logger.warning("the fix of anchor %d is not taken: %s", problem.fixes[fix].anchor, reason)
    every = range(len(problem.fixes))
    trusted = replace(problem, fixes=[problem.fixes[fix] for fix in every if fix not in harmful])
    solution = _solved(trusted, rules, dict(withdrawn))
    return replace(solution, fix_reasons=tuple(harmful.get(fix, "") for fix in every))


def _solved(problem: Problem, rules: Rules, withdrawn: dict[int, str]) -> PoseGraphSolution:
    """The solution with all fixes and the closures that can be trusted."""
    offered = np.setdiff1d(np.arange(len(problem.closures)), list(withdrawn)).astype(np.int64)
    # which closures agree, and how far dead reckoning must be stretched for it
    belief = rules.choose(Offer(problem, offered, rules.consistency, rules.rng))
    believed, T, scale = belief.believed, belief.T_world_anchor, belief.odometry_scale
    while True:
        # which of them the whole graph bears out, if they are enough
        doubtful = problem.least_squares(scale, believed)
        weights, T = truncated_weights(doubtful, believed.size, T, rules.inlier_probability)
        holding = believed[weights > INLIER_WEIGHT]
        if not holding.size or not is_enough(problem.compared(T, holding), rules.consistency):
            return solution_of(problem, _without_closures(problem), _reasons(problem, belief, holding[:0], withdrawn))
        # GTSAM's least squares over what holds, and whether it does harm
        estimate = fitted(problem, Estimate(T, holding, scale))
        T = estimate.T_world_anchor
        harmful = harmful_closures(estimate, problem, rules.agreement, rules.do_no_harm)
        if not harmful:
            return solution_of(problem, estimate, _reasons(problem, belief, holding, withdrawn))
        withdrawn |= harmful
        believed = np.setdiff1d(believed, list(harmful))


def _without_closures(problem: Problem) -> Estimate:
    """What is left where no closure is believed: dead reckoning as it came, or drawn to the fixes."""
    return Estimate(start_poses(problem).copy(), np.zeros(0, dtype=np.int64), 1.0)


def fitted(problem: Problem, estimate: Estimate) -> Estimate:
    """GTSAM's least squares over the closures that hold.

    Parameters
    ----------
    problem : Problem
        The graph.
    estimate : Estimate
        Where to start, what holds, and how far the odometry is stretched.

    Returns
    -------
    estimate : Estimate
        The same at the poses of the minimum.
    """
    known, closures = problem.known_factors(estimate.odometry_scale), problem.chosen(estimate.holding)
    return replace(estimate, T_world_anchor=optimise([*known, *between_factors(closures)], estimate.T_world_anchor))


def solution_of(problem: Problem, estimate: Estimate, reasons: tuple[str, ...]) -> PoseGraphSolution:
    """Solve for what is constant of the sensors' errors, and gather all that is reported.

    Parameters
    ----------
    problem : Problem
        The graph.
    estimate : Estimate
        Its minimum, as `fitted` gives it.
    reasons : tuple of str, length C
        Why a closure does not hold the graph; empty where it does.

    Returns
    -------
    solution : PoseGraphSolution
        Poses and covariances; the very poses where neither a closure nor a fix holds.
    """
    held, estimate, covariances = _calibrated(problem, estimate)
    closures, T, scale = problem.chosen(estimate.holding), estimate.T_world_anchor, estimate.odometry_scale
    least_squares = held.least_squares(scale, estimate.holding)
    weights: FloatArray = np.zeros(len(problem.closures))
    weights[estimate.holding] = 1.0
    return PoseGraphSolution(
        T_world_anchor=T,
        covariances=covariances,
        closure_weights=weights,
        reasons=reasons,
        odometry_scale=scale,
        error_before=least_squares.error(problem.T_world_anchor_dr),
        error_after=least_squares.error(T),
        g2o=g2o_text(T, [*held.stretched(scale), *closures]),
    )


def _calibrated(problem: Problem, estimate: Estimate) -> tuple[Problem, Estimate, FloatArray]:
    """The graph without constant errors, where they can be told, its minimum and its covariances."""
    if problem.constants is None:
        least_squares = problem.least_squares(estimate.odometry_scale, estimate.holding)
        return problem, estimate, covariances(least_squares, estimate.T_world_anchor)
    has_more = bool(estimate.holding.size or problem.fixes)
    calibration = calibrated(problem, estimate) if has_more else None
    if calibration is None:
        return problem, estimate, uncalibrated_covariances(problem, estimate)
    return calibration.problem, fitted(calibration.problem, calibration.estimate), calibration.covariances


def _reasons(problem: Problem, belief: Belief, holding: IntArray, withdrawn: Mapping[int, str]) -> tuple[str, ...]:
    """Why each closure does not hold the graph."""
    other = Withdrawal.INCONSISTENT if belief.believed.size else Withdrawal.ALONE
    reasons = [str(other)] * len(problem.closures)
    for closure in belief.believed:
        reasons[closure] = str(Withdrawal.OUTLIER)
    for closure in holding:
        reasons[closure] = ""
    return tuple(withdrawn.get(closure, reason) for closure, reason in enumerate(reasons))
