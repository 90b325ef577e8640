"""Hypotheses: sets of loop closures that explain each other, at several scales of the odometry's uncertainty."""

from collections.abc import Iterator

import numpy as np
from scipy.special import chdtri

from backend.arrays import FloatArray, IntArray
from backend.cliques import CliqueSearch
from backend.credibility import is_credible
from backend.evidence import least_gains, log_evidence, surpluses, without_losers
from backend.growth import grown_sets
from backend.innovations import Innovations
from backend.votes import ConsistencyConfig, count_votes, founders, group_closures, scales_of, stretch_of

_DIMENSIONS = 3  # yaw, x, y
_N_GROWN = 3  # sets at each scale that may be the best of all
_MAX_ROUNDS = 5  # of adding to a set and dropping from it; most settle in two


def best_hypothesis(closures: Innovations, config: ConsistencyConfig) -> tuple[IntArray, float]:
    """Find the set and the scale of odometry that explain each other best.

    Parameters
    ----------
    closures : Innovations
        All closures, C of them.
    config : ConsistencyConfig
        Which sets are believed.

    Returns
    -------
    members : ndarray of int, shape (M,)
        The set; empty where false closures explain everything better or no set is credible.
    scale : float
        How much worse than modelled dead reckoning is, by its account.
    """
    hypotheses = list(_hypotheses(closures, config))
    evidence = np.array([_vote_evidence(closures[members], scale, config) for members, scale in hypotheses])
    for best in np.argsort(-evidence, kind="stable"):
        if evidence[best] < 0.0:
            break
        members, scale = _polished(closures, *hypotheses[int(best)], config)
        if is_credible(closures, members, scale, config):
            return members, scale
    return np.zeros(0, dtype=np.int64), 1.0


def refined(closures: Innovations, start: IntArray, scale: float, config: ConsistencyConfig) -> IntArray:
    """Drop from a set what does not gain by being in it and add what would, in turns.

    Parameters
    ----------
    closures : Innovations
        All closures, C of them.
    start : ndarray of int, shape (K,)
        The set to begin with.
    scale : float
        Dead reckoning is this much worse than said.
    config : ConsistencyConfig
        Which sets are believed.

    Returns
    -------
    members : ndarray of int, shape (M,)
        The set after that; empty where nothing in it holds.
    """
    group, members = group_closures(closures.first, closures.last, stretch_of(config)), start
    members = start[without_losers(closures[start], group[start], scale)]
    for _ in range(_MAX_ROUNDS):
        if not members.size:
            break
        more, least = with_agreeing(closures, members, scale, config.false_cost)
        kept = more[without_losers(closures[more], group[more], scale, least)]
        if np.array_equal(kept, members):
            break
        members = kept
    return members


def with_agreeing(
    closures: Innovations, members: IntArray, scale: float, false_cost: float
) -> tuple[IntArray, FloatArray]:
    """Add to a set what lies where its members say it must.

    Parameters
    ----------
    closures : Innovations
        All closures, C of them.
    members : ndarray of int, shape (K,)
        The set, at least one.
    scale : float
        Dead reckoning is this much worse than said.
    false_cost : float
        How much worse a false closure is than a missing one [1].

    Returns
    -------
    more : ndarray of int, shape (M,)
        The larger set, ascending.
    least : ndarray, shape (M,)
        Evidence that is enough for each of it.
    """
    others, log_density = np.setdiff1d(np.arange(len(closures)), members), -np.inf
    if others.size:
        surplus, log_density = surpluses(closures[others], closures[members], scale, false_cost)
        others = others[surplus > 0.0]
    more = np.sort(np.concatenate([members, others]))
    return more, least_gains(closures[more], scale, log_density, false_cost / (len(members) + 1.0))


def fitted_scale(members: Innovations, config: ConsistencyConfig) -> float:
    """How much worse than modelled dead reckoning is by the account of a set.

    Parameters
    ----------
    members : Innovations
        The set.
    config : ConsistencyConfig
        The largest factor that is looked at.

    Returns
    -------
    scale : float
        The factor that explains the set best.
    """
    scales = scales_of(config)
    return scales[int(np.argmax([_vote_evidence(members, scale, config) for scale in scales]))]


def _polished(
    closures: Innovations, members: IntArray, scale: float, config: ConsistencyConfig
) -> tuple[IntArray, float]:
    """Fit the scale to the set and the set to the scale, in turns, while that explains more."""
    evidence = _vote_evidence(closures[members], scale, config)
    while True:
        better_scale = fitted_scale(closures[members], config)
        better = refined(closures, members, better_scale, config)
        if count_votes(closures[better], config) < config.min_votes:
            break
        gained = _vote_evidence(closures[better], better_scale, config)
        if gained <= evidence + 1e-9:
            break
        members, scale, evidence = better, better_scale, gained
    return members, scale


def _hypotheses(closures: Innovations, config: ConsistencyConfig) -> Iterator[tuple[IntArray, float]]:
    """Sets that agree, each with the scale of odometry at which it does, from the starts that explain most."""
    starts = [
        (_vote_evidence(closures[start], scale, config), scale, start) for start, scale in _starts(closures, config)
    ]
    starts.sort(key=lambda one: -one[0])
    for _, scale, start in starts[: config.n_hypotheses]:
        members = refined(closures, start, scale, config)
        if count_votes(closures[members], config) >= config.min_votes:
            yield members, scale


def _starts(closures: Innovations, config: ConsistencyConfig) -> Iterator[tuple[IntArray, float]]:
    """Sets to begin with: grown ones, and what holds of the largest clique."""
    group = group_closures(closures.first, closures.last, stretch_of(config))
    for scale in scales_of(config):
        clique = _largest_clique(closures, group, scale, config)
        first = clique[np.sort(np.unique(group[clique], return_index=True)[1])]
        kept = first[without_losers(closures[first], group[first], scale)]
        if kept.size:
            yield kept, scale
        for _, members in sorted(grown_sets(closures, group, scale), key=lambda grown: -grown[0])[:_N_GROWN]:
            yield members, scale


def _largest_clique(closures: Innovations, group: IntArray, scale: float, config: ConsistencyConfig) -> IntArray:
    """The largest set in which every two agree."""
    if not len(closures):
        return np.zeros(0, dtype=np.int64)
    is_consistent = closures.pair_distances(scale) < chdtri(_DIMENSIONS, 1.0 - config.pair_probability)
    return np.flatnonzero(CliqueSearch(is_consistent, group, config.repeat_vote, config.max_steps).run())


def _vote_evidence(members: Innovations, scale: float, config: ConsistencyConfig) -> float:
    """Evidence of a set in which each group has one vote, that of its first member."""
    return log_evidence(members[founders(members, config)], scale)
