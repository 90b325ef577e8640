"""What is believed of a seafloor before it is seen: relief with a power-law spectrum, slowly varying reflectivity.

Both priors are quadratic and diagonal in the cosine basis, so they precondition the normal equations as well.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.fft import dctn, idctn

from frontend.arrays import FloatArray
from frontend.reconstruction.forward import Raster


class PriorConfig(BaseModel):
    """How rough a seafloor and how patchy its reflectivity may be."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    roughness: float = Field(
        default=0.1, gt=0, description="C of the relief spectrum C k^-4 [1]; 0.03 is 0.8 m rms below 100 m wavelength."
    )
    longest: float = Field(
        default=40.0,
        gt=0,
        description="Wavelength beyond which relief grows no more [m]; a window sees little of longer.",
    )
    reflectivity: float = Field(
        default=0.1, gt=0, description="Standard deviation of log-reflectivity [1]; sediments differ less."
    )
    reflectivity_length: float = Field(
        default=8.0, gt=0, description="Correlation length of reflectivity [m]; sediments change slowly."
    )


@dataclass(frozen=True)
class Prior:
    """Precisions of the cosine coefficients of heights and log-reflectivities.

    Parameters
    ----------
    height, reflectivity : ndarray, shape (n_y, n_x)
        Diagonal precisions in the orthonormal cosine basis.
    """

    height: FloatArray
    reflectivity: FloatArray

    @cached_property
    def precision(self) -> FloatArray:
        """Shape (2, n_y, n_x): both, as one array."""
        return np.stack([self.height, self.reflectivity])

    def apply(self, x: FloatArray) -> FloatArray:
        """Multiply with the precision.

        Parameters
        ----------
        x : ndarray, shape (2, n_y, n_x)
            Heights and log-reflectivities.

        Returns
        -------
        product : ndarray, shape (2, n_y, n_x)
            Precision times x; half its product with x is the prior's cost.
        """
        return from_cosine(self.precision * to_cosine(x))


def to_cosine(x: FloatArray) -> FloatArray:
    """Orthonormal cosine coefficients of rasters.

    Parameters
    ----------
    x : ndarray, shape (..., n_y, n_x)
        Rasters.

    Returns
    -------
    coefficients : ndarray, shape (..., n_y, n_x)
        Their coefficients.
    """
    return np.asarray(dctn(x, axes=(-2, -1), norm="ortho"))


def from_cosine(coefficients: FloatArray) -> FloatArray:
    """Rasters of orthonormal cosine coefficients.

    Parameters
    ----------
    coefficients : ndarray, shape (..., n_y, n_x)
        Coefficients.

    Returns
    -------
    x : ndarray, shape (..., n_y, n_x)
        The rasters.
    """
    return np.asarray(idctn(coefficients, axes=(-2, -1), norm="ortho"))


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


def make_prior(raster: Raster, config: PriorConfig) -> Prior:
    """The prior on a grid; the same belief at every spacing.

    Parameters
    ----------
    raster : Raster
        The grid.
    config : PriorConfig
        The belief.

    Returns
    -------
    prior : Prior
        Diagonal precisions.

    Notes
    -----
    Relief has the spectrum ``C / (k^2 + k_0^2)^2``: a power law down to the longest wavelength. Reflectivity has a
    Matern spectrum, ``s^2 4 pi l^2 / (1 + k^2 l^2)^2``.
    """
    k2_y, k2_x = wavenumbers(raster)
    k2, area = k2_y + k2_x, raster.spacing**2
    height = area * (k2 + (2 * np.pi / config.longest) ** 2) ** 2 / config.roughness
    length2 = config.reflectivity_length**2
    reflectivity = area * (1 + k2 * length2) ** 2 / (config.reflectivity**2 * 4 * np.pi * length2)
    return Prior(height, reflectivity)
