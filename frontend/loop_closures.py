"""Loop closures: which submaps to compare; accept, or reject with a reason."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.chance import expected_by_chance, joint_chance
from frontend.features import Features
from frontend.matching import MatchingConfig, agreeing, find_consensus, mutual_matches
from frontend.overlap import Layers, stack_layers
from frontend.pairs import PairConfig, PriorCovariance, pairs_to_compare, predicted_transform
from frontend.priors import Prior
from frontend.registration import RegistrationConfig
from frontend.relief import ReliefConfig, extract_relief
from frontend.search import SearchConfig, propose
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from frontend.verification import Verification, verify


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


class Rejection(StrEnum):
    """Why a candidate is no loop closure."""

    FLAT = "the relief is too faint against its uncertainty"
    NO_ALIGNMENT = "no alignment inside the gate overlaps enough"
    OUTSIDE_GATE = "the alignment left the gate of the dead reckoning"
    LITTLE_OVERLAP = "the overlap is too small"
    LOW_CORRELATION = "the heights correlate too little"
    BY_CHANCE = "the correlation may be chance"
    AMBIGUOUS = "another alignment is nearly as good"
    HEIGHTS_DISAGREE = "the heights differ by more than their uncertainty"
    LOOSE = "the alignment is not fixed in every direction"


class LoopClosureConfig(BaseModel):
    """Which submaps are compared and what is accepted."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    min_overlap: float = Field(
        default=0.25,
        gt=0,
        le=1,
        description="Least overlap [share of the smaller submap]: small ones correlate by chance.",
    )
    min_correlation: float = Field(
        default=0.2,
        gt=0,
        lt=1,
        description="Least correlation of the heights [1]: below, even a sure one aligns badly.",
    )
    max_chance: float = Field(
        default=1e-5,
        gt=0,
        lt=1,
        description="Largest chance that unrelated floors align as well inside the gate [1 a pair].",
    )
    min_lead: float = Field(
        default=1.5, ge=0, description="Least lead in significance over the next best alignment [standard deviations]."
    )
    min_information: float = Field(
        default=0.1,
        ge=0,
        description="Least root-mean-square relief over the height sigma [1]; below, floor is too flat to recognise.",
    )
    max_height_residual: float = Field(
        default=4.0,
        gt=0,
        description="Largest height difference [its standard deviations, root mean square]; sigmas are rough.",
    )
    max_sigma: float = Field(
        default=2.0, gt=0, description="Largest standard deviation of x and y [m]: a ridge fixes one of them only."
    )
    pairs: PairConfig = PairConfig()
    relief: ReliefConfig = ReliefConfig()
    search: SearchConfig = SearchConfig()
    matching: MatchingConfig = MatchingConfig()
    registration: RegistrationConfig = RegistrationConfig()


@dataclass(frozen=True)
class _Place:
    """What comparing a submap needs, made once."""

    number: int
    layers: Layers
    features: Features


