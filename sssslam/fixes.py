"""Fixes at the surface: which of them a pose graph may take, and at which anchors.

A recorded track that drifted under water is held where a satellite receiver saw the vehicle. A fix is taken by the
anchor nearest in time, moved there by dead reckoning. No fix is trusted blindly: those of one anchor must agree, each
must lie where the graph without it may expect the vehicle, and those of different anchors must fit one another.
"""

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from scipy.special import chdtri

from backend.dead_reckoning import DeadReckoning
from backend.do_no_harm import DoNoHarmConfig
from backend.pose_graph import PoseGraphSolution
from backend.sensor_reckoning import Fix, SensorReckoning, surface_fixes
from backend.sensor_series import Sensors
from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.recording import Recording
from sssslam.dead_reckoning import on_the_map

_logger = logging.getLogger(__name__)


class Rejection(StrEnum):
    """Why fixes do not hold the track."""

    DISAGREES = "they disagree with the others of their surfacing"
    BEYOND_DRIFT = "they lie farther off than dead reckoning can be wrong"
    CONTRADICTS = "they contradict the fixes of other surfacings"
    AGAINST_CLOSURES = "most loop closures do not hold with them"


@dataclass(frozen=True)
class AnchorFix:
    """What the fixes around an anchor say of it.

    Parameters
    ----------
    anchor : int
        Number of the anchor.
    ping : int
        Its ping.
    seen : ndarray, shape (2,)
        East and north of where the fixes saw the vehicle [m].
    arm : ndarray, shape (2,)
        From there to the anchor by dead reckoning [m].
    sigma : float
        Standard deviation of each, dead reckoning between fix and anchor included [m].
    n_fixes : int
        How many fixes say so.
    """

    anchor: int
    ping: int
    seen: FloatArray
    arm: FloatArray
    sigma: float
    n_fixes: int

    @property
    def position(self) -> FloatArray:
        """Shape (2,): east and north of the anchor by the fixes [m]."""
        return self.seen + self.arm


@dataclass(frozen=True)
class Fixes:
    """The fixes of a dive.

    Parameters
    ----------
    taken : tuple of AnchorFix
        Those that hold, or may hold, the track.
    rejected : dict of str to int
        How many do not, by reason.
    """

    taken: tuple[AnchorFix, ...] = ()
    rejected: dict[str, int] = field(default_factory=dict)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers for ``run.json``; empty for a dive without fixes."""
        n_taken, n_rejected = sum(fix.n_fixes for fix in self.taken), sum(self.rejected.values())
        return {"fixes": n_taken, "fixes_rejected": n_rejected} if n_taken + n_rejected else {}

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence for the report; none for a dive without fixes."""
        if not self.counts:
            return ()
        n = sum(self.counts.values())
        held = f"{self.counts['fixes']} of {n} hold the track, at {len(self.taken)} of its anchors"
        why = "".join(f"; {count} rejected: {reason}" for reason, count in self.rejected.items())
        return (f"Fixes at the surface: {held}{why}.",)

    def turned(self, yaw: FloatArray) -> "Fixes":
        """The fixes when the track between each and its anchor is turned.

        Parameters
        ----------
        yaw : ndarray, shape (S,)
            By how much at each anchor [rad].

        Returns
        -------
        fixes : Fixes
            The same, moved to the anchors along the turned track.
        """
        cos, sin = np.cos(yaw), np.sin(yaw)
        rotation = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)
        return replace(self, taken=tuple(replace(fix, arm=rotation[fix.anchor] @ fix.arm) for fix in self.taken))

    def without(self, dropped: Sequence[AnchorFix], reason: Rejection) -> "Fixes":
        """The fixes when some hold no longer.

        Parameters
        ----------
        dropped : sequence of AnchorFix
            Which.
        reason : Rejection
            Why.

        Returns
        -------
        fixes : Fixes
            The rest, those counted as rejected.
        """
        if not dropped:
            return self
        _logger.info("fixes at anchors %s rejected: %s", [fix.anchor for fix in dropped], reason)
        kept = tuple(fix for fix in self.taken if not any(fix is other for other in dropped))
        rejected = Counter(self.rejected)
        rejected[str(reason)] += sum(fix.n_fixes for fix in dropped)
        return Fixes(kept, dict(rejected))


def fixes_at_anchors(
    recording: Recording, anchors: IntArray, dead_reckoning: DeadReckoning, config: DoNoHarmConfig
) -> Fixes:
    """Gather the fixes of a dive at its anchors.

    Parameters
    ----------
    recording : Recording
        The dive; its sensors may hold fixes.
    anchors : ndarray of int, shape (S,)
        Pings of the anchors.
    dead_reckoning : DeadReckoning
        Moves a fix to its anchor. One that was made of the sensors has taken the fixes itself: then there are none.
    config : DoNoHarmConfig
        How far fixes may differ.

    Returns
    -------
    fixes : Fixes
        At most one an anchor: the middle of those that agree. Their errors at one surfacing are shared, so that many
        are no better than one.
    """
    return fixes_of_receiver(on_the_map(recording), anchors, dead_reckoning, config)


