"""Beliefs: the ways to choose the loop closures that may hold a graph, behind one signature."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from backend.arrays import FloatArray, IntArray
from backend.consistency import ConsistencyConfig, ConsistentSet, consistent_closures, reconsidered
from backend.gauss_newton import minimum, rough_minimum
from backend.problem import Belief, Problem

_SETTLED = 0.01  # share of a set that may still change: the graph has the last word
_MAX_ROUNDS = 4  # of solving and judging again; most dives settle in one


@dataclass(frozen=True)
class Offer:
    """What a way to choose is given.

    Parameters
    ----------
    problem : Problem
        The graph.
    closures : ndarray of int, shape (K,)
        Positions of the closures that may be chosen, ascending.
    consistency : ConsistencyConfig
        Which sets are believed.
    rng : numpy.random.Generator
        Source of whatever is drawn.
    """

    problem: Problem
    closures: IntArray
    consistency: ConsistencyConfig
    rng: np.random.Generator


class Chooser(Protocol):
    """A way to choose closures."""

    def __call__(self, offer: Offer) -> Belief:
        """Choose among what is offered."""
        ...


def believe_consistent(offer: Offer) -> Belief:
    """Believe the largest set of closures that agree, judged again about the solution that it gives.

    Parameters
    ----------
    offer : Offer
        The graph and the closures to choose from.

    Returns
    -------
    belief : Belief
        The closures that agree.
    """
    problem = offer.problem
    T = start_poses(problem)
    compared = problem.compared(T, offer.closures)
    consistent = consistent_closures(compared, offer.consistency)
    for _ in range(_MAX_ROUNDS):
        if not consistent.is_member.any():
            break
        T = _solved(offer, consistent, T)
        again = reconsidered(problem.compared(T, offer.closures), consistent, offer.consistency)
        n_changed = int((again.is_member != consistent.is_member).sum())
        consistent = again
        if n_changed <= _SETTLED * again.is_member.sum():
            break
    return Belief(offer.closures[consistent.is_member], consistent.odometry_scale, T)


def believed_set(offer: Offer, consistent: ConsistentSet, T_start: FloatArray) -> Belief:
    """Believe a set, with poses near the solution that it gives.

    Parameters
    ----------
    offer : Offer
        The graph and the closures to choose from.
    consistent : ConsistentSet
        Which of them are believed.
    T_start : ndarray, shape (S, 4, 4)
        Poses without any closure.

    Returns
    -------
    belief : Belief
        The set; with these very poses where it is empty.
    """
    T = _solved(offer, consistent, T_start) if consistent.is_member.any() else T_start
    return Belief(offer.closures[consistent.is_member], consistent.odometry_scale, T)


def start_poses(problem: Problem) -> FloatArray:
    """Poses without any closure.

    Parameters
    ----------
    problem : Problem
        The graph.

    Returns
    -------
    T_world_anchor : ndarray, shape (S, 4, 4)
        Dead reckoning, drawn to the fixes where there are any.
    """
    if not problem.fixes:
        return problem.T_world_anchor_dr
    none = np.zeros(0, dtype=np.int64)
    return minimum(problem.least_squares(1.0, none), problem.T_world_anchor_dr)


def _solved(offer: Offer, consistent: ConsistentSet, T: FloatArray) -> FloatArray:
    """Least squares over the odometry and the closures that agree."""
    members = offer.closures[consistent.is_member]
    return rough_minimum(offer.problem.least_squares(consistent.odometry_scale, members), T)
