"""Random fields on a terrain's grid, and what every layer of a terrain is."""

from typing import Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict
from scipy.fft import irfft2, rfft2

from frontend.arrays import FloatArray

Surface = tuple[FloatArray, FloatArray]
"""Heights [m] and log-reflectivity of a layer, each (n_y, n_x)."""


class GridLike(Protocol):
    """What a layer needs to know of the terrain's grid."""

    @property
    def x(self) -> FloatArray:
        """Shape (n_x,) [m]."""

    @property
    def y(self) -> FloatArray:
        """Shape (n_y,) [m]."""

    @property
    def spacing(self) -> float:
        """Distance between cell centres [m]."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows along y, columns along x."""


class TerrainLayer(BaseModel):
    """One ingredient of a seafloor."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """What the layer adds.

        Parameters
        ----------
        grid : GridLike
            Cell centres of the terrain.
        rng : Generator
            Source of randomness.

        Returns
        -------
        heights, log_reflectivity : ndarray, shape (n_y, n_x)
            To add to the terrain's [m], [1].
        """
        raise NotImplementedError


def random_field(grid: GridLike, spectrum: tuple[float, float, float], rng: np.random.Generator) -> FloatArray:
    """Make a Gaussian field of zero mean and unit standard deviation whose power falls as a power law.

    Parameters
    ----------
    grid : GridLike
        Where the field is wanted.
    spectrum : tuple of float
        Exponent of the two-dimensional power spectral density, longest and shortest wavelength [m].
    rng : Generator
        Source of randomness.

    Returns
    -------
    field : ndarray, shape (n_y, n_x)
        The field; periodic over the grid.
    """
    exponent, longest, shortest = spectrum
    n_y, n_x = grid.shape
    k = np.hypot(np.fft.fftfreq(n_y, grid.spacing)[:, None], np.fft.rfftfreq(n_x, grid.spacing)[None, :])
    amplitude = np.maximum(k, 1.0 / longest) ** (-0.5 * exponent)
    amplitude[0, 0] = 0.0
    if shortest > 0:
        amplitude[k > 1.0 / shortest] = 0.0
    field = irfft2(rfft2(rng.standard_normal(grid.shape)) * amplitude, s=grid.shape)
    deviation = field.std()
    if not deviation > 1e-9 * np.abs(amplitude).max():
        raise ValueError(f"no wavelength from {shortest} to {longest} m fits {n_x} x {n_y} cells of {grid.spacing} m")
    return np.asarray(field / deviation)


def turned(grid: GridLike, azimuth: float) -> tuple[FloatArray, FloatArray]:
    """Coordinates of the cells along and across a direction.

    Parameters
    ----------
    grid : GridLike
        Cell centres.
    azimuth : float
        The direction, clockwise from north [rad].

    Returns
    -------
    along, across : ndarray, shape (n_y, n_x)
        Distance from the world's origin along it, and to its right [m].
    """
    x, y = grid.x[None, :], grid.y[:, None]
    sine, cosine = np.sin(azimuth), np.cos(azimuth)
    return np.asarray(x * sine + y * cosine), np.asarray(x * cosine - y * sine)
