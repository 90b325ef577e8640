"""Consistency: which loop closures agree with one another, and how far dead reckoning must be stretched for it.

Pairwise consistency maximisation (Mangelson et al., ICRA 2018, :doi:`10.1109/ICRA.2018.8460217`): two closures agree
when their difference lies within their own noise and that of the dead reckoning which only one of their loops contains.
The largest set in which all agree is a hypothesis. Closures between the same two stretches of the track share one vote,
for they share their errors.

How bad dead reckoning was is not known beforehand. A drift three times worse than modelled makes true closures of
distant loops disagree; a model three times too wide lets false ones in. So each hypothesis is made at several scales of
the odometry's standard deviations, and the one that explains its closures best is taken: the likelihood of its
residuals, drift and all, against that of as many false closures spread evenly over the gate.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.stats import chi2

from backend.arrays import BoolArray, IntArray
from backend.cliques import CliqueSearch
from backend.evidence import gains_beside, log_evidence, without_losers
from backend.innovations import Innovations

_SCALE_STEP = np.sqrt(2.0)  # from one scale of the odometry to the next; finer than any few closures can tell
_DIMENSIONS = 3  # yaw, x, y
_MAX_ROUNDS = 5  # of adding to a set and dropping from it; most settle in two


class ConsistencyConfig(BaseModel):
    """Which sets of loop closures are believed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    pair_probability: float = Field(
        default=0.999,
        gt=0,
        lt=1,
        description="Share of pairs of true closures [1] that pass as consistent; high, as one failure splits a set.",
    )
    stretch: int = Field(
        default=4,
        ge=1,
        description="Closures nearer at both ends [anchors] share a vote and maybe an error; two window lengths.",
    )
    repeat_vote: float = Field(
        default=0.1,
        ge=0,
        le=1,
        description="Worth of a further closure between the same stretches [votes]; little in it is new.",
    )
    min_votes: int = Field(
        default=2,
        ge=1,
        description="Independent closures [votes] that must agree before any is believed; 1 believes a single one.",
    )
    max_odometry_scale: float = Field(
        default=4.0,
        ge=1,
        description="Largest factor [1] by which odometry may be worse than its model; beyond, the model is wrong.",
    )
    n_hypotheses: int = Field(
        default=3,
        ge=1,
        description="Sets [1] made at each scale of the odometry; the largest need not be the true one",
    )
    max_closures: int = Field(
        default=200,
        ge=2,
        description="Closures [1] compared with one another; more are thinned, and the rest judged by those.",
    )
    max_steps: int = Field(
        default=20_000, ge=0, description="Vertices [1] that a clique search may look at; exact up to some 50 closures."
    )


@dataclass(frozen=True)
class ConsistentSet:
    """The closures that are believed.

    Parameters
    ----------
    is_member : ndarray of bool, shape (C,)
        Which they are.
    odometry_scale : float
        How much worse than modelled dead reckoning is, by their account.
    """

    is_member: BoolArray
    odometry_scale: float


def consistent_closures(closures: Innovations, config: ConsistencyConfig | None = None) -> ConsistentSet:
    """Find the closures that agree with one another.

    Parameters
    ----------
    closures : Innovations
        All closures, as `innovations` compares them with dead reckoning.
    config : ConsistencyConfig
        Which sets are believed.

    Returns
    -------
    consistent : ConsistentSet
        The set, empty when fewer than ``min_votes`` independent closures agree.
    """
    config, is_member = config or ConsistencyConfig(), np.zeros(len(closures), dtype=bool)
    order = np.lexsort((closures.last, closures.first))  # so that the order in which they came does not matter
    ordered, thinned = closures[order], _thin(len(closures), config.max_closures)
    best = _best_hypothesis(ordered[thinned], config)
    if best is None:
        return ConsistentSet(is_member, 1.0)
    members, scale = best
    left_out = np.setdiff1d(np.arange(len(closures)), thinned)
    is_member[order] = _with_agreeing(ordered, thinned[members], left_out, scale)
    return ConsistentSet(is_member, scale)


def group_closures(first: IntArray, last: IntArray, stretch: int) -> IntArray:
    """Group closures between the same two stretches of the track.

    Parameters
    ----------
    first, last : ndarray of int, shape (C,)
        The anchors that each closure joins.
    stretch : int
        A closure joins the group whose founder is fewer anchors away at both ends.

    Returns
    -------
    group : ndarray of int, shape (C,)
        Number of each closure's group.
    """
    group = np.full(len(first), -1, dtype=np.int64)
    n_groups = 0
    for closure in np.lexsort((last, first)):
        if group[closure] < 0:
            is_near = (np.abs(first - first[closure]) < stretch) & (np.abs(last - last[closure]) < stretch)
            group[is_near & (group < 0)] = n_groups
            n_groups += 1
    return group


