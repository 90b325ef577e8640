"""The columns of the table."""

from dataclasses import asdict, dataclass, fields

import numpy as np
from fusion import Fused, Target

from frontend.arrays import FloatArray
from frontend.heightfield import Heightfield
from frontend.submaps import surface_normals
from sssslam.evaluation.reconstruction import compare_heights


@dataclass(frozen=True)
class Columns:
    """What is reported of one reconstruction; lengths [m], angles [deg], shares [%]."""

    rmse: float
    rmse_without_plane: float
    rmse_over_altitude: float
    rmse_without_plane_over_altitude: float
    rmse_over_relief: float
    correlation_20m: float
    correlation_10m: float
    slope_correlation_across: float
    slope_correlation_along: float
    normal_error: float
    z_score: float
    n_cells: int


def columns(fused: Fused, target: Target, altitude: float) -> Columns:
    """Judge heights in the world, x along the first pass, over cells truly seen: by two passes where there are two."""
    surface = fused.surface
    z_true = np.where(target.count >= min(2, int(target.count.max())), target.surface.z, np.nan)
    errors = compare_heights(surface, fused.sigma, z_true)
    known = np.isfinite(surface.z) & np.isfinite(z_true)
    relief = _relief(np.where(known, z_true, np.nan))
    return Columns(
        errors.rmse,
        errors.rmse_without_plane,
        100 * errors.rmse / altitude,
        100 * errors.rmse_without_plane / altitude,
        100 * errors.rmse_without_plane / relief,
        errors.correlation_20m,
        errors.correlation_10m,
        errors.slope_correlation_across,
        errors.slope_correlation_along,
        _normal_error(surface, z_true),
        errors.z_score,
        int(np.count_nonzero(known)),
    )


def names() -> list[str]:
    """Names of the columns."""
    return [field.name for field in fields(Columns)]


def as_row(found: Columns) -> dict[str, float]:
    """Columns by name."""
    return asdict(found)


def _relief(z: FloatArray) -> float:
    """Standard deviation of the true heights about their plane."""
    rows, columns_ = np.nonzero(np.isfinite(z))
    if rows.size < 3:
        return float("nan")
    plane = np.column_stack([rows, columns_, np.ones(rows.size)])
    heights = z[rows, columns_]
    return float(np.std(heights - plane @ np.linalg.lstsq(plane, heights, rcond=None)[0]))


def _normal_error(surface: Heightfield, z_true: FloatArray) -> float:
    """Mean angle between the normals [deg]."""
    known = np.isfinite(surface.z) & np.isfinite(z_true)
    both = (
        surface_normals(Heightfield(np.where(known, z, np.nan), surface.spacing, surface.origin))
        for z in (surface.z, z_true)
    )
    cosine = np.clip(np.einsum("yxi,yxi->yx", *both), -1.0, 1.0)
    return float(np.degrees(np.nanmean(np.arccos(cosine))))
