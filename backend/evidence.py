"""Evidence: how much better true loop closures than false ones explain what a set of closures says.

True closures and the dead reckoning they share are jointly Gaussian; false ones fall evenly into the gate in which dead
reckoning lets them be looked for. All figures are logarithms of likelihood ratios, so zero is undecided.
"""

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import chi2

from backend.arrays import FloatArray, IntArray
from backend.innovations import Innovations

_DIMENSIONS = 3  # yaw, x, y
_GATE = float(chi2.ppf(0.9999, _DIMENSIONS))  # squared radius of the gate: hardly a true closure lies outside
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
        Log ratio of the likelihoods; the scale has a log-normal prior, a factor of two to either side. The gate stays
        that of the model, so that evidence compares scales.
    """
    factor, residuals = cho_factor(members.joint_covariance(scale), lower=True), members.residuals.ravel()
    log_true = -0.5 * residuals @ cho_solve(factor, residuals) - np.log(np.diag(factor[0])).sum()
    log_prior = -0.5 * (np.log(scale) / np.log(2.0)) ** 2
    return float(log_true + len(members) * _LOG_NORMAL - _log_false(members, 1.0).sum() + log_prior)


def gains_beside(judged: Innovations, believed: Innovations, scale: float) -> FloatArray:
    """Evidence that each closure adds to a set it is not part of.

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
    gains : ndarray, shape (D,)
        Positive where the set tells that the closure is true.
    """
    factor = cho_factor(believed.joint_covariance(scale), lower=True)
    shared = scale**2 * judged.shared_drift(believed).transpose(0, 2, 1, 3).reshape(3 * len(judged), -1)
    gain = cho_solve(factor, shared.T).T.reshape(len(judged), 3, -1)
    surprise = judged.residuals - gain @ believed.residuals.ravel()
    drift = judged.drift[judged.last] - judged.drift[judged.first]
    explained = gain @ shared.reshape(len(judged), 3, -1).transpose(0, 2, 1)
    covariance = judged.noise + scale**2 * drift - explained
    distance = np.einsum("ai,ai->a", surprise, np.linalg.solve(covariance, surprise[..., None])[..., 0])
    return np.asarray(_LOG_NORMAL - 0.5 * (distance + np.linalg.slogdet(covariance)[1]) - _log_false(judged, scale))


def without_losers(closures: Innovations, group: IntArray, scale: float) -> IntArray:
    """Drop what all others explain worst, again and again, until each closure and each group adds evidence.

    Parameters
    ----------
    closures : Innovations
        A set of K closures: pairs may agree where all together do not.
    group : ndarray of int, shape (K,)
        Closures of one group may share one wrong offset; then only the others can tell.
    scale : float
        Dead reckoning is this much worse than said.

    Returns
    -------
    kept : ndarray of int, shape (<= K,)
        Positions of those that stay.
    """
    kept, log_false = np.arange(len(closures)), _log_false(closures, scale)
    information: FloatArray = np.asarray(np.linalg.inv(closures.joint_covariance(scale)), dtype=np.float64)
    while kept.size:
        losers = _losers(information, closures.residuals[kept], log_false[kept], group[kept])
        if not losers.size:
            break
        kept, information = np.delete(kept, losers), _without(information, losers)
    return kept


def _losers(information: FloatArray, residuals: FloatArray, log_false: FloatArray, group: IntArray) -> IntArray:
    """The closure, or else the group, that loses most evidence by being in the set; empty if none does."""
    for member in (np.arange(len(group)), np.unique(group, return_inverse=True)[1]):
        n_closures = np.bincount(member)
        gain = _gains_within(information, residuals, member) - np.bincount(member, log_false) / n_closures
        worst = int(np.argmin(gain))
        if gain[worst] < 0.0:
            return np.flatnonzero(member == worst)
    return np.zeros(0, dtype=np.int64)


def _gains_within(information: FloatArray, residuals: FloatArray, group: IntArray) -> FloatArray:
    """Log density of an offset that the closures of each group share, given all other closures."""
    n, n_groups = len(residuals), int(group.max()) + 1
    own, pull = np.zeros((n_groups, 3, 3)), np.zeros((n_groups, 3))
    first, second = np.nonzero(group[:, None] == group)
    np.add.at(own, group[first], information.reshape(n, 3, n, 3)[first, :, second])
    np.add.at(pull, group, (information @ residuals.ravel()).reshape(n, 3))
    distance = np.einsum("ai,ai->a", pull, np.linalg.solve(own, pull[..., None])[..., 0])
    return np.asarray(_LOG_NORMAL - 0.5 * (distance - np.linalg.slogdet(own)[1]))


def _without(information: FloatArray, closures: IntArray) -> FloatArray:
    """Information of a set of which some closures are not observed."""
    rows = (3 * closures[:, None] + np.arange(3)).ravel()
    others = np.delete(np.arange(len(information)), rows)
    cross = information[np.ix_(others, rows)]
    return np.asarray(
        information[np.ix_(others, others)] - cross @ np.linalg.solve(information[np.ix_(rows, rows)], cross.T)
    )


def _log_false(closures: Innovations, scale: float) -> FloatArray:
    """Log density of false closures [1/(rad m**2)]: even over the gate of dead reckoning at that scale."""
    drift = closures.drift[closures.last] - closures.drift[closures.first]
    log_volume = np.log(4.0 / 3.0 * np.pi) + 0.5 * _DIMENSIONS * np.log(_GATE)
    return np.asarray(-log_volume - 0.5 * np.linalg.slogdet(scale**2 * drift + closures.noise)[1])
