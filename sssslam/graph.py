"""The pose graph of a dive: the two halves hand over plain values here, and fixes at the surface come in."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from backend.dead_reckoning import DeadReckoning
from backend.pose_graph import PoseGraph, PoseGraphSolution
from frontend.arrays import FloatArray, IntArray
from frontend.comparison import Places
from frontend.frames import invert
from frontend.loop_closures import LoopClosure
from frontend.pairs import PriorCovariance
from frontend.submaps import Submap
from sssslam.config import Config
from sssslam.dead_reckoning import first_pose_sigmas
from sssslam.fixes import Fixes, Rejection, expected_fixes
from sssslam.holding import hold
from sssslam.map_agreement import MapAgreement
from sssslam.overrides import Overrides


@dataclass(frozen=True)
class DiveGraph:
    """The pose graph of a dive, with what it needs to be solved.

    Parameters
    ----------
    graph : PoseGraph
        Anchors, odometry, depth, attitude and the closures that the front end accepted.
    first_ping : int
        Ping of the first anchor.
    forced : tuple of int
        Closures that a user accepted: the back end does not withdraw them.
    maps : MapAgreement
        How well the submaps agree where the graph lays them.
    seed : int
        Of what the back end draws.
    """

    graph: PoseGraph
    first_ping: int
    forced: tuple[int, ...]
    maps: MapAgreement
    seed: int

    def solve(self) -> PoseGraphSolution:
        """Find the poses of the anchors.

        Returns
        -------
        solution : PoseGraphSolution
            Poses, covariances and the verdict on each closure that entered.
        """
        found = self.graph.solve(agreement=self.maps, rng=np.random.default_rng(self.seed))
        return hold(self.graph, found, self.forced)


def make_graph(
    submaps: Sequence[Submap],
    closures: Sequence[LoopClosure],
    dead_reckoning: DeadReckoning,
    config: Config,
    overrides: Overrides | None = None,
    places: Places | None = None,
) -> DiveGraph:
    """Join the anchors by odometry, depth, attitude and the accepted closures.

    Parameters
    ----------
    submaps : sequence of Submap
        Their anchors are the nodes.
    closures : sequence of LoopClosure
        Those that the front end accepted enter.
    dead_reckoning : DeadReckoning
        Says how uncertain odometry is.
    config : Config
        Settings of the back end.
    overrides : Overrides, optional
        Closures that a user accepted: no false one is as good, and the back end does not withdraw them.
    places : Places, optional
        What the front end made ready of these submaps to compare them.

    Returns
    -------
    graph : DiveGraph
        Ready to be solved.
    """
    anchors, T_world_body_dr = anchor_pings(submaps), anchor_poses(submaps)
    graph = PoseGraph(T_world_body_dr, config.pose_graph, config.consistency, config.do_no_harm)
    graph.add_first_pose(first_pose_sigmas(dead_reckoning, int(anchors[0])))
    maps, settings = MapAgreement(submaps, config.loop_closures, places), config.dead_reckoning
    for k in range(len(submaps)):
        graph.add_depth_and_tilt(k, settings.depth_sd, settings.tilt_sd)
    for k in range(len(submaps) - 1):
        T_target_source = invert(T_world_body_dr[k]) @ T_world_body_dr[k + 1]
        graph.add_odometry(k, k + 1, T_target_source, dead_reckoning.odometry_covariance(anchors[k], anchors[k + 1]))
    constants = dead_reckoning.constant_errors(anchors)
    if constants is not None:
        graph.add_constant_errors(constants)
    entering = [closure for closure in closures if closure.accepted]
    forced = [k for k, closure in enumerate(entering) if overrides and overrides.accepts(closure)]
    for k, closure in enumerate(entering):
        target, source = submaps[closure.target], submaps[closure.source]
        T_bodies = invert(target.T_submap_body) @ closure.T_target_source @ source.T_submap_body
        n_tried = len(closures) * (len(submaps) if closure.is_from_appearance else 1)
        chance = 0.0 if k in forced else n_tried * float(np.nan_to_num(closure.chance, nan=1.0))
        graph.add_closure(closure.target, closure.source, T_bodies, closure.sigmas, chance)
    return DiveGraph(graph, int(anchors[0]), tuple(forced), maps, config.seed)


def solve_graph(
    submaps: Sequence[Submap],
    closures: Sequence[LoopClosure],
    dead_reckoning: DeadReckoning,
    config: Config,
    overrides: Overrides | None = None,
) -> PoseGraphSolution:
    """Poses of the anchors from odometry, depth, attitude and the accepted closures.

    Parameters
    ----------
    submaps, closures, dead_reckoning, config, overrides
        As for `make_graph`.

    Returns
    -------
    solution : PoseGraphSolution
        Poses, covariances and the verdict on each closure that entered.
    """
    return make_graph(submaps, closures, dead_reckoning, config, overrides).solve()


def solve_at_fixes(
    dive: DiveGraph, fixes: Fixes, dead_reckoning: DeadReckoning, config: Config
) -> tuple[PoseGraphSolution, Fixes]:
    """Poses of the anchors, held by those fixes at the surface that can be trusted.

    Parameters
    ----------
    dive : DiveGraph
        The graph.
    fixes : Fixes
        What a receiver saw at its anchors.
    dead_reckoning : DeadReckoning
        How far the track may drift.
    config : Config
        Settings of the back end.

    Returns
    -------
    solution : PoseGraphSolution
        As `DiveGraph.solve` gives it where no fix is trusted.
    fixes : Fixes
        Those that hold the graph; the others with a reason.
    """
    without = dive.solve()
    fixes = expected_fixes(fixes, without, dead_reckoning, config.do_no_harm)
    if not fixes.taken:
        return without, fixes
    held = _with_fixes(dive, fixes, dead_reckoning).solve()
    # what lies between a fix and its anchor turns with the track
    turn = _yaw(held.T_world_anchor) - _yaw(dive.graph.T_world_anchor_dr)
    held = _with_fixes(dive, fixes.turned(turn), dead_reckoning).solve()
    lost = without.is_inlier & ~held.is_inlier
    if 2 * lost.sum() > without.is_inlier.sum():
        return without, fixes.without(fixes.taken, Rejection.AGAINST_CLOSURES)
    return held, fixes


def _with_fixes(dive: DiveGraph, fixes: Fixes, dead_reckoning: DeadReckoning) -> DiveGraph:
    """The same graph with fixes; a track that began at a fix is no better known than a fix."""
    graph, began = deepcopy(dive.graph), first_pose_sigmas(dead_reckoning, dive.first_ping)
    began[3:5] = np.hypot(began[3:5], dead_reckoning.config.sensors.gnss_sd)
    graph.add_first_pose(began)
    for fix in fixes.taken:
        graph.add_fix(fix.anchor, float(fix.position[0]), float(fix.position[1]), fix.sigma)
    return replace(dive, graph=graph)


def _yaw(T_world_body: FloatArray) -> FloatArray:
    return np.asarray(np.arctan2(T_world_body[:, 1, 0], T_world_body[:, 0, 0]))


def anchor_pings(submaps: Sequence[Submap]) -> IntArray:
    """Anchor pings of submaps.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps.

    Returns
    -------
    pings : ndarray of int, shape (S,)
        One a submap.
    """
    return np.array([submap.anchor_ping for submap in submaps], dtype=np.int64)


def anchor_poses(submaps: Sequence[Submap]) -> FloatArray:
    """Dead-reckoned body poses of the anchors.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps.

    Returns
    -------
    T_world_body_dr : ndarray, shape (S, 4, 4)
        One a submap.
    """
    return np.stack([submap.T_world_submap_dr @ submap.T_submap_body for submap in submaps])


def prior_covariance(submaps: Sequence[Submap], dead_reckoning: DeadReckoning) -> PriorCovariance:
    """What dead reckoning says of the pose of one submap seen from another.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps.
    dead_reckoning : DeadReckoning
        The uncertainty of the track.

    Returns
    -------
    covariance : callable
        Takes two positions in ``submaps``; gives the (6, 6) covariance in the target's level frame, rotation first.
    """

    return _Covariances(submaps, dead_reckoning)


@dataclass(frozen=True)
class _Covariances:
    """Covariances by dead reckoning, of one pair or of many at once."""

    submaps: Sequence[Submap]
    dead_reckoning: DeadReckoning

    def __call__(self, target: int, source: int) -> FloatArray:
        return np.asarray(self.many(np.array([target]), source)[0])

    def many(self, targets: IntArray, source: int) -> FloatArray:
        """Shape (P, 6, 6): of one source seen from many targets."""
        turn = np.zeros((len(targets), 6, 6))
        turn[:, :3, :3] = np.array([self.submaps[t].T_submap_body[:3, :3] for t in targets]).reshape(-1, 3, 3)
        turn[:, 3:, 3:] = turn[:, :3, :3]
        anchors = np.array([self.submaps[t].anchor_ping for t in targets], dtype=np.int64)
        relative = self.dead_reckoning.relative_covariances(anchors, np.full_like(anchors, self._anchor(source)))
        return np.asarray(turn @ relative @ turn.transpose(0, 2, 1))

    def _anchor(self, source: int) -> int:
        return self.submaps[source].anchor_ping