@dataclass(frozen=True)
class _Evidence:
    """A verified alignment, the runner-up's significance and the feature matches that agree."""

    verification: Verification
    runner_up: float
    n_inliers: int


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
) -> Iterator[LoopClosure]:
    """Compare pairs one after the other, so that a caller can show progress.

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
    places = {i: _place(submaps[i], features[i], config) for i in sorted({i for pair in pairs for i in pair})}
    for target, source in pairs:
        T_dr = predicted_transform(submaps[target], submaps[source])
        prior = Prior(T_dr, prior_covariance(target, source), config.pairs.gate)
        yield _compare(places[target], places[source], prior, config)


def decide(verification: Verification, runner_up: float, prior: Prior, config: LoopClosureConfig) -> Rejection | None:
    """Accept a verified alignment, or say why not.

    Parameters
    ----------
    verification : Verification
        The best alignment of a pair.
    runner_up : float
        Significance of the best alignment elsewhere [standard deviations].
    prior : Prior
        Predicted transform with covariance.
    config : LoopClosureConfig
        Thresholds.

    Returns
    -------
    rejection : Rejection or None
        The first rule that is broken; None to accept.
    """
    v = verification
    broken = {
        Rejection.OUTSIDE_GATE: not prior.admits(v.T_target_source),
        Rejection.LITTLE_OVERLAP: v.overlap < config.min_overlap,
        Rejection.LOW_CORRELATION: v.correlation < config.min_correlation,
        Rejection.BY_CHANCE: chance_of(v, prior) > config.max_chance,
        Rejection.AMBIGUOUS: v.significance - runner_up < config.min_lead,
        Rejection.HEIGHTS_DISAGREE: not v.height_residual <= config.max_height_residual,
        Rejection.LOOSE: not max(v.sigmas[3], v.sigmas[4]) <= config.max_sigma,
    }
    return next((rejection for rejection, is_broken in broken.items() if is_broken), None)


def chance_of(verification: Verification, prior: Prior) -> float:
    """Chance that unrelated floors align as well as verified, their reflectivity heard as a second witness.

    Parameters
    ----------
    verification : Verification
        The best alignment of a pair.
    prior : Prior
        The gate that was searched.

    Returns
    -------
    chance : float
        A probability where it is small.
    """
    v = verification
    by_shape = expected_by_chance(v.significance, v.overlap_area, v.correlation_area, prior)
    return joint_chance(by_shape, v.reflectivity_significance)


def _place(submap: Submap, features: Features, config: LoopClosureConfig) -> _Place:
    """Prepare a submap for comparing."""
    return _Place(submap.number, stack_layers(extract_relief(submap, config.relief)), features)


def _compare(target: _Place, source: _Place, prior: Prior, config: LoopClosureConfig) -> LoopClosure:
    """Propose, verify and decide on one pair."""
    matches = mutual_matches(target.features, source.features)
    if min(target.layers.relief.information, source.layers.relief.information) < config.min_information:
        return _row(target, source, len(matches), None, Rejection.FLAT)
    evidence = _best_alignment(target, source, prior, config)
    if evidence is None:
        return _row(target, source, len(matches), None, Rejection.NO_ALIGNMENT)
    rejection = decide(evidence.verification, evidence.runner_up, prior, config)
    return _row(target, source, len(matches), evidence, rejection)


def _best_alignment(target: _Place, source: _Place, prior: Prior, config: LoopClosureConfig) -> _Evidence | None:
    """Verify what features and correlation propose; the most significant, and how close the next one comes."""
    matches = mutual_matches(target.features, source.features)
    proposals = find_consensus(target.features, source.features, matches, prior, config.matching)
    peaks = propose(target.layers.relief, source.layers.relief, prior, config.search)
    starts = [c.T_target_source for c in proposals] + [peak.T_target_source for peak in peaks]
    verified = [verify(target.layers, source.layers, T, config.registration) for T in starts]
    verified = sorted(verified, key=lambda v: -v.significance)
    if not verified:
        return None
    best = verified[0]
    others = [v.significance for v in verified if _is_elsewhere(v, best, config.search.separation)]
    p, q = target.features.keypoints[matches[:, 0]], source.features.keypoints[matches[:, 1]]
    n_inliers = int(agreeing(p, q, best.T_target_source, config.matching).sum())
    return _Evidence(best, max(others, default=0.0), n_inliers)


def _is_elsewhere(a: Verification, b: Verification, separation: float) -> bool:
    """Whether two alignments are different ones."""
    shift = (a.T_target_source - b.T_target_source)[:2, 3]
    return float(np.hypot(*shift)) > separation


def _row(
    target: _Place, source: _Place, n_matches: int, evidence: _Evidence | None, rejection: Rejection | None
) -> LoopClosure:
    """The record of one comparison."""
    v = evidence.verification if evidence else None
    return LoopClosure(
        target=target.number,
        source=source.number,
        T_target_source=v.T_target_source if v else np.full((4, 4), np.nan),
        sigmas=v.sigmas if v else np.full(6, np.nan),
        n_matches=n_matches,
        n_inliers=evidence.n_inliers if evidence else 0,
        correlation=v.correlation if v else float("nan"),
        overlap=v.overlap if v else float("nan"),
        accepted=rejection is None,
        reason=str(rejection) if rejection else "",
    )
