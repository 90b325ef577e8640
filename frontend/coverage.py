"""Coverage: which floor a submap knows, coarsely, and how much of it another may know too."""

from dataclasses import dataclass

import numba
import numpy as np

from frontend.arrays import AnyArray, FloatArray
from frontend.priors import Prior
from frontend.submaps import Submap

OUTLINE_STEP = 5.0  # [m] between the cells that stand for a submap's coverage


@dataclass(frozen=True)
class Coverage:
    """Known cells of a submap every few metres.

    Parameters
    ----------
    cells : ndarray, shape (K, 2)
        Where they are in the submap frame [m].
    raster : ndarray of bool, shape (n_x, n_y)
        True at the cells.
    origin : ndarray, shape (2,)
        Its first cell [`OUTLINE_STEP`].
    """

    cells: FloatArray
    raster: AnyArray
    origin: FloatArray


def coverage_of(submap: Submap) -> Coverage:
    """Outline what a submap knows.

    Parameters
    ----------
    submap : Submap
        Its surface.

    Returns
    -------
    coverage : Coverage
        Every few metres a known cell.
    """
    step = max(round(OUTLINE_STEP / submap.surface.spacing), 1)
    x, y = np.meshgrid(submap.surface.x[::step], submap.surface.y[::step])
    cells = np.stack([x, y], axis=-1)[submap.is_known[::step, ::step]]
    index = np.rint(cells / OUTLINE_STEP).astype(np.int64)
    origin = index.min(axis=0) if len(index) else np.zeros(2, dtype=np.int64)
    raster = np.zeros(tuple(index.max(axis=0) - origin + 1) if len(index) else (0, 0), dtype=np.bool_)
    raster[tuple((index - origin).T)] = True
    return Coverage(cells, raster, origin.astype(np.float64))


def possible_overlap(target: Coverage, source: Coverage, prior: Prior) -> float:
    """Overlap of two submaps when the source is drawn to the target as far as the gate allows.

    Parameters
    ----------
    target, source : Coverage
        The two submaps.
    prior : Prior
        Predicted transform with covariance.

    Returns
    -------
    overlap : float
        Share of the smaller coverage [1].
    """
    if not len(target.cells) or not len(source.cells):
        return 0.0
    T = prior.T_target_source
    moved = source.cells @ T[:2, :2].T + T[:2, 3]
    towards = target.cells.mean(axis=0) - moved.mean(axis=0)
    reach = np.sqrt(prior.limit / max(float(towards @ np.linalg.inv(prior.planar_covariance[:2, :2]) @ towards), 1e-12))
    moved = moved + min(float(reach), 1.0) * towards
    n_common = _n_common(target.raster, np.rint(moved / OUTLINE_STEP) - target.origin)
    return float(n_common / min(len(target.cells), len(source.cells)))


@numba.njit(cache=True)  # type: ignore[misc]
def _n_common(raster: AnyArray, cells: FloatArray) -> int:
    """Number of cells that fall on the raster's."""
    n = 0
    for k in range(len(cells)):
        i, j = int(cells[k, 0]), int(cells[k, 1])
        if 0 <= i < raster.shape[0] and 0 <= j < raster.shape[1] and raster[i, j]:
            n += 1
    return n