def fixes_of_receiver(
    sensors: Sensors, anchors: IntArray, dead_reckoning: DeadReckoning, config: DoNoHarmConfig
) -> Fixes:
    """Gather what a receiver saw at anchors, as `fixes_at_anchors`.

    Parameters
    ----------
    sensors : mapping of str to mapping of str to ndarray
        Series by sensor; those of gnss count, in the world frame [m].
    anchors, dead_reckoning, config
        As for `fixes_at_anchors`.

    Returns
    -------
    fixes : Fixes
        At most one an anchor.
    """
    if isinstance(dead_reckoning, SensorReckoning):
        return Fixes()
    seen = surface_fixes(sensors, dead_reckoning.time, dead_reckoning.config.sensors.gnss_sd)
    time = dead_reckoning.time[anchors]
    nearest = [int(np.argmin(np.abs(time - dead_reckoning.time[fix.ping]))) for fix in seen]
    taken, n_odd = [], 0
    for anchor in sorted(set(nearest)):
        own = [fix for fix, k in zip(seen, nearest, strict=True) if k == anchor]
        agreed = _agreed(own, anchor, int(anchors[anchor]), dead_reckoning, _limit(config))
        n_odd += len(own) - (agreed.n_fixes if agreed else 0)
        taken += [agreed] if agreed else []
    return Fixes(tuple(taken), {str(Rejection.DISAGREES): n_odd} if n_odd else {})


def expected_fixes(
    fixes: Fixes, solution: PoseGraphSolution, dead_reckoning: DeadReckoning, config: DoNoHarmConfig
) -> Fixes:
    """Keep the fixes that a graph solved without them may expect, and that fit one another.

    Parameters
    ----------
    fixes : Fixes
        At anchors of the graph.
    solution : PoseGraphSolution
        The graph without fixes.
    dead_reckoning : DeadReckoning
        How far the track may drift between two anchors.
    config : DoNoHarmConfig
        How far a fix may lie off: dead reckoning is believed to be at most so much worse than modelled.

    Returns
    -------
    fixes : Fixes
        The rest is rejected with a reason.
    """
    far = [fix for fix in fixes.taken if _distance(fix, solution, dead_reckoning, config) > _limit(config)]
    fixes = fixes.without(far, Rejection.BEYOND_DRIFT)
    return fixes.without(_contradicting(fixes.taken, dead_reckoning, config), Rejection.CONTRADICTS)


def _limit(config: DoNoHarmConfig) -> float:
    """Squared standard deviations that an error in the plane stays below."""
    return float(chdtri(2, 1.0 - config.residual_probability))


def _agreed(
    fixes: Sequence[Fix], anchor: int, ping: int, dead_reckoning: DeadReckoning, limit: float
) -> AnchorFix | None:
    """The middle of the fixes around an anchor that lie near the middle of all; None where most do not."""
    pings = np.array([fix.ping for fix in fixes])
    offsets = np.array([[fix.east, fix.north] for fix in fixes]) - dead_reckoning.positions[pings, :2]
    variance = fixes[0].sigma ** 2 + _moved_variance(dead_reckoning, ping, pings)
    near: BoolArray = ((offsets - np.median(offsets, axis=0)) ** 2).sum(axis=1) / variance <= limit
    if 2 * near.sum() <= len(fixes):
        return None
    middle = dead_reckoning.positions[pings[near], :2].mean(axis=0)
    seen = middle + np.median(offsets[near], axis=0)
    arm = dead_reckoning.positions[ping, :2] - middle
    return AnchorFix(anchor, ping, seen, arm, float(np.sqrt(variance[near].min())), int(near.sum()))


def _moved_variance(dead_reckoning: DeadReckoning, ping: int, others: IntArray) -> FloatArray:
    """Shape (P,): variance on each axis of what lies between pings: drift, and the heading's error over the arm."""
    drift = dead_reckoning.drift_variances(np.full(len(others), ping), others)[:, :2].max(axis=1)
    arm = dead_reckoning.positions[others, :2] - dead_reckoning.positions[ping, :2]
    return np.asarray(drift + dead_reckoning.sigmas[others, 3] ** 2 * (arm**2).sum(axis=1))


def _distance(
    fix: AnchorFix, solution: PoseGraphSolution, dead_reckoning: DeadReckoning, config: DoNoHarmConfig
) -> float:
    """Squared distance of a fix from the graph without it, over its variance."""
    T = solution.T_world_anchor[fix.anchor]
    known = (T[:3, :3] @ solution.covariances[fix.anchor, 3:, 3:] @ T[:3, :3].T)[:2, :2]
    unseen = np.diag(dead_reckoning.unseen_variances(0)[fix.ping, :2])
    covariance = config.max_correction**2 * (known + unseen) + fix.sigma**2 * np.eye(2)
    off = fix.position - T[:2, 3]
    return float(off @ np.linalg.solve(covariance, off))


def _contradicting(
    fixes: Sequence[AnchorFix], dead_reckoning: DeadReckoning, config: DoNoHarmConfig
) -> list[AnchorFix]:
    """The fewest fixes, or near it, without which no two contradict each other."""
    left, dropped = list(fixes), []
    while left:
        against = _conflicts(left, dead_reckoning, config).sum(axis=1)
        if not against.any():
            break
        # of two that only contradict each other nobody knows which is wrong: both go
        worst = np.flatnonzero(against == against.max())
        gone = worst if against.max() == 1 else worst[:1]
        dropped += [left[k] for k in gone]
        left = [fix for k, fix in enumerate(left) if k not in gone]
    return dropped


def _conflicts(fixes: Sequence[AnchorFix], dead_reckoning: DeadReckoning, config: DoNoHarmConfig) -> BoolArray:
    """Shape (F, F): whether two fixes are farther from each other than the track between them allows."""
    pings = np.array([fix.ping for fix in fixes])
    offsets = np.stack([fix.position for fix in fixes]) - dead_reckoning.positions[pings, :2]
    sigma = np.array([fix.sigma for fix in fixes])
    drift = np.stack([_moved_variance(dead_reckoning, int(ping), pings) for ping in pings])
    variance = config.max_correction**2 * np.maximum(drift, drift.T) + np.add.outer(sigma**2, sigma**2)
    apart = ((offsets[:, None] - offsets[None]) ** 2).sum(axis=2)
    return np.asarray(apart > _limit(config) * variance)
