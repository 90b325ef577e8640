"""The point cloud of reconstructed lines: shadow regions over the whole window, and its rasters."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_closing, gaussian_filter
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.neighbours import on_other_lines

_N_NEIGHBOURS = 6  # of other lines through which a shadow goes on


@dataclass(frozen=True)
class LineCloud:
    """Points on the lines of a window; K points.

    Parameters
    ----------
    points : ndarray, shape (K, 3)
        In the submap frame [m].
    line : ndarray of int, shape (K,)
        Line of each point.
    sigma : ndarray, shape (K,)
        Standard deviation of the height [m].
    log_reflectivity : ndarray, shape (K,)
        Natural logarithm, of intensity.
    is_shadow : ndarray of bool, shape (K,)
        Points that their line does not see.
    shadow_region : ndarray of int, shape (K,)
        Number of the contiguous shadow that a point lies in, from 1; 0 outside.
    """

    points: FloatArray
    line: IntArray
    sigma: FloatArray
    log_reflectivity: FloatArray
    is_shadow: BoolArray
    shadow_region: IntArray


def shadow_regions(points: FloatArray, line: IntArray, is_shadow: BoolArray, spacing: float) -> IntArray:
    """Join the shadows of single lines to regions.

    Parameters
    ----------
    points : ndarray, shape (K, 3)
        Points of the window, those of a line in order along it [m].
    line : ndarray of int, shape (K,)
        Line of each.
    is_shadow : ndarray of bool, shape (K,)
        Shadow labels.
    spacing : float
        Distance of points on a line; shadows on other lines belong together up to twice as far [m].

    Returns
    -------
    region : ndarray of int, shape (K,)
        From 1, in the order of their first point; 0 where there is no shadow.
    """
    region = np.zeros(len(points), dtype=np.int64)
    dark = np.flatnonzero(is_shadow)
    if dark.size == 0:
        return region
    following = np.flatnonzero((np.diff(dark) == 1) & (np.diff(line[dark]) == 0))
    pairs = [np.stack([following, following + 1])]
    if dark.size > 1:
        index, found = on_other_lines(points[dark], line[dark], min(_N_NEIGHBOURS, dark.size))
        found &= np.linalg.norm(points[dark][index] - points[dark][:, None], axis=2) <= 2 * spacing
        pairs.append(np.stack([np.nonzero(found)[0], index[found]]))
    first, second = np.concatenate(pairs, axis=1)
    graph = csr_array((np.ones(first.size), (first, second)), shape=(dark.size, dark.size))
    region[dark] = connected_components(graph, directed=False)[1] + 1
    return region


def rasterise(cloud: LineCloud, raster: Raster) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Average points on a grid.

    Parameters
    ----------
    cloud : LineCloud
        The points.
    raster : Raster
        The grid.

    Returns
    -------
    z, sigma, log_reflectivity : ndarray, shape (n_y, n_x)
        Heights [m], their standard deviation [m] and log-reflectivity; between lines that fan out taken from the points
        about, with the disagreement of those points in sigma; NaN where no line passes.
    is_shadow : ndarray of bool, shape (n_y, n_x)
        Cells where most of the points lie in shadow.
    """
    layers = np.stack(
        [
            np.ones(len(cloud.points)),
            cloud.points[:, 2],
            cloud.sigma**2,
            cloud.log_reflectivity,
            cloud.is_shadow,
            cloud.points[:, 2] ** 2,
        ]
    )
    sums = _splat(cloud.points, layers, raster)
    known = sums[0] > 0.1
    wide = np.stack([gaussian_filter(layer, 1.0, truncate=3.0, mode="constant") for layer in sums])
    covered = known | (binary_closing(np.pad(known, 3), iterations=3)[3:-3, 3:-3] & (wide[0] > 1e-3))
    sums = np.where(known, sums, wide)
    weight = np.where(covered, sums[0], 1.0)
    z, variance, rho, dark, square = (np.where(covered, layer / weight, np.nan) for layer in sums[1:])
    scatter = np.where(known, 0.0, np.maximum(square - z**2, 0.0))
    return z, np.sqrt(variance + scatter), rho, covered & (dark > 0.5)


def _splat(points: FloatArray, layers: FloatArray, raster: Raster) -> FloatArray:
    """Shape (n_layers, n_y, n_x): each point shared among the four cells about it."""
    place = (points[:, :2] - np.array(raster.origin)) / raster.spacing
    low = np.floor(place).astype(np.int64)
    share = place - low
    sums = np.zeros((len(layers), raster.n_cells))
    for i in (0, 1):
        for j in (0, 1):
            column, row = low[:, 0] + i, low[:, 1] + j
            inside = (column >= 0) & (column < raster.n_x) & (row >= 0) & (row < raster.n_y)
            weight = np.abs(1 - i - share[:, 0]) * np.abs(1 - j - share[:, 1])
            cell = (row * raster.n_x + column)[inside]
            for total, layer in zip(sums, layers, strict=True):
                total += np.bincount(cell, (weight * layer)[inside], raster.n_cells)
    return sums.reshape(-1, *raster.shape)
