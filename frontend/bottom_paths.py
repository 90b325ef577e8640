"""Where the bottom begins: contrast of level, and the path through it that changes little from ping to ping."""

import numba
import numpy as np

from frontend.arrays import BoolArray, FloatArray, IntArray

_CAP, _CAP_SHARE = (
    8.0,
    0.25,
)  # contrasts beyond so many standard deviations, or this share of the usual greatest, are equal
_EVERY = 5  # cells between those whose differences are looked at for their spread
_EARLIER = 0.6  # share of an earlier edge's strength that a later one loses: the first counts


def contrast(level: FloatArray, width: int) -> FloatArray:
    """How much levels rise at each cell, in standard deviations of all such differences.

    Parameters
    ----------
    level : ndarray, shape (G, C)
        Mean levels; NaN where unknown.
    width : int
        Cells of each of the pieces compared: one before the edge, three after it, so that what is thin is no floor.

    Returns
    -------
    contrast : ndarray, shape (G, C)
        Zero where it is not known; less what the level rises on both sides of the edge, as amplified noise does.
    """
    rise = np.full(level.shape, np.nan)
    _rise(np.ascontiguousarray(level, dtype=np.float64), width, rise)
    some = rise[:, ::_EVERY]
    some = some[np.isfinite(some)]
    if not some.size:
        return np.zeros(level.shape)
    scale = 1.4826 * float(np.median(np.abs(some - np.median(some))))
    z = np.nan_to_num(rise / max(scale, 1e-9))
    return z - np.maximum(_trend(z, 2 * width), 0.0)


