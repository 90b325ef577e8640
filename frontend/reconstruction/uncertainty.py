"""How far a window's heights may be off: draws from the posterior, with the long waves that a window cannot tell."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import gaussian_filter, map_coordinates

from frontend.arrays import FloatArray
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.priors import relief_spectrum, wavenumbers
from frontend.reconstruction.solver import Solution, SolverConfig, solve

_PATIENCE, _TOLERANCE = 2, 1e-3  # products against a step's, and what is left: long waves converge last
_LEAST = 1e-3  # metres


class SigmaConfig(BaseModel):
    """How sigma is found."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    n_draws: int = Field(
        default=6, ge=2, description="Draws [1] from the posterior; smoothed over cells, a few are enough."
    )
    longest: float = Field(
        default=1000.0,
        gt=0,
        description="Wavelength beyond which relief grows no more [m]; what tilts a window is longer than it.",
    )
    factor: float = Field(
        default=1.3, gt=0, description="Sigma against that of the draws [1]; by simulation: the model is not the sea."
    )


def height_sigma(
    levels: Sequence[tuple[Posterior, Solution]], config: SigmaConfig, solver: SolverConfig, rng: np.random.Generator
) -> FloatArray:
    """Standard deviation of the heights of a window.

    Parameters
    ----------
    levels : sequence of (Posterior, Solution)
        One pair a resolution, the finest last.
    config : SigmaConfig
        How it is found.
    solver : SolverConfig
        When a linear solve ends.
    rng : Generator
        For the draws.

    Returns
    -------
    sigma : ndarray, shape of the finest raster
        Standard deviations [m].

    Notes
    -----
    Nearly all of the error is in waves as long as the swath, which the coarsest resolution shows: there the smooth
    relief is drawn. The method itself believes in no wave longer than its prior's ``longest``, for none would be told
    from the beam pattern; here they count, so sigma grows away from the track as a tilt does. An object is as
    uncertain as it is high.
    """
    (coarse, first), (fine, last) = levels[0], levels[-1]
    equations = _with_long_waves(coarse, config.longest).curvature(first.x, first.mu)
    patient = solver.model_copy(update={"n_products": _PATIENCE * solver.n_products, "tolerance": _TOLERANCE})
    draws = (solve(equations, equations.draw(rng), patient).from_coordinates() for _ in range(config.n_draws))
    smooth = gaussian_filter(np.mean([draw.background**2 for draw in draws], axis=0), 2.0)
    variance = config.factor**2 * resample(smooth, coarse.raster, fine.raster)
    return np.sqrt(np.maximum(variance + gaussian_filter(last.x.objects**2, 2.0), _LEAST**2))


def resample(values: FloatArray, old: Raster, new: Raster) -> FloatArray:
    """Interpolate a raster on another grid.

    Parameters
    ----------
    values : ndarray, shape of old
        Values at cell centres.
    old, new : Raster
        From where, to where.

    Returns
    -------
    resampled : ndarray, shape of new
        Cubic between the old cells, the edge's value beyond.
    """
    y = (new.origin[1] + new.spacing * np.arange(new.n_y) - old.origin[1]) / old.spacing
    x = (new.origin[0] + new.spacing * np.arange(new.n_x) - old.origin[0]) / old.spacing
    return np.asarray(map_coordinates(values, np.meshgrid(y, x, indexing="ij"), order=3, mode="nearest"))


def _with_long_waves(posterior: Posterior, longest: float) -> Posterior:
    """The same posterior, relief growing up to another wavelength."""
    k2 = np.add(*wavenumbers(posterior.raster))
    less = relief_spectrum(k2, 1.0, posterior.prior.longest) / relief_spectrum(k2, 1.0, longest)
    return replace(posterior, prior=replace(posterior.prior, background=posterior.prior.background * less))
