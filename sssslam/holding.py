"""Holding: loop closures that a user accepted stay in the pose graph, whatever the back end thinks of them."""

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backend.hypotheses import fitted_scale
from backend.pose_graph import PoseGraph, PoseGraphSolution
from backend.problem import Estimate, Problem
from backend.solving import fitted, solution_of

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
    problem = _at_trusted_fixes(graph.problem(), solution)
    holding = np.union1d(np.flatnonzero(solution.is_inlier), lost).astype(np.int64)
    scale = fitted_scale(problem.compared(problem.T_world_anchor_dr)[holding], graph.consistency)
    start = Estimate(solution.T_world_anchor, holding, max(scale, solution.odometry_scale))
    try:
        held = solution_of(problem, _finite(fitted(problem, start)), _reasons(solution, lost, ""))
    except (RuntimeError, np.linalg.LinAlgError):  # as GTSAM and numpy say that a system has no one solution
        return replace(solution, reasons=_reasons(solution, lost, INSOLUBLE))
    return replace(held, fix_reasons=solution.fix_reasons)


def _at_trusted_fixes(problem: Problem, solution: PoseGraphSolution) -> Problem:
    """The graph without the fixes that the back end did not take."""
    judged = zip(problem.fixes, solution.fix_reasons, strict=True)
    return replace(problem, fixes=[fix for fix, reason in judged if not reason])


def _finite(estimate: Estimate) -> Estimate:
    """The estimate, unless it is none."""
    if not np.isfinite(estimate.T_world_anchor).all():
        raise RuntimeError("the poses of the minimum are not finite")
    return estimate


def _reasons(solution: PoseGraphSolution, closures: Sequence[int], reason: str) -> tuple[str, ...]:
    """The reasons with another one for some closures."""
    return tuple(reason if k in closures else old for k, old in enumerate(solution.reasons))
