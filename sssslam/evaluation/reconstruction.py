"""How well a submap or a map has the shape of the true seafloor."""

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from scipy.ndimage import gaussian_filter, uniform_filter

from frontend.arrays import BoolArray, FloatArray
from frontend.frames import level, transform
from frontend.heightfield import Heightfield
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.evaluation.association import interpolate, is_covered
from sssslam.evaluation.metric import Metric, root_mean_square

_MIN_CELLS = 100  # with fewer, an error or a correlation is chance
_NORMAL_95 = 1.959964  # of a standard normal, 95 % lie within


@dataclass(frozen=True)
class HeightErrors:
    """Errors of heights against the truth, with less and less of what the sonar cannot know.

    Parameters
    ----------
    rmse : float
        Root mean square [m].
    rmse_without_mean, rmse_without_plane : float
        The same after the mean error, and the best plane through the errors, is taken out [m].
    correlation_20m, correlation_10m : float
        Correlation of the heights after removing what is smoother than 20 and 10 m.
    slope_correlation_along, slope_correlation_across : float
        Correlation of the slopes along x and along y: of a submap along and across the track.
    z_score : float
        Root mean square of the errors over their sigmas; 1 is right.
    coverage_95 : float
        Share of the cells whose error is below 1.96 sigma [%]; 95 is right.
    """

    rmse: float
    rmse_without_mean: float
    rmse_without_plane: float
    correlation_20m: float
    correlation_10m: float
    slope_correlation_along: float
    slope_correlation_across: float
    z_score: float
    coverage_95: float


_UNITS = {"rmse": "m", "rmse_without_mean": "m", "rmse_without_plane": "m", "coverage_95": "%"}


def compare_heights(surface: Heightfield, sigma: FloatArray, z_true: FloatArray) -> HeightErrors:
    """Compare heights with the truth on the same cells.

    Parameters
    ----------
    surface : Heightfield
        Heights [m]; NaN where unknown.
    sigma : ndarray, shape (n_y, n_x)
        Their standard deviations [m].
    z_true : ndarray, shape (n_y, n_x)
        True heights [m]; NaN where unknown.

    Returns
    -------
    errors : HeightErrors
        Over the cells that both know; NaN where they are fewer than a hundred.
    """
    known = np.isfinite(surface.z) & np.isfinite(z_true)
    if np.count_nonzero(known) < _MIN_CELLS:
        return HeightErrors(*[float("nan")] * len(fields(HeightErrors)))
    z, z_ref = (np.where(known, values, np.nan) for values in (surface.z, z_true))
    error = z - z_ref
    scores = (error / np.where(sigma > 0, sigma, np.nan))[known]
    scores = scores[np.isfinite(scores)]
    slopes, slopes_ref = (np.gradient(values, surface.spacing) for values in (z, z_ref))
    cells = [high_pass(values, wavelength / surface.spacing) for wavelength in (20.0, 10.0) for values in (z, z_ref)]
    return HeightErrors(
        rmse=root_mean_square(error[known]),
        rmse_without_mean=float(np.std(error[known])),
        rmse_without_plane=root_mean_square(_without_plane(error, known)),
        correlation_20m=_correlation(cells[0], cells[1]),
        correlation_10m=_correlation(cells[2], cells[3]),
        slope_correlation_along=_correlation(slopes[1], slopes_ref[1]),
        slope_correlation_across=_correlation(slopes[0], slopes_ref[0]),
        z_score=root_mean_square(scores),
        coverage_95=100.0 * float(np.mean(np.abs(scores) <= _NORMAL_95)) if scores.size else float("nan"),
    )


def high_pass(z: FloatArray, wavelength: float) -> FloatArray:
    """Remove what is smoother than a wavelength, with unknown cells left out of the mean.

    Parameters
    ----------
    z : ndarray, shape (n_y, n_x)
        Heights [m]; NaN where unknown.
    wavelength : float
        The wavelength of which half the amplitude is kept [cells].

    Returns
    -------
    residual : ndarray, shape (n_y, n_x)
        Heights less their Gaussian mean [m].

    Notes
    -----
    A Gaussian of standard deviation ``s`` keeps ``exp(-2 pi**2 s**2 / wavelength**2)`` of a wave's amplitude: one half
    for ``s = wavelength sqrt(ln(2) / 2) / pi``.
    """
    known = np.isfinite(z)
    sd = wavelength * np.sqrt(np.log(2.0) / 2.0) / np.pi
    total, weight = (gaussian_filter(values, sd, mode="constant") for values in (np.where(known, z, 0.0), known * 1.0))
    return np.asarray(np.where(known, z - total / np.where(known, weight, 1.0), np.nan))


def _without_plane(error: FloatArray, known: BoolArray) -> FloatArray:
    rows, columns = np.nonzero(known)
    plane = np.column_stack([rows - rows.mean(), columns - columns.mean(), np.ones(rows.size)])
    return np.asarray(error[known] - plane @ np.linalg.lstsq(plane, error[known], rcond=None)[0])


