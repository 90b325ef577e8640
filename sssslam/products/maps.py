"""The map of the dive: submaps at their corrected poses, blended onto one grid that lies north up."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from frontend.arrays import BoolArray, FloatArray
from frontend.frames import invert, level, transform
from frontend.heightfield import Heightfield
from frontend.submaps import Submap
from frontend.threads import in_order

_log = logging.getLogger(__name__)

_MAX_CELLS = 1 << 24  # 4096 x 4096: the sums of a blend stay below 1 GB
_TAPER_CELLS = 8  # a submap's weight rises over so many cells from its rim, so that no seam looks like a scarp


@dataclass(frozen=True)
class SeafloorMap:
    """The blended seafloor.

    Parameters
    ----------
    height : Heightfield
        Heights in the world frame [m]; NaN where no submap lies.
    sigma : ndarray, shape (n_y, n_x)
        Standard deviation of the heights, the disagreement of the submaps included [m].
    reflectivity : ndarray, shape (n_y, n_x)
        Reflectivity relative to the mean of the dive (linear); NaN where only shadow was seen.
    """

    height: Heightfield
    sigma: FloatArray
    reflectivity: FloatArray


def blend_submaps(submaps: Sequence[Submap], T_world_submap: FloatArray) -> SeafloorMap:
    """Blend submaps by their inverse variance.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps; a cell without a positive sigma has no weight.
    T_world_submap : ndarray, shape (S, 4, 4)
        Their frames in the world; what tilt an optimiser left in them is taken out.

    Returns
    -------
    seafloor : SeafloorMap
        The blend on the finest grid of the submaps, coarsened by twos where the dive is too large for it; one unknown
        cell where there is no submap.

    Notes
    -----
    With weights ``w`` (inverse variance, tapered at the rims) a cell has the height ``m = sum(w z) / sum(w)`` and the
    variance of the mixture, ``sum(w (sigma**2 + (z - m)**2)) / sum(w)``. Neighbouring submaps share pings, so the
    variance of a mean of independent heights would claim too much. Reflectivity is blended as its logarithm.
    """
    T_world_submap = level(T_world_submap)
    x, y, spacing = _grid(submaps, T_world_submap)
    sums = np.zeros((5, y.size, x.size))
    parts = list(zip(submaps, T_world_submap, strict=True))
    cells = [_cells_below(submap, T, x, y) for submap, T in parts]
    below = [(*part, x[columns], y[rows]) for part, (columns, rows) in zip(parts, cells, strict=True)]
    for (columns, rows), weighted in zip(cells, in_order(lambda part: _weighted(*part), below), strict=True):
        sums[:, rows, columns] += weighted
    return _divide(sums, spacing, (float(x[0]), float(y[0])))


def _corners(submap: Submap, T_world_submap: FloatArray) -> FloatArray:
    x, y = submap.surface.x[[0, -1]], submap.surface.y[[0, -1]]
    return transform(T_world_submap, np.stack([*np.meshgrid(x, y), np.zeros((2, 2))], axis=-1)).reshape(-1, 3)


def _grid(submaps: Sequence[Submap], T_world_submap: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    if not submaps:
        return np.zeros(1), np.zeros(1), 1.0
    corners = np.concatenate([_corners(submap, T) for submap, T in zip(submaps, T_world_submap, strict=True)])
    low, high = corners.min(axis=0)[:2], corners.max(axis=0)[:2]
    finest = spacing = min(submap.surface.spacing for submap in submaps)
    while np.prod(np.ceil((high - low) / spacing) + 2) > _MAX_CELLS:
        spacing *= 2
    if spacing > finest:
        _log.warning(
            "the map has cells of %g m instead of %g m: the dive covers %.0f x %.0f m", spacing, finest, *high - low
        )
    first, last = np.floor(low / spacing), np.ceil(high / spacing)
    x, y = (spacing * np.arange(a, b + 1) for a, b in zip(first, last, strict=True))
    return x, y, spacing


def _cells_below(submap: Submap, T: FloatArray, x: FloatArray, y: FloatArray) -> tuple[slice, slice]:
    corners = _corners(submap, T)
    low, high = corners.min(axis=0), corners.max(axis=0)
    columns, rows = (np.searchsorted(axis, [low[i], high[i]]) for i, axis in enumerate((x, y)))
    return slice(columns[0], columns[1] + 1), slice(rows[0], rows[1] + 1)


def _taper(known: BoolArray) -> FloatArray:
    distance = distance_transform_edt(np.pad(known, 1))[1:-1, 1:-1]
    return np.minimum(distance / _TAPER_CELLS, 1.0)


def _weighted(submap: Submap, T: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Weight and weighted z, z**2 + sigma**2, then weight, log-reflectivity of what is no shadow; 0 where unknown."""
    surface = submap.surface
    points = transform(invert(T), np.stack([*np.meshgrid(x, y), np.zeros((y.size, x.size))], axis=-1))
    layers = [surface.z, submap.sigma, submap.log_reflectivity, submap.is_shadow.astype(np.float64)]
    layers += [_taper(submap.is_known & (submap.sigma > 0))]
    z, sigma, log_reflectivity, shadow, taper = (
        Heightfield(layer, surface.spacing, surface.origin).sample(points[..., 0], points[..., 1]) for layer in layers
    )
    z = z + T[2, 3]
    weight = np.where((sigma > 0) & np.isfinite(z), taper, 0.0) / np.where(sigma > 0, sigma, 1.0) ** 2
    lit = np.where(np.isfinite(log_reflectivity), weight * (1.0 - shadow), 0.0)
    stack = [weight, weight * z, weight * (z**2 + sigma**2), lit, lit * log_reflectivity]
    return np.where(np.isfinite(stack), stack, 0.0)


def _divide(sums: FloatArray, spacing: float, origin: tuple[float, float]) -> SeafloorMap:
    with np.errstate(invalid="ignore", divide="ignore"):
        z, second = sums[1] / sums[0], sums[2] / sums[0]
        reflectivity = np.exp(sums[4] / sums[3])
        sigma = np.sqrt(np.maximum(second - z**2, 0.0))
    return SeafloorMap(Heightfield(z, spacing, origin), sigma, reflectivity)