def count_votes(members: Innovations, config: ConsistencyConfig) -> int:
    """Count the independent closures of a set.

    Parameters
    ----------
    members : Innovations
        The set.
    config : ConsistencyConfig
        Which closures share a vote.

    Returns
    -------
    n_votes : int
        Number of groups.
    """
    return len(np.unique(group_closures(members.first, members.last, config.stretch)))


def _best_hypothesis(closures: Innovations, config: ConsistencyConfig) -> tuple[IntArray, float] | None:
    """The set and the scale of odometry that explain each other best."""
    hypotheses = list(_hypotheses(closures, config))
    if not hypotheses:
        return None
    evidence = [_vote_evidence(closures[members], scale, config) for members, scale in hypotheses]
    if max(evidence) < 0.0:  # false closures explain it better
        return None
    return _polished(closures, *hypotheses[int(np.argmax(evidence))], config)


def _polished(
    closures: Innovations, members: IntArray, scale: float, config: ConsistencyConfig
) -> tuple[IntArray, float]:
    """Fit the scale to the set and the set to the scale, in turns, while that explains more."""
    evidence = _vote_evidence(closures[members], scale, config)
    while True:
        scales = _scales(config)
        better_scale = scales[int(np.argmax([_vote_evidence(closures[members], one, config) for one in scales]))]
        better = _refined(closures, members, better_scale, config)
        if count_votes(closures[better], config) < config.min_votes:
            break
        gained = _vote_evidence(closures[better], better_scale, config)
        if gained <= evidence + 1e-9:
            break
        members, scale, evidence = better, better_scale, gained
    return members, scale


def _hypotheses(closures: Innovations, config: ConsistencyConfig) -> Iterator[tuple[IntArray, float]]:
    """Sets that agree, with the scale of odometry at which they do: at each scale the largest, then what it leaves."""
    group = group_closures(closures.first, closures.last, config.stretch)
    for scale in _scales(config):
        is_consistent = closures.pair_distances(scale) < chi2.ppf(config.pair_probability, _DIMENSIONS)
        left = np.arange(len(closures))
        for _ in range(config.n_hypotheses):
            if not left.size:
                break
            search = CliqueSearch(is_consistent[np.ix_(left, left)], group[left], config.repeat_vote, config.max_steps)
            clique = left[search.run()]
            members = _refined(closures, clique, scale, config)
            if count_votes(closures[members], config) >= config.min_votes:
                yield members, scale
            left = np.setdiff1d(left, clique)


def _scales(config: ConsistencyConfig) -> list[float]:
    """Factors by which odometry may be worse than its model, from one."""
    n_steps = int(np.floor(np.log(config.max_odometry_scale) / np.log(_SCALE_STEP) + 1e-9))
    return [float(_SCALE_STEP**step) for step in range(n_steps + 1)]


def _vote_evidence(members: Innovations, scale: float, config: ConsistencyConfig) -> float:
    """Evidence of a set in which each group has one vote, that of its first member."""
    founders = np.unique(group_closures(members.first, members.last, config.stretch), return_index=True)[1]
    return log_evidence(members[np.sort(founders)], scale)


def _refined(closures: Innovations, clique: IntArray, scale: float, config: ConsistencyConfig) -> IntArray:
    """A set whose members all gain by being together, and to which no other closure would add."""
    group = group_closures(closures.first, closures.last, config.stretch)
    members = clique[without_losers(closures[clique], group[clique], scale)]
    for _ in range(_MAX_ROUNDS):
        if not members.size:
            break
        others = np.setdiff1d(np.arange(len(closures)), members)
        more = np.flatnonzero(_with_agreeing(closures, members, others, scale))
        kept = more[without_losers(closures[more], group[more], scale)]
        if np.array_equal(kept, members):
            break
        members = kept
    return members


def _with_agreeing(closures: Innovations, members: IntArray, others: IntArray, scale: float) -> BoolArray:
    """The members, and those of the others that lie where the members say they must."""
    is_member = np.isin(np.arange(len(closures)), members)
    if others.size:
        is_member[others] = gains_beside(closures[others], closures[members], scale) > 0.0
    return is_member


def _thin(n_closures: int, max_closures: int) -> IntArray:
    """At most so many of the closures, evenly chosen."""
    if n_closures <= max_closures:
        return np.arange(n_closures)
    return np.linspace(0, n_closures - 1, max_closures).astype(np.int64)
