"""Holding: loop closures that a user accepted stay in the pose graph, whatever the back end thinks of them."""

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backend.factors import between_factors
from backend.g2o import g2o_text
from backend.hypotheses import fitted_scale
from backend.optimiser import half_squared_error, marginal_covariances, optimise
from backend.pose_graph import PoseGraph, PoseGraphSolution
from backend.problem import Problem
from frontend.arrays import IntArray

INSOLUBLE = "accepted by the user but the graph has no solution with it"

_logger = logging.getLogger(__name__)


def hold(graph: PoseGraph, solution: PoseGraphSolution, forced: Sequence[int]) -> PoseGraphSolution:
    """Solve a graph again with loop closures that must hold.

    Parameters
    ----------
    graph : PoseGraph
        The graph.
    solution : PoseGraphSolution
        What the back end made of it.
    forced : sequence of int
        Positions of the closures that must hold.

    Returns
    -------
    solution : PoseGraphSolution
        As it was where all of them hold. Else least squares over them and those that the back end kept, dead reckoning
        stretched as far as they need it; where that has no solution, as it was, and why.
    """
    lost = [closure for closure in forced if not solution.is_inlier[closure]]
    if not lost:
        return solution
    _logger.info("held against the back end: %s", [solution.reasons[closure] for closure in lost])
    problem = graph.problem()
    holding = np.union1d(np.flatnonzero(solution.is_inlier), lost).astype(np.int64)
    fitted = fitted_scale(problem.compared(problem.T_world_anchor_dr)[holding], graph.consistency)
    start = replace(solution, odometry_scale=max(fitted, solution.odometry_scale))
    try:
        return replace(_solved(problem, holding, start), reasons=_reasons(solution, lost, ""))
    except RuntimeError:  # as GTSAM says that a system has no one solution
        return replace(solution, reasons=_reasons(solution, lost, INSOLUBLE))


def _solved(problem: Problem, holding: IntArray, start: PoseGraphSolution) -> PoseGraphSolution:
    """Least squares over what holds, from some poses and at their scale of the odometry."""
    scale, closures = start.odometry_scale, problem.chosen(holding)
    factors = [*problem.known_factors(scale), *between_factors(closures)]
    T = optimise(factors, start.T_world_anchor)
    if not np.isfinite(T).all():
        raise RuntimeError("the poses of the minimum are not finite")
    return replace(
        start,
        T_world_anchor=T,
        covariances=marginal_covariances(factors, T),
        closure_weights=np.isin(np.arange(len(problem.closures)), holding).astype(np.float64),
        error_before=half_squared_error(factors, problem.T_world_anchor_dr),
        error_after=half_squared_error(factors, T),
        g2o=g2o_text(T, [*problem.stretched(scale), *closures]),
    )


def _reasons(solution: PoseGraphSolution, closures: Sequence[int], reason: str) -> tuple[str, ...]:
    """The reasons with another one for some closures."""
    return tuple(reason if k in closures else old for k, old in enumerate(solution.reasons))
