"""Loop closures: which submaps to compare; accept, or reject with a reason."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import BaseModel, ConfigDict

from frontend.acceptance import AcceptanceConfig, Rejection, chance_of, decide, lead_of
from frontend.anywhere import anywhere
from frontend.arrays import FloatArray, IntArray
from frontend.comparison import Place, Places, is_of_neighbours, with_drift
from frontend.features import Features
from frontend.matching import MatchingConfig, agreeing, find_consensus, mutual_matches
from frontend.pairs import PairConfig, PriorCovariance, pairs_to_compare, predicted_transform
from frontend.priors import Prior
from frontend.registration import RegistrationConfig
from frontend.relief import ReliefConfig
from frontend.search import SearchConfig, search
from frontend.submaps import Submap
from frontend.threads import in_order
from frontend.trajectory import Trajectory
from frontend.verification import Preview, Verification, preview, verify


@dataclass(frozen=True)
class LoopClosure:
    """One candidate and what became of it.

    Parameters
    ----------
    target, source : int
        Submap numbers; the target is the earlier.
    T_target_source : ndarray, shape (4, 4)
        Takes points of the source's level frame to the target's; NaN where no transform was found.
    sigmas : ndarray, shape (6,)
        Standard deviations of the transform in the target frame [rad, rad, rad, m, m, m].
    n_matches, n_inliers : int
        Mutual feature matches, and how many of them agree with the transform.
    correlation : float
        Masked normalised cross-correlation of the heights over the overlap.
    overlap : float
        Share of the smaller submap that the other covers.
    accepted : bool
        Whether the closure enters, or stays in, the pose graph.
    reason : str
        Why not, without a comma; empty when accepted.
    is_from_appearance : bool
        Whether the place was chosen for its likeness alone, wherever dead reckoning has it.
    chance : float
        Chance that unrelated floors align as well inside the gate of the pair; NaN where there is no alignment.
    lead : float
        Lead in significance over the best alignment elsewhere [standard deviations]; NaN likewise.
    """

    target: int
    source: int
    T_target_source: FloatArray
    sigmas: FloatArray
    n_matches: int
    n_inliers: int
    correlation: float
    overlap: float
    accepted: bool
    reason: str
    is_from_appearance: bool = False
    chance: float = float("nan")
    lead: float = float("nan")


class LoopClosureConfig(BaseModel):
    """The steps from submaps to loop closures."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    pairs: PairConfig = PairConfig()
    relief: ReliefConfig = ReliefConfig(clip=8.0)  # boulders count here; as keypoints they would outnumber all else
    search: SearchConfig = SearchConfig()
    matching: MatchingConfig = MatchingConfig()
    registration: RegistrationConfig = RegistrationConfig()
    acceptance: AcceptanceConfig = AcceptanceConfig()


_COARSER = 2.0  # steps of the yaw over a whole circle: half as many, and alignment still finds its way from between


@dataclass(frozen=True)
class _Alignment:
    """The best alignment of a pair and the feature matches that agree with it."""

    verification: Verification
    n_inliers: int
    chance: float
    lead: float


def find_loop_closures(
    submaps: Sequence[Submap],
    features: Sequence[Features],
    trajectory_dr: Trajectory,
    prior_covariance: PriorCovariance,
    config: LoopClosureConfig | None = None,
) -> list[LoopClosure]:
    """Compare all pairs of submaps that may show the same place.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps of a dive, in order.
    features : sequence of Features
        Their features, in the same order.
    trajectory_dr : Trajectory
        Dead-reckoned body poses of all pings, for the distance along the track.
    prior_covariance : callable
        Covariance (6, 6) of ``T_target_source`` by dead reckoning, rotation first, in the target's frame, for two
        positions in ``submaps``.
    config : LoopClosureConfig, optional
        Gates and thresholds.

    Returns
    -------
    loop_closures : list of LoopClosure
        One a pair that reached matching, accepted or not.
    """
    config = config or LoopClosureConfig()
    pairs = pairs_to_compare(submaps, trajectory_dr, prior_covariance, config.pairs)
    return list(compare_pairs(pairs, submaps, features, prior_covariance, config))


def compare_pairs(
    pairs: Sequence[tuple[int, int]],
    submaps: Sequence[Submap],
    features: Sequence[Features],
    prior_covariance: PriorCovariance,
    config: LoopClosureConfig | None = None,
    places: Places | None = None,
) -> Iterator[LoopClosure]:
    """Compare pairs, several at once; they come one by one, so that a caller can show progress.

    Parameters
    ----------
    pairs : sequence of (int, int)
        Positions in ``submaps``, target before source, as from `frontend.pairs.pairs_to_compare`.
    submaps, features : sequence
        The submaps and their features.
    prior_covariance : callable
        As in `find_loop_closures`.
    config : LoopClosureConfig, optional
        Gates and thresholds.
    places : Places, optional
        Of these submaps under the same settings, where a caller wants to use them again.

    Yields
    ------
    loop_closure : LoopClosure
        One a pair, in their order.

    Raises
    ------
    ValueError
        If there are not as many features as submaps.
    """
    if len(features) != len(submaps):
        raise ValueError(f"every submap needs its features, got {len(features)} for {len(submaps)} submaps")
    config = config or LoopClosureConfig()
    places = places or Places(submaps, config.relief, config.search)
    prepared = _prepared(pairs, places, features, prior_covariance)

    def with_prior(pair: _Pair) -> tuple[_Pair, Prior]:
        target, source = pair.positions
        T_dr = predicted_transform(submaps[target], submaps[source])
        return pair, Prior(T_dr, prior_covariance(target, source), config.pairs.gate)

    yield from in_order(lambda job: _compare(*job, config), map(with_prior, prepared))


