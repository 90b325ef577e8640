"""Kernels of sparse matrices of 6 x 6 blocks: what a factor fills, the factor, its solutions and its inverse.

Columns come in the order of elimination; ``rows[start[j] : start[j + 1]]`` are those of column j below the diagonal.
"""

import numpy as np
from numba import njit

from backend.arrays import FloatArray, IntArray

SIZE = 6  # rows of a block


@njit(cache=True)  # type: ignore[untyped-decorator]
def filled(begin: IntArray, later: IntArray) -> tuple[IntArray, IntArray]:
    """Rows of each column of the factor: those of the matrix, and those of every column whose first row it is."""
    n = len(begin) - 1
    start, rows = np.zeros(n + 1, dtype=np.int64), np.empty(max(4 * len(later), 16), dtype=np.int64)
    mark, child, sibling = np.full(n, -1), np.full(n, -1), np.full(n, -1)
    for j in range(n):
        mark[j], top = j, start[j]
        while len(rows) < top + n:  # room for the longest column
            rows = np.concatenate((rows, np.empty_like(rows)))
        for k in range(begin[j], begin[j + 1]):
            if mark[later[k]] != j:
                mark[later[k]], rows[top] = j, later[k]
                top += 1
        c = child[j]
        while c >= 0:
            for k in range(start[c], start[c + 1]):
                if mark[rows[k]] != j:
                    mark[rows[k]], rows[top] = j, rows[k]
                    top += 1
            c = sibling[c]
        rows[start[j] : top] = np.sort(rows[start[j] : top])
        start[j + 1] = top
        if top > start[j]:
            parent = rows[start[j]]
            sibling[j], child[parent] = child[parent], j
    return start, rows[: start[n]].copy()


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def factorise_blocks(start: IntArray, rows: IntArray, diagonal: FloatArray, below: FloatArray) -> bool:
    """In place, column by column, each taken from those to its right; false where a pivot is not positive."""
    for j in range(len(diagonal)):
        if not _factorise_block(diagonal[j]):
            return False
        for a in range(start[j], start[j + 1]):
            _divide(below[a], diagonal[j])
        for a in range(start[j], start[j + 1]):
            column = rows[a]
            _subtract(below, a, a, diagonal, column)
            slot = start[column]
            for b in range(a + 1, start[j + 1]):
                while rows[slot] < rows[b]:
                    slot += 1
                _subtract(below, b, a, below, slot)
    return True


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _factorise_block(block: FloatArray) -> bool:
    """Lower root of a block, in place; its upper triangle is left as it is."""
    for i in range(SIZE):
        for j in range(i + 1):
            s = block[i, j]
            for k in range(j):
                s -= block[i, k] * block[j, k]
            if i != j:
                block[i, j] = s / block[j, j]
            elif s > 0.0 and np.isfinite(s):
                block[i, i] = np.sqrt(s)
            else:
                return False
    return True


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _divide(block: FloatArray, root: FloatArray) -> None:
    """A block times the inverse of a root's transpose, in place."""
    for i in range(SIZE):
        for j in range(SIZE):
            s = block[i, j]
            for k in range(j):
                s -= block[i, k] * root[j, k]
            block[i, j] = s / root[j, j]


@njit(cache=True, fastmath={"contract"})  # type: ignore[untyped-decorator]
def _subtract(below: FloatArray, one: int, other: int, blocks: FloatArray, slot: int) -> None:
    """Take the product of a block with another's transpose from a third."""
    for i in range(SIZE):
        for j in range(SIZE):
            s = 0.0
            for k in range(SIZE):
                s += below[one, i, k] * below[other, j, k]
            blocks[slot, i, j] -= s


@njit(cache=True)  # type: ignore[untyped-decorator]
def solve_blocks(start: IntArray, rows: IntArray, diagonal: FloatArray, below: FloatArray, x: FloatArray) -> None:
    """Forward through the factor and back through its transpose, in place."""
    for j in range(len(x)):
        for i in range(SIZE):
            for k in range(i):
                x[j, i] -= diagonal[j, i, k] * x[j, k]
            x[j, i] /= diagonal[j, i, i]
        for a in range(start[j], start[j + 1]):
            for i in range(SIZE):
                for k in range(SIZE):
                    x[rows[a], i] -= below[a, i, k] * x[j, k]
    for j in range(len(x) - 1, -1, -1):
        for a in range(start[j], start[j + 1]):
            for i in range(SIZE):
                for k in range(SIZE):
                    x[j, i] -= below[a, k, i] * x[rows[a], k]
        for i in range(SIZE - 1, -1, -1):
            for k in range(i + 1, SIZE):
                x[j, i] -= diagonal[j, k, i] * x[j, k]
            x[j, i] /= diagonal[j, i, i]


@njit(cache=True)  # type: ignore[untyped-decorator]
def invert_blocks(
    start: IntArray, rows: IntArray, diagonal: FloatArray, below: FloatArray, blocks: FloatArray, inverse: FloatArray
) -> None:
    """Blocks of the inverse where the factor has blocks, from the last column back."""
    root, scaled = np.empty((SIZE, SIZE)), np.empty((1, SIZE, SIZE))
    for j in range(len(diagonal) - 1, -1, -1):
        first, end = start[j], start[j + 1]
        _invert_root(diagonal[j], root)
        if len(scaled) < end - first:
            scaled = np.empty((end - first, SIZE, SIZE))
        scaled[: end - first] = 0.0
        for a in range(first, end):
            _add_product(below[a], root, 1.0, scaled[a - first])
        for a in range(first, end):
            _add_product(blocks[rows[a]], scaled[a - first], -1.0, inverse[a])
            slot = start[rows[a]]
            for b in range(a + 1, end):
                while rows[slot] < rows[b]:
                    slot += 1
                _add_product(inverse[slot], scaled[a - first], -1.0, inverse[b])
                _add_product(inverse[slot].T, scaled[b - first], -1.0, inverse[a])
        _add_product(root.T, root, 1.0, blocks[j])
        for a in range(first, end):
            _add_product(scaled[a - first].T, inverse[a], -1.0, blocks[j])


@njit(cache=True)  # type: ignore[untyped-decorator]
def _add_product(one: FloatArray, other: FloatArray, factor: float, block: FloatArray) -> None:
    """Add so many times the product of two blocks to a third."""
    for i in range(SIZE):
        for k in range(SIZE):
            scaled = factor * one[i, k]
            for j in range(SIZE):
                block[i, j] += scaled * other[k, j]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _invert_root(root: FloatArray, inverse: FloatArray) -> None:
    """Inverse of a lower triangle."""
    inverse[:] = 0.0
    for j in range(SIZE):
        for i in range(j, SIZE):
            s = 1.0 if i == j else 0.0
            for k in range(j, i):
                s -= root[i, k] * inverse[k, j]
            inverse[i, j] = s / root[i, i]
