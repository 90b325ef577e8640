"""Two submaps laid over each other at a given transform: the cells that both know, sampled in pairs."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from frontend.arrays import FloatArray
from frontend.relief import Relief
from frontend.sampling import correlations, samples_that_meet


@dataclass(frozen=True)
class Overlap:
    """Pairs of samples, one a source cell that falls on trusted target cells.

    Parameters
    ----------
    x, y : ndarray, shape (K,)
        Positions in the source frame [m].
    weight : ndarray, shape (K,)
        Product of both weights [1].
    z_source, z_target : ndarray, shape (K,)
        Relief [m].
    slope_source, slope_target : ndarray, shape (K, 2)
        Gradient of each relief along x and y of its own frame [1].
    height_source, height_target : ndarray, shape (K,)
        Heights, each in its own frame [m].
    sigma : ndarray, shape (K,)
        Standard deviation of the height difference [m].
    reflectivity_source, reflectivity_target : ndarray, shape (K,)
        Band-passed log-reflectivity [1].
    share : float
        Overlap over the smaller of the two trusted areas [1].
    area : float
        Area of the overlap [m^2].
    """

    x: FloatArray
    y: FloatArray
    weight: FloatArray
    z_source: FloatArray
    z_target: FloatArray
    slope_source: FloatArray
    slope_target: FloatArray
    height_source: FloatArray
    height_target: FloatArray
    sigma: FloatArray
    reflectivity_source: FloatArray
    reflectivity_target: FloatArray
    share: float
    area: float

    @cached_property
    def correlation(self) -> float:
        """Weighted correlation of the two reliefs [1]; 0 where nothing varies."""
        return weighted_correlation(self.z_source, self.z_target, self.weight)

    @property
    def concentration(self) -> float:
        """How many times fewer pieces of relief the correlation is worth than on a Gaussian floor [1]."""
        aa, bb = self.z_target**2, self.z_source**2
        total, squares = float(self.weight.sum()), float(np.sum(self.weight * aa) * np.sum(self.weight * bb))
        coincidence = total * float(np.sum(self.weight * aa * bb)) / squares if squares > 0 else 0.0
        return concentration(coincidence, self.correlation)

    @property
    def reflectivity_correlation(self) -> float:
        """Weighted correlation of the two reflectivities [1]; 0 where nothing varies."""
        return weighted_correlation(self.reflectivity_source, self.reflectivity_target, self.weight)

    @property
    def middle(self) -> FloatArray:
        """Shape (2,): weighted mean position in the source frame [m]; its origin where nothing overlaps."""
        total = float(self.weight.sum())
        return np.array([np.sum(self.weight * a) for a in (self.x, self.y)]) / total if total > 0 else np.zeros(2)


@dataclass(frozen=True)
class Layers:
    """A submap's rasters stacked for sampling as a target, and its trusted cells listed for use as a source.

    Parameters
    ----------
    rasters : ndarray, shape (n_y, n_x, 7)
        Weight, relief, its two slopes, height, sigma and reflectivity.
    cells : ndarray, shape (K, 9)
        x and y [m] of the trusted cells and their rasters.
    relief : Relief
        Where they come from.
    """

    rasters: FloatArray
    cells: FloatArray
    relief: Relief

    @cached_property
    def shape(self) -> FloatArray:
        """Shape (n_y, n_x, 4): weight, relief and its slopes, which is all that alignment looks at."""
        return np.ascontiguousarray(self.rasters[..., :4])

    @cached_property
    def shape_cells(self) -> FloatArray:
        """Shape (K, 6): x, y, weight, relief and its slopes of the trusted cells."""
        return np.ascontiguousarray(self.cells[:, :6])

    @cached_property
    def witnesses(self) -> FloatArray:
        """Shape (n_y, n_x, 3): weight, relief and reflectivity."""
        return np.ascontiguousarray(self.rasters[..., [0, 1, 6]])

    @cached_property
    def witness_cells(self) -> FloatArray:
        """Shape (K, 5): x, y, weight, relief and reflectivity of the trusted cells."""
        return np.ascontiguousarray(self.cells[:, [0, 1, 2, 3, 8]])

    @cached_property
    def thinned_cells(self) -> FloatArray:
        """Shape (K, 6): of `shape_cells` those of every second row and column."""
        rows, columns = np.nonzero(self.relief.is_trusted)
        return np.ascontiguousarray(self.shape_cells[(rows % 2 == 0) & (columns % 2 == 0)])


def stack_layers(relief: Relief) -> Layers:
    """Prepare a relief for `lay_over`.

    Parameters
    ----------
    relief : Relief
        The rasters of a submap.

    Returns
    -------
    layers : Layers
        The same rasters in the order that sampling wants.
    """
    slope_y, slope_x = np.gradient(relief.z, relief.spacing)
    rasters = np.stack(
        [relief.weight, relief.z, slope_x, slope_y, relief.height, relief.sigma, relief.reflectivity], axis=-1
    )
    rows, columns = np.nonzero(relief.is_trusted)
    x, y = relief.origin[0] + relief.spacing * columns, relief.origin[1] + relief.spacing * rows
    return Layers(rasters, np.column_stack([x, y, rasters[rows, columns]]), relief)


def lay_over(target: Layers, source: Layers, planar: tuple[float, float, float]) -> Overlap:
    """Sample a target at the cells of a source.

    Parameters
    ----------
    target, source : Layers
        The two submaps.
    planar : tuple of float
        x, y [m] and yaw [rad] of ``T_target_source``.

    Returns
    -------
    overlap : Overlap
        Pairs of samples; bilinear in the target, where all four cells around are trusted.
    """
    frame = (*target.relief.origin, target.relief.spacing)
    a, which = samples_that_meet(target.rasters, source.cells, frame, planar)
    b = source.cells[which]
    area = len(b) * source.relief.spacing**2
    smaller = min(target.relief.area, source.relief.area)
    return Overlap(
        x=b[:, 0],
        y=b[:, 1],
        weight=a[:, 0] * b[:, 2],
        z_source=b[:, 3],
        z_target=a[:, 1],
        slope_source=b[:, 4:6],
        slope_target=a[:, 2:4],
        height_source=b[:, 6],
        height_target=a[:, 4],
        sigma=np.hypot(a[:, 5], b[:, 7]),
        reflectivity_source=b[:, 8],
        reflectivity_target=a[:, 6],
        share=min(area / smaller, 1.0) if smaller > 0 else 0.0,
        area=area,
    )


def correlate_at(
    target: Layers, source: Layers, planar: tuple[float, float, float]
) -> tuple[float, float, float, float]:
    """Correlation of two reliefs and of their reflectivities at a transform, and nothing else of `lay_over`.

    Parameters
    ----------
    target, source : Layers
        The two submaps.
    planar : tuple of float
        x, y [m] and yaw [rad] of ``T_target_source``.

    Returns
    -------
    by_shape, by_echo, concentration, area : float
        Both correlations [1], the `concentration` of the reliefs' [1], and the area [m^2] of the overlap.
    """
    frame = (*target.relief.origin, target.relief.spacing)
    found, coincidences, n_cells = correlations(target.witnesses, source.witness_cells, frame, planar)
    by_shape, by_echo = (float(a) for a in found)
    return by_shape, by_echo, concentration(float(coincidences[0]), by_shape), n_cells * source.relief.spacing**2


def concentration(coincidence: float, correlation: float) -> float:
    """How many times fewer independent pieces of relief a correlation is worth than on a Gaussian floor.

    Parameters
    ----------
    coincidence : float
        Mean product of the squares of both reliefs over the product of their mean squares [1].
    correlation : float
        Of the two [1].

    Returns
    -------
    concentration : float
        Square root of the coincidence over that of Gaussian reliefs, ``1 + 2 correlation^2`` (Isserlis); at least 1.

    Notes
    -----
    The sum of products is carried by as many equal pieces as ``(sum a^2) (sum b^2) / sum a^2 b^2`` says: a few boulders
    that coincide are few pieces, however large the floor between them. But by chance they seldom coincide: the variance
    of a correlation stays one over all pieces, only its tails grow. So what is counted is the geometric mean of the
    pieces by area and of those that carry it; on simulated boulders the one finds places that are not, the other loses
    places.
    """
    return float(np.sqrt(max(coincidence / (1 + 2 * correlation**2), 1.0)))


def weighted_correlation(a: FloatArray, b: FloatArray, weight: FloatArray) -> float:
    """Correlation coefficient of two weighted samples.

    Parameters
    ----------
    a, b, weight : ndarray, shape (K,)
        The samples and their weights.

    Returns
    -------
    correlation : float
        In [-1, 1]; 0 where either sample is constant or empty.
    """
    total = float(weight.sum())
    if not total > 0:
        return 0.0
    a, b = a - np.sum(weight * a) / total, b - np.sum(weight * b) / total
    scale = float(np.sqrt(np.sum(weight * a**2) * np.sum(weight * b**2)))
    return float(np.clip(np.sum(weight * a * b) / scale, -1.0, 1.0)) if scale > 1e-12 * total else 0.0
