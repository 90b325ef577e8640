"""Sets of loop closures that grow by evidence: from a seed, always by the closure that the set foretells best."""

from collections.abc import Iterator

import numpy as np
from numba import njit

from backend.arrays import FloatArray, IntArray
from backend.evidence import log_gate
from backend.innovations import Innovations

_MAX_VOTES = 12  # members of different groups after which a set is as good as fixed; the rest is added at once


def grown_sets(closures: Innovations, group: IntArray, scale: float) -> Iterator[tuple[float, IntArray]]:
    """Grow sets, each from the closure nearest to dead reckoning that no set before foretells.

    Parameters
    ----------
    closures : Innovations
        All closures, C of them.
    group : ndarray of int, shape (C,)
        Their groups; a set takes one of each.
    scale : float
        Dead reckoning is this much worse than said.

    Yields
    ------
    log_evidence : float
        Of the set, against as many closures spread evenly over the gate.
    members : ndarray of int, shape (K,)
        The set, at least two.
    """
    blocks = closures.joint_covariance(scale).reshape(len(closures), 3, len(closures), 3)
    density, residuals = log_gate(closures, scale), closures.residuals
    is_taken = np.zeros(len(closures), dtype=bool)
    for seed in np.argsort(-density, kind="stable"):
        if not is_taken[seed]:
            evidence, members, gains = _grow(residuals, blocks, density, group, seed)
            is_taken |= gains > 0.0
            if len(members) > 1:
                yield evidence, np.sort(members)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _grow(
    residuals: FloatArray, blocks: FloatArray, density: FloatArray, group: IntArray, seed: int
) -> tuple[float, IntArray, FloatArray]:
    """Take the seed, then what is foretold best, and so on while that adds evidence; a Cholesky factor grows by it."""
    n, members = len(residuals), np.empty(_MAX_VOTES, dtype=np.int64)
    surprise, covariance, factor = residuals.copy(), np.empty((n, 3, 3)), np.zeros((n, 3, 3 * _MAX_VOTES))
    gains, is_open = np.empty(n), np.ones(n, dtype=np.bool_)
    for i in range(n):
        covariance[i] = blocks[i, :, i]
        gains[i] = _log_normal(surprise[i], covariance[i]) - density[i]
    n_members, evidence, best = 0, 0.0, seed
    while True:
        members[n_members] = best
        evidence += gains[best]
        n_members += 1
        _take(blocks[:, :, best], best, surprise, covariance, factor[:, :, : 3 * n_members])
        best = -1
        for i in range(n):
            gains[i] = _log_normal(surprise[i], covariance[i]) - density[i]
            is_open[i] = is_open[i] and group[i] != group[members[n_members - 1]]
            if is_open[i] and gains[i] > 0.0 and (best < 0 or gains[i] > gains[best]):
                best = i
        if best < 0 or n_members == _MAX_VOTES:
            return evidence, members[:n_members], gains


@njit(cache=True)  # type: ignore[untyped-decorator]
def _take(blocks: FloatArray, member: int, surprise: FloatArray, covariance: FloatArray, factor: FloatArray) -> None:
    """Take a closure for true: what is left of the others once it is known, and the factor's last columns, in place."""
    before, new = factor[:, :, :-3], factor[:, :, -3:]
    column, root, told = np.empty((3, 3)), np.zeros((3, 3)), np.empty(3)
    _less_shared(blocks[member], before[member], before[member], column)
    _cholesky(column, root)
    _solve(root, surprise[member], told)
    for i in range(len(surprise)):
        _less_shared(blocks[i], before[i], before[member], column)
        for a in range(3):
            _solve(root, column[a], new[i, a])
            surprise[i, a] -= new[i, a, 0] * told[0] + new[i, a, 1] * told[1] + new[i, a, 2] * told[2]
        _less_shared(covariance[i], new[i], new[i], covariance[i])
    for a in range(3):
        covariance[member, a, a] += 1.0  # nothing is left of its own; that of the others stays positive


@njit(cache=True)  # type: ignore[untyped-decorator]
def _less_shared(block: FloatArray, one: FloatArray, other: FloatArray, rest: FloatArray) -> None:
    """A covariance of three rows less what the factor explains of it."""
    for a in range(3):
        for b in range(3):
            left = block[a, b]
            for k in range(one.shape[1]):
                left -= one[a, k] * other[b, k]
            rest[a, b] = left


@njit(cache=True)  # type: ignore[untyped-decorator]
def _log_normal(residual: FloatArray, covariance: FloatArray) -> float:
    """Log density of a residual about zero."""
    root, white = np.zeros((3, 3)), np.empty(3)
    _cholesky(covariance, root)
    _solve(root, residual, white)
    distance = white[0] ** 2 + white[1] ** 2 + white[2] ** 2
    return -1.5 * np.log(2.0 * np.pi) - 0.5 * distance - np.log(root[0, 0] * root[1, 1] * root[2, 2])


@njit(cache=True)  # type: ignore[untyped-decorator]
def _cholesky(matrix: FloatArray, root: FloatArray) -> None:
    """Lower root of a matrix of three rows."""
    for a in range(3):
        for b in range(a + 1):
            left = matrix[a, b]
            for k in range(b):
                left -= root[a, k] * root[b, k]
            root[a, b] = np.sqrt(left) if a == b else left / root[b, b]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _solve(root: FloatArray, vector: FloatArray, solved: FloatArray) -> None:
    """Whiten a vector by a lower root of three rows."""
    for a in range(3):
        left = vector[a]
        for k in range(a):
            left -= root[a, k] * solved[k]
        solved[a] = left / root[a, a]
