"""Evidence: how much better true loop closures than false ones explain what a set of closures says.

True closures and the dead reckoning they share are jointly Gaussian; false ones fall evenly into the gate in which dead
reckoning lets them be looked for. All figures are logarithms of likelihood ratios, so zero is undecided.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from backend.arrays import FloatArray, IntArray
from backend.innovations import Innovations
from backend.triangular import factorise, inverse, without_rows

_DIMENSIONS = 3  # yaw, x, y
GATE = float(chdtri(_DIMENSIONS, 1e-4))  # squared radius of the gate: hardly a true closure lies outside
GATE_AXIS = float(np.sqrt(GATE / 5.0))  # standard deviation along an axis of what lies evenly in a ball of that radius
_LARGEST = 50.0  # log of a ratio that is as good as endless
_SHARE_AT_ONCE = 8  # of the losers, one in so many goes at a time: the worst drag others down
_LOG_NORMAL = -0.5 * _DIMENSIONS * np.log(2.0 * np.pi)


def log_evidence(members: Innovations, scale: float) -> float:
    """Evidence of a set as a whole.

    Parameters
    ----------
    members : Innovations
        The set, of K closures.
    scale : float
        Dead reckoning is this much worse than said.

    Returns
    -------
    log_evidence : float
        Log ratio of the likelihoods, with the prior of the scale.
    """
    log_true = log_joint(members.residuals, members.joint_covariance(scale))
    return log_true - float(log_gate(members, 1.0).sum()) + log_scale_prior(scale)


def log_joint(residuals: FloatArray, covariance: FloatArray) -> float:
    """Log density of all residuals together about zero.

    Parameters
    ----------
    residuals : ndarray, shape (K, 3)
        Yaw, x, y [rad, m, m].
    covariance : ndarray, shape (3 K, 3 K)
        Of all.

    Returns
    -------
    log_density : float
        Its logarithm.
    """
    factor, whitened = factorise(covariance, residuals.reshape(1, -1))
    return float(len(residuals) * _LOG_NORMAL - 0.5 * (whitened**2).sum() - np.log(np.diag(factor)).sum())


def log_scale_prior(scale: float) -> float:
    """Log of how likely a scale of the odometry is beside one: log-normal, a factor of two to either side.

    Parameters
    ----------
    scale : float
        Dead reckoning is this much worse than said.

    Returns
    -------
    log_prior : float
        Zero for one, negative else.
    """
    return float(-0.5 * (np.log(scale) / np.log(2.0)) ** 2)


def log_gate(closures: Innovations, scale: float) -> FloatArray:
    """Density of closures spread evenly over the gate of dead reckoning.

    Parameters
    ----------
    closures : Innovations
        The closures, C of them.
    scale : float
        Dead reckoning is this much worse than said.

    Returns
    -------
    log_density : ndarray, shape (C,)
        Its logarithm [1/(rad m**2)].
    """
    log_volume = np.log(4.0 / 3.0 * np.pi) + 0.5 * _DIMENSIONS * np.log(GATE)
    return np.asarray(-log_volume - 0.5 * np.linalg.slogdet(scale**2 * closures.own_drift + closures.noise)[1])


def log_normal(residuals: FloatArray, covariances: FloatArray) -> FloatArray:
    """Log density of residuals about zero.

    Parameters
    ----------
    residuals : ndarray, shape (K, 3)
        Yaw, x, y [rad, m, m].
    covariances : ndarray, shape (K, 3, 3)
        Of each.

    Returns
    -------
    log_density : ndarray, shape (K,)
        Of each by itself [1/(rad m**2)].
    """
    distance = np.einsum("ai,ai->a", residuals, np.linalg.solve(covariances, residuals[..., None])[..., 0])
    return np.asarray(_LOG_NORMAL - 0.5 * (distance + np.linalg.slogdet(covariances)[1]))


def surprises(judged: Innovations, believed: Innovations, scale: float) -> tuple[FloatArray, FloatArray]:
    """How far closures lie from where a set says that they must.

    Parameters
    ----------
    judged : Innovations
        The closures in question, D of them.
    believed : Innovations
        The set.
    scale : float
        Dead reckoning is this much worse than said.

    Returns
    -------
    surprise : ndarray, shape (D, 3)
        Yaw, x, y [rad, m, m].
    covariance : ndarray, shape (D, 3, 3)
        Of the surprise, were the closure true.
    """
    shared = scale**2 * judged.shared_drift(believed).transpose(0, 2, 1, 3).reshape(3 * len(judged), -1)
    told = believed.residuals.reshape(1, -1)
    _, whitened = factorise(believed.joint_covariance(scale), np.concatenate([shared, told]))
    told, shared = whitened[-1], whitened[:-1].reshape(len(judged), 3, -1)
    drift = judged.own_drift
    explained = np.einsum("aik,ajk->aij", shared, shared)
    return judged.residuals - np.einsum("aik,k->ai", shared, told), judged.noise + scale**2 * drift - explained


def surpluses(judged: Innovations, believed: Innovations, scale: float, cost: float) -> tuple[FloatArray, float]:
    """Evidence beyond what outweighs how dense false closures lie, and how costly they are.

    Parameters
    ----------
    judged : Innovations
        The closures that are no members, D of them, at least one; they tell how false ones scatter.
    believed : Innovations
        The set, of K closures, at least one.
    scale : float
        Dead reckoning is this much worse than said.
    cost : float
        How much worse a false closure is than a missing one [1].

    Returns
    -------
    surpluses : ndarray, shape (D,)
        Positive where a closure should join.
    log_density : float
        Of those judged, as false ones [1/(rad m**2)].

    Notes
    -----
    False closures are a mixture: one spread evenly over the gate, and those judged that gain nothing, spread evenly
    over the ellipsoid that has their second moments.
    """
    surprise, covariance = surprises(judged, believed, scale)
    gains = log_normal(surprise, covariance) - log_gate(judged, scale)
    is_false = gains <= 0.0  # whatever the density: the others may all be true
    log_density = _log_scatter(surprise[is_false], judged.noise[is_false])
    return gains - least_gains(judged, scale, log_density, cost / (len(believed) + 1.0)), log_density


def _log_scatter(surprise: FloatArray, noise: FloatArray) -> float:
    """Logarithm of how dense closures lie that are spread evenly over the ellipsoid with their second moments."""
    if not len(surprise):
        return -np.inf
    moments = (surprise.T @ surprise + noise.sum(axis=0)) / len(surprise)
    log_volume = np.log(4.0 / 3.0 * np.pi) + 0.5 * _DIMENSIONS * np.log(5.0) + 0.5 * np.linalg.slogdet(moments)[1]
    return float(np.log(len(surprise)) - log_volume)


def least_gains(closures: Innovations, scale: float, log_density: float, odds: float) -> FloatArray:
    """Evidence that outweighs false closures of some density.

    Parameters
    ----------
    closures : Innovations
        The closures in question, D of them.
    scale : float
        Dead reckoning is this much worse than said.
    log_density : float
        Logarithm of the density of false closures [1/(rad m**2)], besides one that is spread over the gate.
    odds : float
        Weight of a false closure against a true one [1].

    Returns
    -------
    least : ndarray, shape (D,)
        What each must gain; never negative.
    """
    ratio = np.minimum(log_density - log_gate(closures, scale), _LARGEST)
    return np.maximum(np.log(odds) + np.log1p(np.exp(ratio)), 0.0)


def without_losers(closures: Innovations, group: IntArray, scale: float, least: ArrayLike = 0.0) -> IntArray:
    """Drop what all others explain worst, again and again, until each closure and each group adds evidence.

    Parameters
    ----------
    closures : Innovations
        A set of K closures: pairs may agree where all together do not.
    group : ndarray of int, shape (K,)
        Closures of one group may share one wrong offset; then only the others can tell.
    scale : float
        Dead reckoning is this much worse than said.
    least : array_like, shape (K,)
        Evidence that is enough.

    Returns
    -------
    kept : ndarray of int, shape (<= K,)
        Positions of those that stay.
    """
    kept, enough = np.arange(len(closures)), log_gate(closures, scale) + np.asarray(least)
    information = inverse(closures.joint_covariance(scale))
    while kept.size:
        losers = _losers(information, closures.residuals[kept], enough[kept], group[kept])
        if not losers.size:
            break
        kept, information = np.delete(kept, losers), _without(information, losers)
    return kept


def _losers(information: FloatArray, residuals: FloatArray, least: FloatArray, group: IntArray) -> IntArray:
    """The closures, or else the group, that lose most evidence by being in the set; empty if none does."""
    each = np.arange(len(group))
    gain = _gains_within(information, residuals, each) - least
    worst = np.argsort(gain, kind="stable")[: 1 + int((gain < 0.0).sum()) // _SHARE_AT_ONCE]
    if gain[worst[0]] < 0.0:
        return np.sort(worst)
    member = np.unique(group, return_inverse=True)[1]
    gain = _gains_within(information, residuals, member) - np.bincount(member, least) / np.bincount(member)
    return np.flatnonzero(member == np.argmin(gain)) if gain.min() < 0.0 else np.zeros(0, dtype=np.int64)


def _gains_within(information: FloatArray, residuals: FloatArray, group: IntArray) -> FloatArray:
    """Log density of an offset that the closures of each group share, given all other closures."""
    n, n_groups = len(residuals), int(group.max()) + 1
    own, pull = np.zeros((n_groups, 3, 3)), np.zeros((n_groups, 3))
    first, second = np.nonzero(group[:, None] == group)
    np.add.at(own, group[first], information.reshape(n, 3, n, 3)[first, :, second])
    np.add.at(pull, group, np.einsum("ij,j->i", information, residuals.ravel()).reshape(n, 3))
    distance = np.einsum("ai,ai->a", pull, np.linalg.solve(own, pull[..., None])[..., 0])
    return np.asarray(_LOG_NORMAL - 0.5 * (distance - np.linalg.slogdet(own)[1]))


def _without(information: FloatArray, closures: IntArray) -> FloatArray:
    """Information of a set of which some closures are not observed."""
    rows = (3 * closures[:, None] + np.arange(3)).ravel()
    others = np.delete(np.arange(len(information)), rows)
    _, whitened = factorise(information[np.ix_(rows, rows)], information[np.ix_(others, rows)])
    return without_rows(information[np.ix_(others, others)], whitened)
