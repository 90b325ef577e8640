"""Slopes along the track from the local normal over the nearest cells of other lines, as linear functions of relief."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.reconstruction.lines import LineFrames

_RIDGE = 0.02  # squared spread of the neighbours, in cells, at which a slope counts half
_MOST = 16  # a cell looks at this many times the wanted neighbours before it goes without the missing ones


@dataclass(frozen=True)
class Neighbours:
    """Local planes through cells of other lines, neighbours and places held fixed; N = L * C cells, line by line.

    Parameters
    ----------
    along : csr_array, shape (N, N)
        ``along @ relief + along_0`` is the slope of the local plane along the normal of each cell's beam plane.
    along_0 : ndarray, shape (N,)
        Slope of the floor that the reliefs stand on [1].
    departure : csr_array, shape (N, N)
        ``departure @ relief + departure_0`` is the height of the local plane above each cell.
    departure_0 : ndarray, shape (N,)
        The same of the floor that the reliefs stand on [m].
    distance : ndarray, shape (N,)
        Root mean square distance of the neighbours [m]; infinite where there are too few for a plane.
    """

    along: csr_array
    along_0: FloatArray
    departure: csr_array
    departure_0: FloatArray
    distance: FloatArray


def on_other_lines(points: FloatArray, line: IntArray, n_neighbours: int) -> tuple[IntArray, BoolArray]:
    """Nearest points of other lines.

    Parameters
    ----------
    points : ndarray, shape (N, 3)
        Points [m].
    line : ndarray of int, shape (N,)
        Line of each point.
    n_neighbours : int
        How many are wanted.

    Returns
    -------
    index : ndarray of int, shape (N, n_neighbours)
        Neighbours, the nearest first.
    found : ndarray of bool, shape (N, n_neighbours)
        False where there is none.
    """
    tree, n = cKDTree(points), len(points)
    index = np.zeros((n, n_neighbours), dtype=np.int64)
    found = np.zeros((n, n_neighbours), dtype=bool)
    rows, k = np.arange(n), 2 * n_neighbours
    while rows.size:
        k = min(k, n)
        near = tree.query(points[rows], k=k)[1]
        other = line[near] != line[rows][:, None]
        first = np.argsort(~other, axis=1, kind="stable")[:, :n_neighbours]
        index[rows, : first.shape[1]] = np.take_along_axis(near, first, axis=1)
        found[rows, : first.shape[1]] = np.take_along_axis(other, first, axis=1)
        rows = rows[~found[rows].all(axis=1)] if k < min(n, _MOST * n_neighbours) else rows[:0]
        k *= 2
    return index, found


def local_planes(frames: LineFrames, relief: FloatArray, n_neighbours: int) -> Neighbours:
    """Fit a plane about every cell to the nearest cells of other lines.

    Parameters
    ----------
    frames : LineFrames
        The lines.
    relief : ndarray, shape (L, C)
        Relief at which places and neighbours are taken [m].
    n_neighbours : int
        Cells in a plane.

    Returns
    -------
    neighbours : Neighbours
        Planes as linear functions of the relief.

    Notes
    -----
    Heights are taken along ``up`` of the cell's own line, over ``across`` and ``forward``: the slope over ``forward``
    is that of the normal projected on the plane orthogonal to ``across``. Weighted least squares on what heights differ
    by from level; where the neighbours do not spread along the track, as where all lie on one line, the plane goes to
    level.
    """
    points = frames.points(relief).reshape(-1, 3)
    line = np.repeat(np.arange(frames.shape[0]), frames.shape[1])
    index, found = on_other_lines(points, line, n_neighbours)
    apart = points[index] - points[:, None]
    weight = found / ((apart**2).sum(axis=2) + frames.spacing**2)
    plane, along = _fit(apart, weight, frames, line)
    enough = found.sum(axis=1) >= 3
    plane, along = plane * enough[:, None], along * enough[:, None]
    base = frames.points(np.zeros(frames.shape))[:, :, 2].ravel()
    upright = frames.up[line, 2]
    height_0 = (base[index] - base[:, None]) / upright[:, None]
    tilt = upright[index] / upright[:, None]
    spread = (weight * (apart**2).sum(axis=2)).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-300)
    return Neighbours(
        _matrix(index, along * tilt, -along.sum(axis=1)),
        (along * height_0).sum(axis=1) - frames.forward[line, 2] / upright,
        _matrix(index, plane * tilt, -plane.sum(axis=1)),
        (plane * height_0).sum(axis=1),
        np.where(enough, np.sqrt(spread), np.inf),
    )


def _fit(apart: FloatArray, weight: FloatArray, frames: LineFrames, line: IntArray) -> tuple[FloatArray, FloatArray]:
    """Shapes (N, n): what each neighbour's height adds to the plane's height and to its slope along the track."""
    across, forward = (_dot(apart, axis[line]) / frames.spacing for axis in (frames.across, frames.forward))
    design = np.stack([np.ones_like(across), across, forward], axis=1)
    weighted = design * weight[:, None, :]
    normal = weighted @ np.swapaxes(design, 1, 2)
    total = weight.sum(axis=1)
    normal[:, 1, 1] += _RIDGE * total
    normal[:, 2, 2] += _RIDGE * total
    normal[total == 0] = np.eye(3)
    solved = np.asarray(np.linalg.solve(normal, weighted), dtype=np.float64)
    return solved[:, 0], solved[:, 2] / frames.spacing


def _dot(vectors: FloatArray, axis: FloatArray) -> FloatArray:
    """Shape (N, n): components of vectors (N, n, 3) along one axis (N, 3) each, in a fixed order of sums."""
    return np.asarray((vectors * axis[:, None, :]).sum(axis=2))


def _matrix(index: IntArray, values: FloatArray, diagonal: FloatArray) -> csr_array:
    n, k = index.shape
    rows = np.arange(n)
    column = np.concatenate([index, rows[:, None]], axis=1).ravel()
    entries = np.concatenate([values, diagonal[:, None]], axis=1).ravel()
    return csr_array((entries, (np.repeat(rows, k + 1), column)), shape=(n, n))
