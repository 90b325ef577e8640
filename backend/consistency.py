"""Consistency: which loop closures agree with one another, and how far dead reckoning must be stretched for it.

Pairwise consistency maximisation (Mangelson et al., ICRA 2018, :doi:`10.1109/ICRA.2018.8460217`): two closures agree
when their difference lies within their own noise and that of the dead reckoning which only one of their loops contains.
The largest set in which all agree is a hypothesis. Closures between the same two stretches of the track share one vote,
for they share their errors.

How bad dead reckoning was is not known beforehand. A drift three times worse than modelled makes true closures of
distant loops disagree; a model three times too wide lets false ones in. So each hypothesis is made at several scales of
the odometry's standard deviations, and the one that explains its closures best is taken: the likelihood of its
residuals, drift and all, against that of as many false closures spread evenly over the gate.

A track that passes one place once has one closure and none to agree with. It is believed where two things make up for
that: the front end says that no false one as good is to be expected in the whole dive, and dead reckoning is so tight
that a repeated structure would have to lie close by.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from backend.arrays import BoolArray, IntArray
from backend.credibility import is_credible
from backend.evidence import without_losers
from backend.hypotheses import best_hypothesis, fitted_scale, with_agreeing
from backend.innovations import Innovations
from backend.votes import ConsistencyConfig, count_votes, group_closures, stretch_of, suit_overlap

__all__ = [
    "ConsistencyConfig",
    "ConsistentSet",
    "consistent_closures",
    "count_votes",
    "credible_set",
    "group_closures",
    "is_enough",
    "reconsidered",
    "suit_overlap",
]

_DIMENSIONS = 3  # yaw, x, y


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
        The set, empty when fewer than ``min_votes`` independent closures agree and none is believed alone.
    """
    config, is_member = config or ConsistencyConfig(), np.zeros(len(closures), dtype=bool)
    order = np.lexsort((closures.last, closures.first))  # so that the order in which they came does not matter
    ordered, thinned = closures[order], _thin(len(closures), config.max_closures)
    members, scale = best_hypothesis(ordered[thinned], config)
    if not members.size:
        is_member[order] = _lone(ordered, config)
        return ConsistentSet(is_member, 1.0)
    found = thinned[members]
    if len(thinned) < len(closures):
        found, _ = with_agreeing(ordered, found, scale, config.false_cost)
    is_member[order[found]] = True
    return ConsistentSet(is_member, scale)


def credible_set(closures: Innovations, members: IntArray, scale: float, config: ConsistencyConfig) -> ConsistentSet:
    """Believe a set, however it was chosen, only where false closures would not agree as well.

    Parameters
    ----------
    closures : Innovations
        All closures, C of them.
    members : ndarray of int, shape (K,)
        The set.
    scale : float
        Dead reckoning is taken for this much worse than said.
    config : ConsistencyConfig
        Which sets are believed.

    Returns
    -------
    consistent : ConsistentSet
        The set at that scale; else those that are believed alone, if any.
    """
    is_member, order = np.zeros(len(closures), dtype=bool), np.lexsort((closures.last, closures.first))
    thinned = order[_thin(len(closures), config.max_closures)]
    among, few = np.flatnonzero(np.isin(thinned, members)), closures[thinned]
    # judged at the scale that explains the set best: whoever chose it may have drawn another, or asked for none
    is_agreed = count_votes(few[among], config) >= config.min_votes
    if is_agreed and is_credible(few, among, fitted_scale(few[among], config), config):
        is_member[members] = True
        return ConsistentSet(is_member, scale)
    is_member[order] = _lone(closures[order], config)
    return ConsistentSet(is_member, 1.0)


def is_enough(members: Innovations, config: ConsistencyConfig) -> bool:
    """Whether a set has what it takes to be believed.

    Parameters
    ----------
    members : Innovations
        The set.
    config : ConsistencyConfig
        How many must agree, and which is believed alone.

    Returns
    -------
    is_enough : bool
        Enough independent closures, or one that is sure.
    """
    return count_votes(members, config) >= config.min_votes or bool(_is_sure(members, config).any())


def reconsidered(closures: Innovations, consistent: ConsistentSet, config: ConsistencyConfig) -> ConsistentSet:
    """Judge all closures once more, about poses that the set has brought nearer to the truth.

    Parameters
    ----------
    closures : Innovations
        All closures, compared about the solution that the set gives.
    consistent : ConsistentSet
        The set.
    config : ConsistencyConfig
        Which sets are believed.

    Returns
    -------
    consistent : ConsistentSet
        The set with what now agrees with it, without what no longer does; as it was where that leaves too little.
    """
    members = np.flatnonzero(consistent.is_member)
    if count_votes(closures[members], config) < config.min_votes:
        return consistent  # one place alone cannot tell how bad dead reckoning is
    thinned = members[_thin(len(members), config.max_closures)]
    scale = fitted_scale(closures[thinned], config)
    better = _judged_by(closures, thinned, scale, config)
    return ConsistentSet(better, scale) if is_enough(closures[better], config) else consistent


def _judged_by(closures: Innovations, members: IntArray, scale: float, config: ConsistencyConfig) -> BoolArray:
    """What is left of some members when they judge each other, and of all others when those judge them."""
    group = group_closures(closures.first, closures.last, stretch_of(config))
    more, least = with_agreeing(closures, members, scale, config.false_cost)
    least = least[np.isin(more, members)]
    kept = members[without_losers(closures[members], group[members], scale, least)]
    if kept.size:
        kept, _ = with_agreeing(closures, kept, scale, config.false_cost)
    return np.isin(np.arange(len(closures)), kept)


def _lone(closures: Innovations, config: ConsistencyConfig) -> BoolArray:
    """Those at one place that are believed alone, unless another as sure speaks against them."""
    is_near = closures.squared_distances < chdtri(_DIMENSIONS, 1.0 - config.pair_probability)
    sure = np.flatnonzero(_is_sure(closures, config) & is_near)
    is_member = np.zeros(len(closures), dtype=bool)
    if len(without_losers(closures[sure], np.arange(len(sure)), 1.0)) < len(sure) or not sure.size:
        return is_member
    is_member[with_agreeing(closures, sure, 1.0, config.false_cost)[0]] = True
    return is_member


def _is_sure(closures: Innovations, config: ConsistencyConfig) -> BoolArray:
    """Which are believed alone: hardly to be had by chance, and where dead reckoning leaves little room."""
    return (closures.chance <= config.max_lone_chance) & (closures.reach <= config.max_lone_reach)


def _thin(n_closures: int, max_closures: int) -> IntArray:
    """At most so many of the closures, evenly chosen."""
    if n_closures <= max_closures:
        return np.arange(n_closures)
    return np.linspace(0, n_closures - 1, max_closures).astype(np.int64)
