"""Tracks of one dive: dead-reckoned, ours, and ours with a part taken out or given."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from backend.dead_reckoning import DeadReckoning
from backend.factors import UnaryKnowledge, between_factor, first_pose_factor, unary_factors
from backend.optimiser import marginal_covariances, optimise
from backend.poses import RelativePose
from backend.solution import PoseGraphSolution, Withdrawal
from frontend.arrays import FloatArray
from frontend.frames import invert, level
from frontend.loop_closures import LoopClosure
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.config import Config
from sssslam.dead_reckoning import first_pose_sigmas
from sssslam.graph import anchor_pings, solve_graph
from sssslam.products.result import Result
from sssslam.stages import correct, decided

_NEAR, _FAR = 75.0, 150.0  # m between anchors whose swaths overlap; m along the track that are two windows
_SIGMAS = np.array([0.005, 0.005, 0.003, 0.1, 0.1, 0.1])  # of a closure given from the truth


class Variant(NamedTuple):
    """A track with its sigmas and what closures hold it."""

    trajectory: Trajectory
    sigmas: FloatArray
    closures: tuple[LoopClosure, ...]


def variants(result: Result, dead_reckoning: DeadReckoning, config: Config, seed: int) -> dict[str, Variant]:
    """All tracks that one run of the front end allows."""
    submaps, found = result.submaps, front_end(result)
    measured = [c for c in found if np.isfinite(c.T_target_source).all() and np.isfinite(c.sigmas).all()]
    everything = [replace(closure, accepted=True, reason="") for closure in measured]
    given = true_closures(result, np.random.default_rng(seed))
    ours = Variant(result.trajectory, result.sigmas, result.loop_closures)
    still = Variant(result.recording.trajectory_dr, dead_reckoning.sigmas, ())
    tracks = {"dead reckoning": still, "ours": ours}
    for name, closures in (("without verification", everything), ("true closures given", given)):
        solution = solve_graph(submaps, closures, dead_reckoning, config)
        track, sigmas = correct(result.recording.trajectory_dr, submaps, solution, dead_reckoning)
        tracks[name] = Variant(track, sigmas, tuple(decided(closures, solution)))
    tracks["plain least squares"] = _least_squares(result, found, dead_reckoning, config)
    return tracks


def front_end(result: Result) -> list[LoopClosure]:
    """The closures as the front end left them: what the back end withdrew is accepted again."""
    withdrawn = set(map(str, Withdrawal))
    return [replace(c, accepted=True, reason="") if c.reason in withdrawn else c for c in result.loop_closures]


def true_closures(result: Result, rng: np.random.Generator) -> list[LoopClosure]:
    """Every pair of submaps that truly lie near each other but not along the track, measured as well as ours."""
    assert result.recording.truth is not None
    anchors = anchor_pings(result.submaps)
    T = level(result.recording.truth.trajectory.poses[anchors])
    apart = np.linalg.norm(T[:, None, :2, 3] - T[None, :, :2, 3], axis=-1)
    along = result.recording.truth.trajectory.distance[anchors]
    is_far = np.abs(along[:, None] - along[None]) > _FAR
    pairs = np.argwhere(np.triu((apart < _NEAR) & is_far, 1))
    return [_given(result.submaps[t], result.submaps[s], invert(T[t]) @ T[s], rng) for t, s in pairs]


def _given(target: Submap, source: Submap, T_target_source: FloatArray, rng: np.random.Generator) -> LoopClosure:
    """A closure from the truth, with errors as its sigmas say."""
    error = _SIGMAS * rng.standard_normal(6)
    c, s = np.cos(error[2]), np.sin(error[2])
    T = T_target_source.copy()
    T[:2, :2] = np.array([[c, -s], [s, c]]) @ T[:2, :2]
    T[:3, 3] += error[3:]
    return LoopClosure(target.number, source.number, T, _SIGMAS, 0, 0, np.nan, np.nan, True, "")


def _least_squares(
    result: Result, closures: list[LoopClosure], dead_reckoning: DeadReckoning, config: Config
) -> Variant:
    """The front end's closures believed, every one: Levenberg-Marquardt and nothing else."""
    submaps, anchors = result.submaps, anchor_pings(result.submaps)
    T_dr = np.stack([submap.T_world_submap_dr @ submap.T_submap_body for submap in submaps])
    settings, believed = config.dead_reckoning, [closure for closure in closures if closure.accepted]
    factors = [first_pose_factor(T_dr[0], first_pose_sigmas(dead_reckoning, int(anchors[0])))]
    for k, T in enumerate(T_dr):
        factors += unary_factors(T, UnaryKnowledge(k, settings.depth_sd, settings.tilt_sd))
    for k in range(len(T_dr) - 1):
        covariance = dead_reckoning.odometry_covariance(anchors[k], anchors[k + 1])
        factors.append(between_factor(RelativePose(k, k + 1, invert(T_dr[k]) @ T_dr[k + 1], covariance)))
    factors += [between_factor(_between_bodies(submaps, closure)) for closure in believed]
    T = optimise(factors, T_dr)
    weights = np.ones(len(believed))
    solution = PoseGraphSolution(
        T, marginal_covariances(factors, T), weights, ("",) * len(believed), 1.0, np.nan, np.nan, ""
    )
    track, sigmas = correct(result.recording.trajectory_dr, submaps, solution, dead_reckoning)
    return Variant(track, sigmas, tuple(closures))


def _between_bodies(submaps: tuple[Submap, ...], closure: LoopClosure) -> RelativePose:
    """A closure between the bodies at the anchors, as the graph wants it."""
    target, source = submaps[closure.target], submaps[closure.source]
    T = invert(target.T_submap_body) @ closure.T_target_source @ source.T_submap_body
    return RelativePose(closure.target, closure.source, T, np.diag(closure.sigmas**2))
