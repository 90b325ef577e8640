"""Cholesky's factor of a sparse symmetric matrix of 6 x 6 blocks, and those blocks of its inverse that it needs.

A graph of poses has one block row a pose and one block a measurement that joins two. Poses are eliminated in an order
that keeps the factor sparse (COLAMD, as GTSAM has it); which blocks the factor has follows from the order alone, so it
is found once and serves for every step and every weight.
"""

from dataclasses import dataclass

import gtsam
import numpy as np

from backend.arrays import FloatArray, IntArray
from backend.block_kernels import factorise_blocks, filled, invert_blocks, solve_blocks


@dataclass(frozen=True)
class BlockPattern:
    """Which blocks a factor has.

    Parameters
    ----------
    place : ndarray of int, shape (S,)
        When each block row is eliminated.
    start : ndarray of int, shape (S + 1,)
        Where the blocks below the diagonal of each column begin, by the order of elimination.
    rows : ndarray of int, shape (B,)
        Their rows, ascending in each column.
    """

    place: IntArray
    start: IntArray
    rows: IntArray

    def slots(self, first: IntArray, second: IntArray) -> IntArray:
        """Where the blocks between pairs of block rows are kept.

        Parameters
        ----------
        first, second : ndarray of int, shape (E,)
            The pairs, by their own numbers; all were given to `analyse`.

        Returns
        -------
        slots : ndarray of int, shape (E,)
            Positions in ``rows``.
        """
        one, other = self.place[first], self.place[second]
        column, row = np.minimum(one, other), np.maximum(one, other)
        keys = np.repeat(np.arange(len(self.place)), np.diff(self.start)) * len(self.place) + self.rows
        return np.searchsorted(keys, column * len(self.place) + row).astype(np.int64)


@dataclass(frozen=True)
class BlockFactor:
    """Cholesky's factor ``L`` of a matrix of blocks.

    Parameters
    ----------
    pattern : BlockPattern
        Which blocks it has.
    diagonal : ndarray, shape (S, 6, 6)
        Lower triangles on the diagonal, by the order of elimination.
    below : ndarray, shape (B, 6, 6)
        Blocks below it.
    """

    pattern: BlockPattern
    diagonal: FloatArray
    below: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one right side.

        Parameters
        ----------
        right : ndarray, shape (S, 6)
            The right side.

        Returns
        -------
        solution : ndarray, shape (S, 6)
            What the matrix takes to it.
        """
        pattern, solution = self.pattern, np.empty_like(right)
        solution[pattern.place] = right
        solve_blocks(pattern.start, pattern.rows, self.diagonal, self.below, solution)
        return np.asarray(solution[pattern.place])

    @property
    def log_determinant(self) -> float:
        """Natural logarithm of the matrix's determinant."""
        return 2.0 * float(np.log(np.diagonal(self.diagonal, axis1=1, axis2=2)).sum())

    def inverse_diagonal(self) -> FloatArray:
        """Blocks of the inverse that lie on its diagonal.

        Returns
        -------
        blocks : ndarray, shape (S, 6, 6)
            Exactly symmetric.

        Notes
        -----
        Takahashi's recursion [1]_: from the last column back, blocks of the inverse where the factor has blocks follow
        from those of later columns.

        References
        ----------
        .. [1] Takahashi, Fagan and Chen, "Formation of a sparse bus impedance matrix and its application to short
           circuit study", PICA 1973.
        """
        blocks, below = np.zeros_like(self.diagonal), np.zeros_like(self.below)
        invert_blocks(self.pattern.start, self.pattern.rows, self.diagonal, self.below, blocks, below)
        blocks = blocks[self.pattern.place]
        return np.asarray(0.5 * (blocks + blocks.swapaxes(1, 2)))


def analyse(n_blocks: int, first: IntArray, second: IntArray) -> BlockPattern:
    """Find an order of elimination and the blocks that it makes.

    Parameters
    ----------
    n_blocks : int
        Number of block rows S.
    first, second : ndarray of int, shape (E,)
        Pairs of different block rows between which the matrix has blocks.

    Returns
    -------
    pattern : BlockPattern
        Of the factor.
    """
    pairs = np.unique(np.sort(np.stack([first, second], axis=1), axis=1), axis=0)
    graph = gtsam.SymbolicFactorGraph()
    for block in range(n_blocks):
        graph.push_factor(block)
    for one, other in pairs.tolist():
        graph.push_factor(one, other)
    ordering = gtsam.Ordering.ColamdSymbolicFactorGraph(graph)
    place = np.empty(n_blocks, dtype=np.int64)
    place[[ordering.at(k) for k in range(n_blocks)]] = np.arange(n_blocks)
    placed = np.sort(place[pairs], axis=1)
    placed = placed[np.lexsort(placed.T[::-1])]
    begin = np.searchsorted(placed[:, 0], np.arange(n_blocks + 1))
    start, rows = filled(begin, np.ascontiguousarray(placed[:, 1]))
    return BlockPattern(place, start, rows)


def factorise(pattern: BlockPattern, diagonal: FloatArray, below: FloatArray) -> BlockFactor:
    """Factorise a matrix.

    Parameters
    ----------
    pattern : BlockPattern
        Which blocks its factor has.
    diagonal : ndarray, shape (S, 6, 6)
        Its blocks on the diagonal, by the order of elimination.
    below : ndarray, shape (B, 6, 6)
        Its blocks below, in the slots of the pattern; zero where only the factor has one.

    Returns
    -------
    factor : BlockFactor
        Its factor.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is not positive definite.
    """
    diagonal, below = diagonal.copy(), below.copy()
    if not factorise_blocks(pattern.start, pattern.rows, diagonal, below):
        raise np.linalg.LinAlgError(f"a matrix of {len(diagonal)} block rows must be positive definite")
    return BlockFactor(pattern, diagonal, below)