def _trend(z: FloatArray, reach: int) -> FloatArray:
    """The lesser contrast so far before and after each cell; what is not known before follows a power of range."""
    after = np.zeros(z.shape)
    after[:, :-reach] = z[:, reach:]
    cell = np.maximum(np.arange(z.shape[1]), 0.5 * reach)
    before = after * (1.0 + reach / cell)
    before[:, 3 * reach // 2 :] = z[:, reach // 2 : -reach]
    return np.minimum(before, np.where(cell < 1.5 * reach, before, after))


def evidence(z: FloatArray, is_allowed: BoolArray, width: int) -> FloatArray:
    """Evidence that the bottom begins at each cell.

    Parameters
    ----------
    z : ndarray, shape (G, C)
        Contrast in standard deviations.
    is_allowed : ndarray of bool, shape (G, C)
        Where a bottom may be.
    width : int
        Cells that belong to one edge.

    Returns
    -------
    evidence : ndarray, shape (G, C)
        Up to 1; what follows an earlier edge is worth less.
    """
    result = np.full(z.shape, -1.0)
    greatest = np.where(is_allowed, z, 0.0).max(axis=1)
    cap = max(_CAP, _CAP_SHARE * float(np.median(greatest)))
    _evidence(z / cap, np.ascontiguousarray(is_allowed), width, result)
    return result


def best_path(evidence: FloatArray, cost: float) -> IntArray:
    """Path with the most evidence less a cost for every cell that it moves.

    Parameters
    ----------
    evidence : ndarray, shape (G, C)
        Evidence of each cell.
    cost : float
        Cost of a move by one cell.

    Returns
    -------
    path : ndarray of int, shape (G,)
        Cell of each row (Viterbi's algorithm).
    """
    path = np.empty(len(evidence), dtype=np.int64)
    came_from = np.empty(evidence.shape, dtype=np.int32)
    _best_path(np.ascontiguousarray(evidence, dtype=np.float64), float(cost), came_from, path)
    return path


def first_samples(
    level: FloatArray, threshold: FloatArray, start: IntArray, cost: float
) -> tuple[IntArray, FloatArray]:
    """First sample of the bottom in a short piece of every ping.

    Parameters
    ----------
    level : ndarray, shape (N, W)
        Levels around the expected place.
    threshold : ndarray, shape (N, 2)
        Level between water and bottom, and half their difference.
    start : ndarray of int, shape (N,)
        Sample at which each piece starts.
    cost : float
        Cost of a change by one sample from ping to ping, in samples.

    Returns
    -------
    sample : ndarray of int, shape (N,)
        First sample at or after which levels are the bottom's.
    gain : ndarray, shape (N,)
        How much better water before and bottom after explain the piece than water alone or bottom alone, in samples.
    """
    vote = np.clip((threshold[:, :1] - level) / threshold[:, 1:], -1.0, 1.0)
    vote[level.min(axis=1) == level.max(axis=1)] = 0.0  # a lost ping
    score = np.zeros((len(level), level.shape[1] + 1))
    score[:, 1:] = np.cumsum(np.nan_to_num(vote), axis=1)
    sample, came_from = np.empty(len(level), dtype=np.int64), np.empty(score.shape, dtype=np.int32)
    _best_aligned_path(score, np.asarray(start, dtype=np.int64), float(cost), came_from, sample)
    best = score[np.arange(len(score)), sample - start]
    return sample, best - np.maximum(score[:, 0], score[:, -1])


@numba.njit(cache=True)
def _rise(level, width, rise):  # type: ignore[no-untyped-def]
    """The least of three means after each cell less the mean before it; NaN where one of them is not known."""
    total = np.empty(level.shape[1] + 1)
    for row in range(level.shape[0]):
        total[0] = 0.0
        last_gap = -1
        for k in range(level.shape[1]):
            if np.isnan(level[row, k]):
                last_gap = k
                total[k + 1] = total[k]
            else:
                total[k + 1] = total[k] + level[row, k]
            edge = k + 1 - 3 * width
            if edge >= width and last_gap < edge - width:
                least = np.inf
                for piece in range(3):
                    first = edge + piece * width
                    least = min(least, total[first + width] - total[first])
                rise[row, edge] = (least - total[edge] + total[edge - width]) / width


@numba.njit(cache=True)
def _evidence(z, is_allowed, width, result):  # type: ignore[no-untyped-def]
    n = z.shape[1]
    for row in range(z.shape[0]):
        earlier = 0.0
        for k in range(n):
            if k >= width and is_allowed[row, k - width]:
                earlier = max(earlier, min(z[row, k - width], 1.0))
            if not is_allowed[row, k]:
                continue
            peak = 0.0
            for other in range(max(0, k - width), min(n, k + width + 1)):
                peak = max(peak, z[row, other])
            flank = 1.0 - z[row, k] / peak if peak > 0.0 else 1.0
            result[row, k] = min(max(z[row, k], 0.0), 1.0) - flank - _EARLIER * earlier


@numba.njit(cache=True)
def _best_path(evidence, cost, came_from, path):  # type: ignore[no-untyped-def]
    best = evidence[0].copy()
    for row in range(1, evidence.shape[0]):
        _reach(best, cost, came_from[row])
        best += evidence[row]
    _trace_back(best, came_from, path)


@numba.njit(cache=True)
def _best_aligned_path(score, start, cost, came_from, path):  # type: ignore[no-untyped-def]
    """The same for rows that start at different samples; the path is in samples."""
    n = score.shape[1]
    best = score[0].copy()
    moved = np.empty(n)
    for row in range(1, score.shape[0]):
        _reach(best, cost, came_from[row])
        shift = start[row] - start[row - 1]
        reached = came_from[row].copy()
        for k in range(n):
            old = min(max(k + shift, 0), n - 1)
            moved[k] = best[old] - cost * abs(k + shift - old) + score[row, k]
            came_from[row, k] = reached[old]
        best[:] = moved
    _trace_back(best, came_from, path)
    path += start


@numba.njit(cache=True)
def _reach(best, cost, origin):  # type: ignore[no-untyped-def]
    """Best score with which each cell can be reached from any other, and from which."""
    for k in range(best.size):
        origin[k] = k
        if k > 0 and best[k - 1] - cost > best[k]:
            best[k], origin[k] = best[k - 1] - cost, origin[k - 1]
    for k in range(best.size - 2, -1, -1):
        if best[k + 1] - cost > best[k]:
            best[k], origin[k] = best[k + 1] - cost, origin[k + 1]


@numba.njit(cache=True)
def _trace_back(best, came_from, path):  # type: ignore[no-untyped-def]
    path[-1] = np.argmax(best)
    for row in range(path.size - 1, 0, -1):
        path[row - 1] = came_from[row, path[row]]
