"""Search: where inside the gate of a prior two reliefs correlate."""

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.chance import significance
from frontend.correlation import CorrelationSurface, correlate, padded_shape, spectra
from frontend.frames import planar_pose
from frontend.priors import Prior
from frontend.relief import Relief, coarsen
from frontend.sampling import sample_rasters
from frontend.verification import joint_area


class SearchConfig(BaseModel):
    """How the gate of a prior is searched."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    search_spacing: float = Field(
        default=2.0, gt=0, description="Cell of the search over shifts [m]; half the shortest relief wave."
    )
    yaw_step: float = Field(
        default=0.035, gt=0, description="Step of the search over yaw [rad]: 2 m at the edge of a submap."
    )
    min_overlap: float = Field(
        default=0.25, gt=0, le=1, description="Share of the smaller submap [1] below which chance correlates well."
    )
    separation: float = Field(
        default=8.0, gt=0, description="Peaks closer than this [m] are one: the width of a peak of correlation."
    )
    n_peaks: int = Field(default=3, ge=2, description="Peaks handed on [1]; two show whether the first is alone.")


@dataclass(frozen=True)
class Peak:
    """A place where two reliefs correlate.

    Parameters
    ----------
    T_target_source : ndarray, shape (4, 4)
        Level: yaw and shift, to a search cell.
    significance : float
        Standard deviations above chance [1].
    correlation : float
        Masked normalised cross-correlation [1].
    """

    T_target_source: FloatArray
    significance: float
    correlation: float


@dataclass(frozen=True)
class _Turned:
    """A source's relief and weight on a grid along the target's axes, and the yaw that brought it there."""

    z: FloatArray
    weight: FloatArray
    origin: tuple[float, float]
    yaw: float


def propose(target: Relief, source: Relief, prior: Prior, config: SearchConfig | None = None) -> list[Peak]:
    """Search the gate of a prior for places where two reliefs correlate.

    Parameters
    ----------
    target, source : Relief
        The two submaps.
    prior : Prior
        Predicted transform with covariance.
    config : SearchConfig, optional
        Steps of the search.

    Returns
    -------
    peaks : list of Peak
        Distinct maxima inside the gate whose overlap suffices, the most significant first.
    """
    config = config or SearchConfig()
    least = config.min_overlap * min(target.area, source.area)
    area = joint_area(target, source)
    target, source = coarsen(target, config.search_spacing), coarsen(source, config.search_spacing)
    yaws = prior.planar[2] + _offsets(min(prior.n_sigmas * prior.sigma_yaw, np.pi), config.yaw_step)
    turned = [_turn(source, float(yaw)) for yaw in yaws]
    padded = padded_shape(target.z.shape, tuple(max(sizes) for sizes in zip(*(t.z.shape for t in turned), strict=True)))
    target_spectra = spectra(target.z, target.weight, padded)
    rows = []
    for t in turned:
        surface = correlate(target_spectra, spectra(t.z, t.weight, padded))
        found = _poses(surface, t, target, least)
        found = found[prior.squared_distance(*found[:, 2:].T) <= prior.limit]
        rows.append(np.column_stack([significance(found[:, 0], found[:, 1], area), found]))
    return _peaks(np.concatenate(rows), config)


def _poses(surface: CorrelationSurface, turned: _Turned, target: Relief, least: float) -> FloatArray:
    """Correlation, overlap [m^2], x, y [m] and yaw [rad] of every shift that overlaps enough, shape (S, 5)."""
    area = surface.overlap * target.spacing**2
    i, j = np.nonzero(area >= least)
    x = target.origin[0] - turned.origin[0] + target.spacing * surface.shift_x[j]
    y = target.origin[1] - turned.origin[1] + target.spacing * surface.shift_y[i]
    return np.column_stack([surface.correlation[i, j], area[i, j], x, y, np.full(len(i), turned.yaw)])


def _offsets(reach: float, step: float) -> FloatArray:
    """Symmetric steps over plus and minus the reach, 0 among them."""
    n = int(np.ceil(reach / step))
    return np.linspace(-reach, reach, 2 * n + 1) if n else np.zeros(1)


def _turn(relief: Relief, yaw: float) -> _Turned:
    """Turn a relief about its frame's origin and sample it along the new axes."""
    (n_y, n_x), spacing = relief.z.shape, relief.spacing
    columns, rows = np.meshgrid(np.array([0, n_x - 1]), np.array([0, n_y - 1]))
    corners = np.stack([columns, rows], axis=-1).reshape(-1, 2) * spacing + np.array(relief.origin)
    cosine, sine = np.cos(yaw), np.sin(yaw)
    corners = corners @ np.array([[cosine, sine], [-sine, cosine]])
    low, size = corners.min(axis=0), np.ceil(np.ptp(corners, axis=0) / spacing).astype(int) + 1
    grid = np.stack(np.meshgrid(*(low[k] + spacing * np.arange(size[k]) for k in (0, 1))), axis=-1)
    rasters = np.stack([relief.weight, relief.z], axis=-1)
    samples = sample_rasters(rasters, grid.reshape(-1, 2), (*relief.origin, spacing), (0.0, 0.0, -yaw))
    weight, z = samples.reshape(*grid.shape).transpose(2, 0, 1)
    return _Turned(z, weight, (float(low[0]), float(low[1])), yaw)


def _peaks(rows: FloatArray, config: SearchConfig) -> list[Peak]:
    """The highest rows that lie apart from all higher ones."""
    peaks: list[Peak] = []
    while len(rows) and len(peaks) < config.n_peaks:
        best = rows[np.argmax(rows[:, 0])]
        peaks.append(Peak(planar_pose(*best[3:]), float(best[0]), float(best[1])))
        rows = rows[np.hypot(rows[:, 3] - best[3], rows[:, 4] - best[4]) > config.separation]
    return peaks