def recognise_pairs(
    pairs: Sequence[tuple[int, int]],
    submaps: Sequence[Submap],
    features: Sequence[Features],
    prior_covariance: PriorCovariance,
    config: LoopClosureConfig | None = None,
) -> Iterator[LoopClosure]:
    """Compare pairs as if nothing were known of where and at which heading they meet, and accept with more care.

    Parameters
    ----------
    pairs : sequence of (int, int)
        Positions in ``submaps``, target before source, as from `frontend.pairs.Partners.anywhere`.
    submaps, features : sequence
        The submaps and their features. The chance that each pair may have is shared among all of them.
    prior_covariance : callable
        As in `find_loop_closures`; says how surely a submap and its surroundings hang together.
    config : LoopClosureConfig, optional
        Gates and thresholds.

    Yields
    ------
    loop_closure : LoopClosure
        One a pair, in their order.
    """
    config = config or LoopClosureConfig()
    wide = config.search.model_copy(update={"yaw_step": _COARSER * config.search.yaw_step})
    config = config.model_copy(update={"acceptance": config.acceptance.anywhere(len(submaps)), "search": wide})
    prepared = _prepared(pairs, Places(submaps, config.relief, config.search), features, prior_covariance)
    yield from in_order(lambda pair: _recognise(pair, config), prepared)


@dataclass(frozen=True)
class _Pair:
    """Two positions, what is compared there, and how sure dead reckoning is between submaps."""

    positions: tuple[int, int]
    sides: tuple[Place, Place]
    features: tuple[Features, Features]
    covariance: PriorCovariance


def _prepared(
    pairs: Sequence[tuple[int, int]], places: Places, features: Sequence[Features], covariance: PriorCovariance
) -> Iterator[_Pair]:
    """Pairs made ready one by one, by whoever asks for the next."""
    for target, source in pairs:
        yield _Pair((target, source), places.sides(target, source), (features[target], features[source]), covariance)


def _recognise(pair: _Pair, config: LoopClosureConfig) -> LoopClosure:
    """Compare a pair wherever and however it may meet."""
    reliefs = [side.layers.relief for side in pair.sides]
    if not min(relief.area for relief in reliefs):
        closure = _row(pair, 0, None, Rejection.FLAT)
    else:
        closure = _compare(pair, anywhere(reliefs[0], reliefs[1], config.pairs.gate), config)
    return replace(closure, is_from_appearance=True)


def _compare(pair: _Pair, prior: Prior, config: LoopClosureConfig) -> LoopClosure:
    """Propose, verify and decide on one pair."""
    target, source = pair.sides
    matches = mutual_matches(*pair.features)
    least = min(place.layers.relief.information for place in (target, source))
    if least < config.acceptance.min_information:
        return _row(pair, len(matches), None, Rejection.FLAT)
    starts = _proposals(pair, matches, prior, config)
    previews = [preview(target.layers, source.layers, T, config.registration) for T in starts]
    if not previews:
        return _row(pair, len(matches), None, Rejection.NO_ALIGNMENT)
    inside = [p for p in previews if prior.admits(p.T_target_source)]
    first = max(inside or previews, key=lambda p: p.significance)
    best = verify(target.layers, source.layers, first.T_target_source, config.registration)
    best = with_drift(best, pair.sides, pair.positions, pair.covariance, config.registration.shear)
    others = [p.significance for p in previews if _is_elsewhere(p, best, config.search.separation)]
    runner_up = max(others, default=0.0)
    rejection = decide(best, runner_up, prior, config.acceptance)
    if rejection is None and is_of_neighbours(best, pair.sides, pair.positions):
        rejection = Rejection.OF_NEIGHBOURS
    p, q = (features.keypoints[matches[:, k]] for k, features in enumerate(pair.features))
    n_inliers = int(agreeing(p, q, best.T_target_source, config.matching).sum())
    found = _Alignment(best, n_inliers, chance_of(best, prior), lead_of(best, runner_up))
    return _row(pair, len(matches), found, rejection)


def _proposals(pair: _Pair, matches: IntArray, prior: Prior, config: LoopClosureConfig) -> list[FloatArray]:
    """Transforms that features or correlation propose."""
    candidates = find_consensus(*pair.features, matches, prior, config.matching)
    target, source = pair.sides
    peaks = search(target.turned, source.turned, prior, config.search)
    return [candidate.T_target_source for candidate in candidates] + [peak.T_target_source for peak in peaks]


def _is_elsewhere(a: Preview, b: Verification, separation: float) -> bool:
    """Whether two alignments are different ones."""
    shift = (a.T_target_source - b.T_target_source)[:2, 3]
    return float(np.hypot(*shift)) > separation


def _row(pair: _Pair, n_matches: int, alignment: _Alignment | None, rejection: Rejection | None) -> LoopClosure:
    """The record of one comparison."""
    v = alignment.verification if alignment else None
    return LoopClosure(
        target=pair.sides[0].number,
        source=pair.sides[1].number,
        T_target_source=v.T_target_source if v else np.full((4, 4), np.nan),
        sigmas=v.sigmas if v else np.full(6, np.nan),
        n_matches=n_matches,
        n_inliers=alignment.n_inliers if alignment else 0,
        correlation=v.correlation if v else float("nan"),
        overlap=v.overlap if v else float("nan"),
        accepted=rejection is None,
        reason=str(rejection) if rejection else "",
        chance=alignment.chance if alignment else float("nan"),
        lead=alignment.lead if alignment else float("nan"),
    )
