"""Sets of loop closures that grow by evidence: from a seed, always by the closure that the set foretells best."""

from collections.abc import Iterator

import numpy as np

from backend.arrays import BoolArray, FloatArray, IntArray
from backend.evidence import log_gate, log_normal
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
    density = log_gate(closures, scale)
    is_taken = np.zeros(len(closures), dtype=bool)
    for seed in np.argsort(-density, kind="stable"):
        if not is_taken[seed]:
            foretold = _Foretold(closures.residuals, blocks, density)
            evidence, members = _grow(foretold, group, int(seed))
            is_taken |= foretold.gains > 0.0
            if len(members) > 1:
                yield evidence, np.sort(members)


class _Foretold:
    """All closures, as those that are taken for true foretell them: a Cholesky factor that grows by three columns."""

    def __init__(self, residuals: FloatArray, blocks: FloatArray, density: FloatArray) -> None:
        each = np.arange(len(residuals))
        self._blocks, self._density = blocks, density
        self._surprise, self._covariance = residuals.copy(), blocks[each, :, each].copy()
        self._factor = np.zeros((len(residuals), 3, 0))
        self.gains = log_normal(self._surprise, self._covariance) - density

    def take(self, member: int) -> None:
        """Take a closure for true."""
        factor = self._factor
        column = self._blocks[:, :, member] - factor @ factor[member].T
        root = np.linalg.cholesky(column[member])
        new = np.linalg.solve(root, column.swapaxes(1, 2)).swapaxes(1, 2)
        self._surprise -= new @ np.linalg.solve(root, self._surprise[member])
        self._covariance -= new @ new.swapaxes(1, 2)
        self._covariance[member] += np.eye(3)  # nothing is left of its own; that of the others stays positive
        self._factor = np.concatenate([factor, new], axis=2)
        self.gains = log_normal(self._surprise, self._covariance) - self._density


def _grow(foretold: _Foretold, group: IntArray, seed: int) -> tuple[float, IntArray]:
    """Take the seed, then what is foretold best, and so on while that adds evidence."""
    is_open: BoolArray = np.ones(len(group), dtype=bool)
    members, evidence, best = [], 0.0, seed
    while True:
        members.append(best)
        evidence += float(foretold.gains[best])
        foretold.take(best)
        is_open &= group != group[best]
        gains = np.where(is_open, foretold.gains, -np.inf)
        best = int(np.argmax(gains))
        if not gains[best] > 0.0 or len(members) == _MAX_VOTES:
            return evidence, np.array(members, dtype=np.int64)
