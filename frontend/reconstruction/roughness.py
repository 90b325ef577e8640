"""How rough one window is, wave by wave: the belief about its relief follows what first looks make of it."""

from dataclasses import dataclass, replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import gaussian_filter, map_coordinates

from frontend.arrays import FloatArray
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.solver import Solution, SolverConfig, minimise
from frontend.reconstruction.unknowns import to_cosine

_NO_OBJECTS = 1e-3  # of their height: for these looks there are no boulders, only relief that waves are to explain
_LOOK_STEPS = 2  # of a look, at most; the next look goes on from there


class RoughnessConfig(BaseModel):
    """How a window's belief in relief follows the window."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    n_rounds: int = Field(
        default=3, ge=0, description="First looks [1], each with the belief of the one before; 0 keeps the dive's."
    )
    evidence: float = Field(
        default=4.0, gt=0, description="Waves [1] that the dive's belief counts for against those of the window."
    )
    width: float = Field(
        default=3.0,
        gt=0,
        description="Half-waves a window [1] over which power is averaged; ripples and grooves have narrow spectra.",
    )
    least: float = Field(
        default=1.0, gt=0, le=1, description="No wave is believed weaker than this share of the dive's power [1]."
    )
    most: float = Field(default=1e3, ge=1, description="Nor stronger than so many times the dive's power [1].")


@dataclass(frozen=True)
class Roughness:
    """Power of a window's waves over what the dive lets expect.

    Parameters
    ----------
    raster : Raster
        The grid that the waves were told on.
    factor : ndarray, shape (n_y, n_x)
        Factor on the variance of each cosine coefficient [1].
    """

    raster: Raster
    factor: FloatArray

    def on(self, raster: Raster) -> FloatArray:
        """The same factors for another grid over the same ground.

        Parameters
        ----------
        raster : Raster
            The grid.

        Returns
        -------
        factor : ndarray, shape of raster
            Interpolated between waves; 1 for waves too short for the first grid.
        """
        old, new = self.raster, raster
        lengths = [(a * old.spacing) / (b * new.spacing) for a, b in zip(old.shape, new.shape, strict=True)]
        place = np.meshgrid(*(r * np.arange(n) for r, n in zip(lengths, new.shape, strict=True)), indexing="ij")
        return np.asarray(np.exp(map_coordinates(np.log(self.factor), place, order=1, mode="constant", cval=0.0)))


def learn_roughness(
    posterior: Posterior, config: RoughnessConfig, solver: SolverConfig, until: float = np.inf
) -> Roughness:
    """How strong the waves of a window are, by empirical Bayes.

    Parameters
    ----------
    posterior : Posterior
        The window with the dive's belief, at a resolution that shows the waves to be told.
    config : RoughnessConfig
        How far to follow the window.
    solver : SolverConfig
        When a look ends: after two steps at most, each with half the products, for spectra ask for less than shapes.
    until : float
        Time of the monotonic clock at which to stop [s].

    Returns
    -------
    roughness : Roughness
        Factors of one, had there been no look.

    Notes
    -----
    Objects are left out of these looks, or their heavy tails would take sand waves for boulders side by side. A
    wave's variance follows MacKay [1]_: the squares of the coefficients over the number of them that the data have
    told, ``sum(c^2 / s^2) / sum(gain)``, here summed over neighbouring wavelengths and directions, with some waves of
    the dive's belief added to both. Where the data tell nothing, both sums vanish and the dive's belief stays.

    References
    ----------
    .. [1] MacKay, "Bayesian Interpolation", Neural Computation 4(3):415-447, 1992.
       :doi:`10.1162/neco.1992.4.3.415`
    """
    prior = replace(posterior.prior, object_height=_NO_OBJECTS * posterior.prior.object_height)
    first = looking = replace(posterior, prior=prior)
    roughness, x = Roughness(posterior.raster, np.ones(posterior.raster.shape)), posterior.origin()
    brief = {"n_steps": min(_LOOK_STEPS, solver.n_steps), "n_products": max(1, solver.n_products // 2)}
    look = solver.model_copy(update=brief)
    for _ in range(config.n_rounds):
        solution = minimise(looking, x, look, until)
        roughness = Roughness(posterior.raster, _power(looking, solution, prior.background, config))
        looking, x = believing(first, roughness), solution.x
    return roughness


def believing(posterior: Posterior, roughness: Roughness) -> Posterior:
    """A posterior whose belief in relief is so many times that of the dive.

    Parameters
    ----------
    posterior : Posterior
        With the dive's belief, on any grid over the window.
    roughness : Roughness
        The factors.

    Returns
    -------
    posterior : Posterior
        The same with another prior.
    """
    background = posterior.prior.background / roughness.on(posterior.raster)
    return replace(posterior, prior=replace(posterior.prior, background=background))


def _power(posterior: Posterior, solution: Solution, precision: FloatArray, config: RoughnessConfig) -> FloatArray:
    """Factors on the dive's variances; ``precision`` is the dive's."""
    squares = precision * to_cosine(solution.x.background) ** 2
    told = posterior.curvature(solution.x, solution.mu).background_gain
    over, of = (_around(values, config.width) for values in (squares, told))
    return np.asarray(np.clip((config.evidence + over) / (config.evidence + of), config.least, config.most))


def _around(values: FloatArray, width: float) -> FloatArray:
    """Sums over neighbouring coefficients, the middle one counting once."""
    return np.asarray(2 * np.pi * width**2 * gaussian_filter(values, width, mode="reflect", truncate=3.0))
