"""What is believed of a window before it is seen: a smooth seafloor, a few objects on it, patches, a steady sonar."""

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.radiometry import Seafloor, Tables
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.unknowns import Unknowns, to_cosine


class PriorConfig(BaseModel):
    """How rough and patchy a seafloor may be, what may stand on it, and how steady the sonar is."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    roughness: float = Field(
        default=1.0, gt=0, description="Spectrum of the smooth relief against what the dive's echoes show [1]."
    )
    least_roughness: float = Field(
        default=2e-3,
        gt=0,
        description="No floor is believed smoother than this spectrum [1]; elsewhere it may be rougher.",
    )
    longest: float = Field(
        default=100.0,
        gt=0,
        description="Wavelength beyond which relief grows no more [m]; a window sees little of longer.",
    )
    reflectivity: float = Field(
        default=1.0, gt=0, description="Contrast of the reflectivity against what the dive's echoes show [1]."
    )
    object_height: float = Field(
        default=0.05,
        gt=0,
        description="Height of an object that is nothing special [cells]; more costs little more.",
    )
    object_weight: float = Field(
        default=0.5, gt=0, description="Cost of a tenfold higher object, over ln 10 [1]; few cells hold any."
    )
    beam: float = Field(
        default=0.05,
        gt=0,
        description="Standard deviation [1] of a window's log beam pattern from the dive's.",
    )
    beam_length: float = Field(
        default=0.07, gt=0, description="Angle over which that changes [rad]; patterns are smooth."
    )
    gain: float = Field(
        default=0.02, gt=0, description="Standard deviation [1] of a line's log gain; bubbles and power supplies."
    )


@dataclass(frozen=True)
class Prior:
    """Precisions of the unknowns.

    Parameters
    ----------
    background, reflectivity : ndarray, shape (n_y, n_x)
        Diagonal precisions in the orthonormal cosine basis.
    longest : float
        Wavelength beyond which relief grows no more [m].
    object_height : float
        Scale of the heavy-tailed belief about each cell's object [m].
    object_weight : float
        Its weight; ``weight / 2 * log(1 + (height / scale)^2)`` is its cost.
    beam : ndarray, shape (K, K)
        Precision of the beam pattern's deviation, the same for both sides.
    gain : float
        Precision of a line's log gain.
    """

    background: FloatArray
    reflectivity: FloatArray
    longest: float
    object_height: float
    object_weight: float
    beam: FloatArray
    gain: float

    def cost(self, x: Unknowns) -> float:
        """Negative logarithm of the prior, up to a constant.

        Parameters
        ----------
        x : Unknowns
            A point, as rasters.

        Returns
        -------
        cost : float
            Zero at the origin.
        """
        objects = 0.5 * self.object_weight * np.log1p((x.objects / self.object_height) ** 2).sum()
        squares = (self.background * to_cosine(x.background) ** 2).sum()
        squares += (self.reflectivity * to_cosine(x.log_reflectivity) ** 2).sum()
        squares += (x.beam * (x.beam @ self.beam)).sum() + self.gain * (x.gain**2).sum()
        return float(objects + 0.5 * squares)

    def gradient(self, x: Unknowns) -> Unknowns:
        """Gradient of the cost.

        Parameters
        ----------
        x : Unknowns
            A point, as rasters.

        Returns
        -------
        gradient : Unknowns
            As rasters.
        """
        return self.multiply(x.to_coordinates(), self.object_precision(x.objects)).from_coordinates()

    def object_precision(self, objects: FloatArray) -> FloatArray:
        """Precision of the Gaussian that touches the heavy-tailed belief from above at some heights.

        Parameters
        ----------
        objects : ndarray, shape (n_y, n_x)
            Heights [m].

        Returns
        -------
        precision : ndarray, shape (n_y, n_x)
            The belief's weight where there is nothing, little on an object.
        """
        return np.asarray(self.object_weight / (self.object_height**2 + objects**2))

    def multiply(self, v: Unknowns, object_precision: FloatArray) -> Unknowns:
        """Precision times a direction.

        Parameters
        ----------
        v : Unknowns
            A direction, as coordinates.
        object_precision : ndarray, shape (n_y, n_x)
            From `object_precision`.

        Returns
        -------
        product : Unknowns
            As coordinates.
        """
        return Unknowns(
            self.background * v.background,
            object_precision * v.objects,
            self.reflectivity * v.log_reflectivity,
            v.beam @ self.beam,
            self.gain * v.gain,
        )

    def draw(self, object_precision: FloatArray, n_lines: int, rng: np.random.Generator) -> Unknowns:
        """A random direction whose covariance is the precision.

        Parameters
        ----------
        object_precision : ndarray, shape (n_y, n_x)
            From `object_precision`.
        n_lines : int
            Lines of the window.
        rng : Generator
            Source of randomness.

        Returns
        -------
        draw : Unknowns
            As coordinates.
        """
        rasters = [np.sqrt(p) for p in (self.background, object_precision, self.reflectivity)]
        background, objects, reflectivity = (root * rng.standard_normal(root.shape) for root in rasters)
        beam = rng.standard_normal((2, len(self.beam))) @ np.linalg.cholesky(self.beam).T
        gain = np.sqrt(self.gain) * rng.standard_normal((n_lines, 2))
        return Unknowns(background, objects, reflectivity, beam, gain)


def wavenumbers(raster: Raster) -> tuple[FloatArray, FloatArray]:
    """Squared discrete wavenumbers along y and x of the cosine basis.

    Parameters
    ----------
    raster : Raster
        The grid.

    Returns
    -------
    k2_y, k2_x : ndarray, shape (n_y, 1), (1, n_x)
        Eigenvalues of minus the second difference [1/m^2].
    """
    k2 = [(2 - 2 * np.cos(np.pi * np.arange(n) / n)) / raster.spacing**2 for n in raster.shape]
    return k2[0][:, None], k2[1][None, :]


def relief_spectrum(k2: FloatArray, roughness: float, longest: float) -> FloatArray:
    """Power spectral density of smooth relief.

    Parameters
    ----------
    k2 : ndarray
        Squared wavenumbers [1/m^2].
    roughness : float
        C [1].
    longest : float
        Wavelength beyond which it is flat [m].

    Returns
    -------
    density : ndarray
        ``C / (k^2 + k_0^2)^2`` [m^4].
    """
    return np.asarray(roughness / (k2 + (2 * np.pi / longest) ** 2) ** 2)


def reflectivity_spectrum(k2: FloatArray, deviation: float, length: float) -> FloatArray:
    """Power spectral density of log-reflectivity: Matern.

    Parameters
    ----------
    k2 : ndarray
        Squared wavenumbers [1/m^2].
    deviation : float
        Standard deviation s [1].
    length : float
        Correlation length l [m].

    Returns
    -------
    density : ndarray
        ``s^2 4 pi l^2 / (1 + k^2 l^2)^2`` [m^2].
    """
    return np.asarray(deviation**2 * 4 * np.pi * length**2 / (1 + k2 * length**2) ** 2)


def make_prior(raster: Raster, tables: Tables, seafloor: Seafloor, config: PriorConfig) -> Prior:
    """The prior on a grid; the same belief at every spacing.

    Parameters
    ----------
    raster : Raster
        The grid.
    tables : Tables
        Say where the knots of the beam pattern are.
    seafloor : Seafloor
        How rough and patchy the dive's floor is.
    config : PriorConfig
        The belief.

    Returns
    -------
    prior : Prior
        Precisions.
    """
    k2_y, k2_x = wavenumbers(raster)
    k2, area = k2_y + k2_x, raster.spacing**2
    deviation = config.reflectivity * seafloor.reflectivity
    angle = tables.angle_step * np.arange(tables.log_beam.shape[1])
    covariance = np.exp(-0.5 * ((angle[:, None] - angle) / config.beam_length) ** 2) + 1e-4 * np.eye(len(angle))
    return Prior(
        area / relief_spectrum(k2, max(config.roughness * seafloor.roughness, config.least_roughness), config.longest),
        area / reflectivity_spectrum(k2, deviation, seafloor.length),
        config.longest,
        config.object_height * raster.spacing,
        config.object_weight,
        np.asarray(np.linalg.inv(covariance) / config.beam**2),
        1.0 / config.gain**2,
    )
