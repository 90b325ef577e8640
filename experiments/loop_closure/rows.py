"""The rows of the table: what is given two submaps and a prior, and says where they match and how surely."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import peers

from frontend.acceptance import Rejection
from frontend.arrays import FloatArray
from frontend.features import Features, describe
from frontend.frames import planar_parameters
from frontend.loop_closures import LoopClosure, LoopClosureConfig, compare_pairs
from frontend.overlap import Layers, stack_layers
from frontend.priors import Prior
from frontend.probability import log_odds
from frontend.relief import extract_relief
from frontend.search import search
from frontend.submaps import Submap
from frontend.turning import TurnedRelief
from sssslam.config import Config

CONFIG = LoopClosureConfig()
Numbers = dict[str, float | str | bool]


class Place:
    """What the rows need of a submap, each part made when first asked for."""

    def __init__(self, submap: Submap) -> None:
        self.submap = submap

    @cached_property
    def layers(self) -> Layers:
        """Its rasters."""
        return stack_layers(extract_relief(self.submap, CONFIG.relief))

    @cached_property
    def turned(self) -> TurnedRelief:
        """The same for the search."""
        heading = planar_parameters(self.submap.T_world_submap_dr)[2]
        return TurnedRelief(self.layers.relief, heading, CONFIG.search.yaw_step, CONFIG.search.search_spacing)

    @cached_property
    def features(self) -> Features:
        """Its keypoints and descriptors."""
        return describe(self.submap, Config().features)

    @cached_property
    def cloud(self) -> peers.Cloud:
        """Points and descriptors for the peers."""
        return peers.cloud_of(self.layers.relief)


@dataclass(frozen=True)
class Found:
    """Where a row says that two submaps match; NaN where it says nothing."""

    T_target_source: FloatArray
    score: float
    numbers: Numbers


NOTHING = Found(np.full((4, 4), np.nan), -np.inf, {})


def chain(target: Place, source: Place, prior: Prior) -> Found:
    """The library's own chain on a dive of two submaps that dead reckoning lays as the prior says."""
    submaps = [target.submap, _laid(source.submap, target.submap, prior)]
    (closure,) = compare_pairs(
        [(0, 1)], submaps, [target.features, source.features], lambda _target, _source: prior.covariance, CONFIG
    )
    ranked = closure.reason in ("", Rejection.BY_CHANCE)
    score = log_odds(closure.lead, closure.chance, CONFIG.acceptance.probability) if ranked else -np.inf
    return Found(closure.T_target_source, score, _numbers(closure))


def _laid(source: Submap, target: Submap, prior: Prior) -> Submap:
    """The source where a prior has it, its pings some after those of the target."""
    later = 2 * target.end_ping - source.first_ping
    return replace(
        source,
        T_world_submap_dr=target.T_world_submap_dr @ prior.T_target_source,
        first_ping=source.first_ping + later,
        end_ping=source.end_ping + later,
        anchor_ping=source.anchor_ping + later,
    )


def _numbers(closure: LoopClosure) -> Numbers:
    """The record of a comparison as numbers; the measured ones only where there was an alignment."""
    said: Numbers = {"accepted": closure.accepted, "reason": closure.reason}
    if not np.isfinite(closure.T_target_source).all():
        return said
    kept = {name: getattr(closure, name) for name in ("chance", "lead", "correlation", "overlap", "n_matches")}
    sigmas = {f"sigma_{name}": float(closure.sigmas[k]) for name, k in (("x", 3), ("y", 4), ("yaw", 2))}
    return said | kept | sigmas | {"n_inliers": closure.n_inliers}


def correlation_alone(target: Place, source: Place, prior: Prior) -> Found:
    """The highest peak of the correlation of heights, nothing else."""
    peaks = search(target.turned, source.turned, prior, CONFIG.search)
    return Found(peaks[0].T_target_source, peaks[0].significance, {}) if peaks else NOTHING


def _peer(find: Callable[[peers.Cloud, peers.Cloud], peers.Answer]) -> Callable[[Place, Place, Prior], Found]:
    """A row of a peer's; what lies outside the prior's gate counts as nothing found."""
    found = lru_cache(maxsize=1)(find)  # the prior only gates it

    def row(target: Place, source: Place, prior: Prior) -> Found:
        T, n_inliers = found(target.cloud, source.cloud)
        return Found(T, float(n_inliers), {}) if np.isfinite(T).all() and prior.admits(T) else NOTHING

    return row


ROWS: dict[str, Callable[[Place, Place, Prior], Found]] = {
    "chain": chain,
    "correlation": correlation_alone,
    "ransac": _peer(peers.ransac),
    "fgr": _peer(peers.fast_global),
    "kiss-matcher": _peer(peers.kiss_matcher),
    "map-closures": _peer(peers.map_closures),
}
