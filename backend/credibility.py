"""Credibility: could the closures of a set agree although they are false?

They could by chance: of thirty closures that are wrong each in its own way some two or three agree nearly always. And
they could because one thing deceives them all: a pattern of the floor that repeats itself, or what the sonar itself
leaves at the same place of its frame on every line, by which windows seem to lie ahead of where they do. Such closures
drift as true ones do, and are wrong by one offset besides.
"""

import numpy as np
from scipy.special import gammaln

from backend.arrays import FloatArray, IntArray
from backend.evidence import GATE, GATE_AXIS, log_gate, log_joint, log_normal, log_scale_prior
from backend.innovations import Innovations
from backend.triangular import factorise
from backend.votes import ConsistencyConfig, founders

_ALIAS_SCALES = (1.0, np.sqrt(2.0), 2.0)  # of the odometry, where an offset explains the rest


def is_credible(closures: Innovations, members: IntArray, scale: float, config: ConsistencyConfig) -> bool:
    """Whether a set agrees better than false closures would.

    Parameters
    ----------
    closures : Innovations
        All closures, C of them.
    members : ndarray of int, shape (K,)
        The set, at least one.
    scale : float
        Dead reckoning is this much worse than said, by its account.
    config : ConsistencyConfig
        What is credible.

    Returns
    -------
    is_credible : bool
        Neither chance nor one offset that all share explains the set as well.
    """
    votes = members[founders(closures[members], config)]
    each = founders(closures, config)
    if log_set_chance(closures[votes], scale, len(each)) > np.log(config.max_set_chance):
        return False
    return (
        log_alias_ratio(closures[votes], closures[np.setdiff1d(each, members)], scale) + np.log(config.alias_odds) < 0
    )


def log_set_chance(votes: Innovations, scale: float, n_votes: int) -> float:
    """How many sets of independent false closures may be expected that agree as well.

    Parameters
    ----------
    votes : Innovations
        The set, one closure a group, V of them.
    scale : float
        Dead reckoning is this much worse than said.
    n_votes : int
        Groups of all closures, of which these were chosen.

    Returns
    -------
    log_chance : float
        Logarithm of the number.

    Notes
    -----
    So many ways there are to choose V of all, times the share of the places of V false closures at which they agree no
    worse. They fall evenly into the gate of dead reckoning; where one of the set lies beyond it nothing kept them from
    falling as far. They agree no worse inside an ellipsoid about zero.
    """
    n_chosen, dimensions = len(votes), 3 * len(votes)
    factor, whitened = factorise(votes.joint_covariance(scale), votes.residuals.reshape(1, -1))
    log_ball = 0.5 * dimensions * np.log(np.pi * (whitened**2).sum()) - gammaln(0.5 * dimensions + 1.0)
    log_ellipsoid = log_ball + np.log(np.diag(factor)).sum()
    beyond = np.maximum(votes.squared_distances / GATE, 1.0)
    log_density = log_gate(votes, 1.0) - 1.5 * np.log(beyond)
    log_ways = gammaln(n_votes + 1) - gammaln(n_chosen + 1) - gammaln(n_votes - n_chosen + 1)
    return float(log_ways + log_ellipsoid + log_density.sum())


def log_alias_ratio(votes: Innovations, others: Innovations, scale: float) -> float:
    """How much better closures explain themselves that are all wrong by one offset than closures that are true.

    Parameters
    ----------
    votes : Innovations
        The set, one closure a group, V of them.
    others : Innovations
        Those outside the set, one closure a group; either side explains some of them too, and the rest are false.
    scale : float
        Dead reckoning is this much worse than said, if the set is true; if not, at most twice: an offset and a drift
        far beyond its model would be too much.

    Returns
    -------
    log_ratio : float
        Logarithm of the ratio of the likelihoods, of the better of two kinds of offset: one in the world, or one ahead
        of wherever the vehicle heads. Either lies anywhere in the gate.
    """
    every, n = votes.joined(others), len(votes)
    size = GATE_AXIS * float(np.median(votes.reach))
    somewhere, ahead = np.zeros((len(every), 3, 2)), np.zeros((len(every), 3, 1))
    somewhere[:, 1:] = np.eye(2)
    ahead[:, 1:, 0] = every.ahead
    true = _log_explained(every, n, 0.0 * ahead, scale)
    aliases = [
        _log_explained(every, n, size * offset, worse) for offset in (somewhere, ahead) for worse in _ALIAS_SCALES
    ]
    return max(aliases) - true


def _log_explained(every: Innovations, n: int, offset: FloatArray, scale: float) -> float:
    """Log density of the first n and what others gain by them, with offsets of unit variance that move residuals so."""
    alias = offset.reshape(3 * len(every), -1)
    covariance, residuals = every.joint_covariance(scale) + alias @ alias.T, every.residuals
    own, shared = covariance[: 3 * n, : 3 * n], covariance[3 * n :, : 3 * n]
    explained = log_joint(residuals[:n], own) + log_scale_prior(scale)
    if len(every) == n:
        return explained
    _, whitened = factorise(own, np.concatenate([shared, residuals[:n].reshape(1, -1)]))
    told = (whitened[:-1] @ whitened[-1]).reshape(-1, 3)
    left = whitened[:-1].reshape(len(told), 3, -1)
    blocks = covariance[3 * n :, 3 * n :].reshape(len(told), 3, len(told), 3)
    each = np.arange(len(told))
    rest = blocks[each, :, each] - left @ left.transpose(0, 2, 1)
    gains = log_normal(residuals[n:] - told, rest) - log_gate(every[np.arange(n, len(every))], 1.0)
    return explained + float(np.maximum(gains, 0.0).sum())
