"""The rows of the table: what is given two submaps and a prior, and says where they match and how surely."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import peers

from frontend.acceptance import Rejection, chance_of, decide
from frontend.arrays import FloatArray
from frontend.chance import expected_by_chance
from frontend.features import Features, describe
from frontend.frames import planar_parameters
from frontend.loop_closures import LoopClosureConfig
from frontend.matching import agreeing, find_consensus, mutual_matches
from frontend.overlap import Layers, stack_layers
from frontend.priors import Prior
from frontend.relief import extract_relief
from frontend.search import search
from frontend.submaps import Submap
from frontend.turning import TurnedRelief
from frontend.verification import Preview, Verification, preview, verify
from sssslam.config import Config

CONFIG = LoopClosureConfig()
Numbers = dict[str, float | str | bool]


class Place:
    """What the rows need of a submap, made once."""

    def __init__(self, submap: Submap) -> None:
        relief, heading = extract_relief(submap, CONFIG.relief), planar_parameters(submap.T_world_submap_dr)[2]
        self.layers: Layers = stack_layers(relief)
        self.turned = TurnedRelief(relief, heading, CONFIG.search.yaw_step, CONFIG.search.search_spacing)
        self.features: Features = describe(submap, Config().features)

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
    """The chain of `frontend.loop_closures`, its numbers kept."""
    matches = mutual_matches(target.features, source.features)
    if min(place.layers.relief.information for place in (target, source)) < CONFIG.acceptance.min_information:
        return Found(NOTHING.T_target_source, -np.inf, {"accepted": False, "reason": str(Rejection.FLAT)})
    candidates = find_consensus(target.features, source.features, matches, prior, CONFIG.matching)
    peaks = search(target.turned, source.turned, prior, CONFIG.search)
    starts = [start.T_target_source for start in (*candidates, *peaks)]
    previews = [preview(target.layers, source.layers, T, CONFIG.registration) for T in starts]
    if not previews:
        return Found(NOTHING.T_target_source, -np.inf, {"accepted": False, "reason": str(Rejection.NO_ALIGNMENT)})
    first = max([p for p in previews if prior.admits(p.T_target_source)] or previews, key=lambda p: p.significance)
    best = verify(target.layers, source.layers, first.T_target_source, CONFIG.registration)
    elsewhere = [p.significance for p in previews if _is_elsewhere(p, best)]
    p, q = target.features.keypoints[matches[:, 0]], source.features.keypoints[matches[:, 1]]
    n_inliers = int(agreeing(p, q, best.T_target_source, CONFIG.matching).sum())
    return _judged(best, max(elsewhere, default=0.0), prior, (len(matches), n_inliers))


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


def _is_elsewhere(a: Preview, b: Verification) -> bool:
    """Whether two alignments are different ones."""
    return bool(np.hypot(*(a.T_target_source - b.T_target_source)[:2, 3]) > CONFIG.search.separation)


def _judged(best: Verification, runner_up: float, prior: Prior, matches: tuple[int, int]) -> Found:
    """The decision; the score is the logarithm of the chance where no other rule is broken."""
    rejection = decide(best, runner_up, prior, CONFIG.acceptance)
    chance = chance_of(best, prior)
    numbers: Numbers = {
        "accepted": rejection is None,
        "reason": str(rejection) if rejection else "",
        "chance": chance,
        "shape_chance": expected_by_chance(best.significance, best.overlap_area, best.correlation_area, prior),
        "runner_up": runner_up,
        "n_matches": matches[0],
        "n_inliers": matches[1],
        "inside": prior.admits(best.T_target_source),
        **{name: float(getattr(best, name)) for name in _KEPT},
        **{f"sigma_{name}": float(best.sigmas[k]) for name, k in (("x", 3), ("y", 4), ("yaw", 2))},
    }
    ranked = rejection in (None, Rejection.BY_CHANCE)
    return Found(best.T_target_source, -np.log10(max(chance, 1e-300)) if ranked else -np.inf, numbers)


_KEPT = (
    *("correlation", "significance", "reflectivity_correlation", "reflectivity_significance", "overlap"),
    *("overlap_area", "correlation_area", "height_residual", "tilt"),
)
ROWS: dict[str, Callable[[Place, Place, Prior], Found]] = {
    "chain": chain,
    "correlation": correlation_alone,
    "ransac": _peer(peers.ransac),
    "fgr": _peer(peers.fast_global),
    "kiss-matcher": _peer(peers.kiss_matcher),
    "map-closures": _peer(peers.map_closures),
}
