"""Ways to solve a graph with false closures: the usual ones, and those of the back end."""

from collections.abc import Callable
from dataclasses import dataclass

import gtsam
import numpy as np
from scenes import Survey
from scipy.special import chdtri

from backend.arrays import FloatArray, IntArray
from backend.cliques import CliqueSearch
from backend.factors import between_factors, graph_of, pose_values, poses_of
from backend.gauss_newton import minimum
from backend.graduated import truncated_weights
from backend.pose_graph import PoseGraph, PoseGraphConfig
from backend.poses import RelativePose
from backend.solution import INLIER_WEIGHT

FIRST_POSE = np.full(6, 1e-3)
M = gtsam.noiseModel.mEstimator


@dataclass(frozen=True)
class Result:
    """Poses and, where a method decides, which closures it took."""

    T: FloatArray
    taken: IntArray | None


Method = Callable[[Survey, list[RelativePose]], Result]


def make_graph(survey: Survey, closures: list[RelativePose], config: PoseGraphConfig | None = None) -> PoseGraph:
    """The graph that every method is given."""
    graph = PoseGraph(survey.T_dr, config)
    graph.add_first_pose(FIRST_POSE)
    for step in survey.odometry:
        graph.add_odometry(step.target, step.source, step.T_target_source, step.covariance)
    for anchor in range(graph.n_anchors):
        graph.add_depth_and_tilt(anchor, 0.1, 0.005)
    for closure in closures:
        sigmas = np.sqrt(np.diag(closure.covariance))
        graph.add_closure(closure.target, closure.source, closure.T_target_source, sigmas)
    return graph


def least_squares(survey: Survey, closures: list[RelativePose]) -> Result:
    """Levenberg-Marquardt over everything."""
    problem, every = make_graph(survey, closures).problem(), np.arange(len(closures))
    return Result(minimum(problem.least_squares(1.0, every), survey.T_dr), None)


def robust(kernel: gtsam.noiseModel.mEstimator.Base) -> Method:
    """Levenberg-Marquardt with a robust kernel on the closures."""

    def solve(survey: Survey, closures: list[RelativePose]) -> Result:
        graph = graph_of(make_graph(survey, closures).problem().known_factors(1.0))
        for factor in between_factors(closures):
            noise = gtsam.noiseModel.Robust.Create(kernel, factor.noiseModel())
            graph.add(gtsam.BetweenFactorPose3(*factor.keys(), factor.measured(), noise))
        return Result(poses_of(gtsam.LevenbergMarquardtOptimizer(graph, pose_values(survey.T_dr)).optimize()), None)

    return solve


def graduated(survey: Survey, closures: list[RelativePose]) -> Result:
    """Graduated non-convexity over everything."""
    return _graduated(survey, closures, np.arange(len(closures)))


def cliques(survey: Survey, closures: list[RelativePose]) -> Result:
    """Pairwise consistency maximisation as published, then graduated non-convexity."""
    graph = make_graph(survey, closures)
    is_consistent = graph.innovations.pair_distances(1.0) < chdtri(3, 1e-3)
    members = CliqueSearch(is_consistent, np.arange(len(closures)), 1.0, 20_000).run()
    return _graduated(survey, closures, np.flatnonzero(members))


def library(method: str) -> Method:
    """A way of the back end."""

    def solve(survey: Survey, closures: list[RelativePose]) -> Result:
        solution = make_graph(survey, closures, PoseGraphConfig(method=method)).solve()
        return Result(solution.T_world_anchor, np.flatnonzero(solution.is_inlier))

    return solve


def _graduated(survey: Survey, closures: list[RelativePose], members: IntArray) -> Result:
    problem = make_graph(survey, closures).problem()
    weights, T = truncated_weights(problem.least_squares(1.0, members), members.size, survey.T_dr, 0.9999)
    holding = members[weights > INLIER_WEIGHT]
    return Result(minimum(problem.least_squares(1.0, holding), T), holding)


METHODS: dict[str, Method] = {
    "LM": least_squares,
    "Huber": robust(M.Huber.Create(1.345)),
    "Cauchy": robust(M.Cauchy.Create(1.0)),
    "DCS": robust(M.DCS.Create(10.0)),
    "GNC": graduated,
    "PCM+GNC": cliques,
    "atlas": library("atlas"),
    "particles": library("particles"),
    "incremental": library("incremental"),
    "ours": library("consistent"),
}