def _correlation(a: FloatArray, b: FloatArray) -> float:
    known = np.isfinite(a) & np.isfinite(b)
    if np.count_nonzero(known) < _MIN_CELLS or np.ptp(a[known]) == 0 or np.ptp(b[known]) == 0:
        return float("nan")
    return float(np.corrcoef(a[known], b[known])[0, 1])


def true_heights(submap: Submap, trajectory_ref: Trajectory, terrain: Heightfield) -> FloatArray:
    """True heights of a submap's cells in its frame, at the true pose of its anchor.

    Parameters
    ----------
    submap : Submap
        The submap.
    trajectory_ref : Trajectory
        The reference; it must cover the anchor.
    terrain : Heightfield
        True heights in the world frame [m].

    Returns
    -------
    z_true : ndarray, shape (n_y, n_x)
        Heights [m]; NaN where the terrain has none.
    """
    surface = submap.surface
    T_world_submap_ref = level(interpolate(trajectory_ref, [submap.anchor_time]).poses[0])
    points = np.stack([*np.meshgrid(surface.x, surface.y), np.zeros(surface.z.shape)], axis=-1)
    x, y, z = np.moveaxis(transform(T_world_submap_ref, points), -1, 0)
    return np.asarray(terrain.sample(x, y) - z)


def averaged(terrain: Heightfield, spacing: float) -> Heightfield:
    """A terrain averaged over cells of another grid, where it is at least twice as fine.

    Parameters
    ----------
    terrain : Heightfield
        The terrain.
    spacing : float
        Size of the cells [m].

    Returns
    -------
    smoothed : Heightfield
        On the terrain's own grid; unknown cells and their neighbours are unknown.
    """
    n = int(spacing / terrain.spacing)
    if n < 2:
        return terrain
    known = np.isfinite(terrain.z)
    z = uniform_filter(np.where(known, terrain.z, 0.0), n, mode="nearest")
    share = uniform_filter(known * 1.0, n, mode="nearest")
    return Heightfield(np.where(share > 1.0 - 1e-9, z, np.nan), terrain.spacing, terrain.origin)


def evaluate_submaps(submaps: Iterable[Submap], trajectory_ref: Trajectory, terrain: Heightfield) -> list[Metric]:
    """Shape of the submaps, freed of the error of the track: each is judged at the true pose of its anchor.

    Parameters
    ----------
    submaps : iterable of Submap
        The submaps.
    trajectory_ref : Trajectory
        The reference.
    terrain : Heightfield
        True heights in the world frame [m].

    Returns
    -------
    metrics : list of Metric
        Medians over the submaps whose anchor the reference covers; cells in shadow do not count.
    """
    fine = None
    rows: list[HeightErrors] = []
    for submap in submaps:
        if is_covered(trajectory_ref, [submap.anchor_time]).all():
            fine = fine or averaged(terrain, submap.surface.spacing)
            z_true = np.where(submap.is_shadow, np.nan, true_heights(submap, trajectory_ref, fine))
            rows.append(compare_heights(submap.surface, submap.sigma, z_true))
    how = f"median over {len(rows)} submaps at their true poses, without shadow"
    return [
        _metric(f"submap_{f.name}", _median([getattr(row, f.name) for row in rows]), how) for f in fields(HeightErrors)
    ]


def evaluate_map(seafloor: Heightfield, sigma: FloatArray, terrain: Heightfield) -> list[Metric]:
    """Shape and place of the map.

    Parameters
    ----------
    seafloor : Heightfield
        Heights of the map in the world frame [m].
    sigma : ndarray, shape (n_y, n_x)
        Their standard deviations [m].
    terrain : Heightfield
        True heights in the world frame [m].

    Returns
    -------
    metrics : list of Metric
        Over all cells that both know.

    Raises
    ------
    ValueError
        If the terrain does not lie under the map.
    """
    z_true = averaged(terrain, seafloor.spacing).sample(*np.meshgrid(seafloor.x, seafloor.y))
    known = np.isfinite(seafloor.z) & np.isfinite(z_true)
    if np.isfinite(seafloor.z).any() and not known.any():
        raise ValueError(f"the terrain must lie under the map in {_range(seafloor)}, it covers {_range(terrain)}")
    how = f"against the terrain where both are known, {np.count_nonzero(known)} cells of {seafloor.spacing:g} m"
    errors = compare_heights(seafloor, sigma, z_true)
    return [_metric(f"map_{f.name}", getattr(errors, f.name), how) for f in fields(HeightErrors)]


def _range(grid: Heightfield) -> str:
    return f"x {grid.x[0]:.0f} to {grid.x[-1]:.0f}, y {grid.y[0]:.0f} to {grid.y[-1]:.0f} m"


def _median(values: list[float]) -> float:
    known = [value for value in values if np.isfinite(value)]
    return float(np.median(known)) if known else float("nan")


def _metric(name: str, value: float, how: str) -> Metric:
    what = name.split("_", 1)[1]
    axes = {"slope_correlation_along": "along x, ", "slope_correlation_across": "along y, "}
    return Metric(name, value, _UNITS.get(what, ""), f"{axes.get(what, '')}{how}")
