"""How rough and patchy a seafloor is, from the spectrum of its echoes: what the priors of a dive are made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize

from frontend.arrays import FloatArray
from frontend.radiometry import Seafloor
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.priors import reflectivity_spectrum, relief_spectrum, wavenumbers
from frontend.reconstruction.unknowns import to_cosine

_ALTITUDES = (1.5, 3.5)  # across-track distances looked at: slopes show there, and shadows are short
_SHORTEST = 4.0  # cells of the shortest wave looked at; below there is speckle
_CLIP = 2.5  # robust standard deviations: boulders and their shadows are no part of the smooth floor
_USUAL: FloatArray = np.log(
    np.array([3e-3, 0.2, 5.0, 1.0])
)  # roughness, reflectivity, length, noise over `Waves.noise`
_SPREAD = np.array([2.3, 0.7, 0.7, np.inf])  # of their logarithms from dive to dive
_STEPS = np.diag([2.0, 0.5, 0.5, 0.5])  # of the first simplex: the usual may be far from a dive's floor
_N_STARTS = 2  # a simplex may collapse on its way; the next starts where it ended


@dataclass(frozen=True)
class Waves:
    """Power of one image's waves.

    Parameters
    ----------
    power : ndarray, shape (K,)
        Squared cosine coefficients of the logarithmic image.
    k2_y, k2 : ndarray, shape (K,)
        Squared wavenumbers, across track and in all [1/m^2].
    sensitivity : float
        Mean squared derivative of the logarithmic echo by the slope across track [1].
    area : float
        Area of a cell [m^2].
    noise : float
        Mean power of waves too short for a floor to be told in them: one side may be louder with noise than the other.
    """

    power: FloatArray
    k2_y: FloatArray
    k2: FloatArray
    sensitivity: float
    area: float
    noise: float


def estimate_seafloor(posteriors: Sequence[Posterior], altitudes: Sequence[float], longest: float) -> Seafloor:
    """Roughness and reflectivity of the floor that some windows saw.

    Parameters
    ----------
    posteriors : sequence of Posterior
        Windows at their finest resolution, nothing solved yet.
    altitudes : sequence of float
        Height of each above its floor [m].
    longest : float
        Wavelength beyond which relief grows no more [m].

    Returns
    -------
    seafloor : Seafloor
        The usual one where no window is long and wide enough.

    Notes
    -----
    Over a nearly flat floor a logarithmic echo is ``-kappa dz/dy + rho + noise``. Slopes across track have the spectrum
    ``k_y^2 C k^-4``, zero along the track, patches of sediment are the same in every direction, speckle is white: the
    three are told apart by direction and wavelength. Whittle's likelihood is made large over windows and sides; speckle
    and noise of each image are so many times the power of its shortest waves, by a factor that all have in common.
    """
    images = [image for p, h in zip(posteriors, altitudes, strict=True) for image in _images(p, h)]
    waves = [_waves(*image) for image in images]
    if not waves:
        return Seafloor()
    best = _USUAL
    for _ in range(_N_STARTS):
        options: Any = {"xatol": 0.01, "fatol": 0.01, "initial_simplex": best + np.vstack([np.zeros(4), _STEPS])}
        best = minimize(_unlikeliness, best, (waves, longest), method="Nelder-Mead", options=options).x
    roughness, reflectivity, length, _ = np.exp(best)
    return Seafloor(float(roughness), float(reflectivity), float(length))


def _unlikeliness(logarithms: FloatArray, waves: Sequence[Waves], longest: float) -> float:
    """Negative logarithm of Whittle's likelihood and of what is usual."""
    roughness, reflectivity, length, noise = np.exp(np.clip(logarithms, -20, 20))
    total = 0.5 * (((logarithms - _USUAL) / _SPREAD) ** 2).sum()
    for w in waves:
        density = w.sensitivity * w.k2_y * relief_spectrum(w.k2, roughness, longest)
        expected = (density + reflectivity_spectrum(w.k2, reflectivity, length)) / w.area + noise * w.noise
        total += 0.5 * (np.log(expected) + w.power / expected).sum()
    return float(total)


def _images(posterior: Posterior, altitude: float) -> list[tuple[FloatArray, float, float]]:
    """A side each: logarithm of echo over flat floor on a ground grid, its spacing, its `Waves.sensitivity`."""
    sensor, bins, spacing = posterior.beams.sensor[:, 0, :2], posterior.bins, posterior.raster.spacing
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(sensor, axis=0).T))])
    slant_range = (np.arange(bins.intensity.shape[2]) + 0.5) * bins.width
    across = np.sqrt(np.maximum(slant_range**2 - altitude**2, 0.0))
    low, high = _ALTITUDES[0] * altitude, min(_ALTITUDES[1] * altitude, 0.95 * float(across[-1]))
    n_y, n_x = int((high - low) / spacing), int(along[-1] / spacing)
    if min(n_y, n_x) < 2 * _SHORTEST:
        return []
    row, column = np.meshgrid(np.floor((across - low) / spacing).astype(int), np.floor(along / spacing).astype(int))
    inside = (row >= 0) & (row < n_y) & (column < n_x)
    mu = posterior.predict(posterior.origin())
    y = (low + spacing * (np.arange(n_y) + 0.5)) / altitude
    sensitivity = float(np.mean((posterior.tables.exponent * y + 1 / y) ** 2))
    images = []
    for side in range(2):
        floor = bins.floor[side]
        ratio = (bins.intensity[:, side] - floor) / np.maximum(mu[:, side] - floor, 1e-9 * floor)
        good = inside & (bins.looks[:, side] > 0)
        cells = row[good] * n_x + column[good]
        count = np.bincount(cells, minlength=n_y * n_x)
        mean = np.bincount(cells, ratio[good], n_y * n_x) / np.maximum(count, 1)
        logarithm = np.where(count > 0, np.log(np.clip(mean, 0.05, 20.0)), 0.0).reshape(n_y, n_x)
        images.append((np.asarray(logarithm), spacing, sensitivity))
    return images


def _waves(image: FloatArray, spacing: float, sensitivity: float) -> Waves:
    """Waves of a side's image. What all lines share is the beam pattern's and left out."""
    level = image - np.median(image, axis=1, keepdims=True)
    bound = _CLIP * 1.4826 * float(np.median(np.abs(level))) + 1e-9
    level = np.clip(level, -bound, bound)
    k2_y, k2_x = wavenumbers(Raster(image.shape[0], image.shape[1], spacing, (0.0, 0.0)))
    k2_y, k2 = np.broadcast_to(k2_y, image.shape), k2_y + k2_x
    is_short, power = k2 >= (2 * np.pi / (_SHORTEST * spacing)) ** 2, to_cosine(level) ** 2
    told = (k2_x > 0) & ~is_short
    noise = float(power[is_short].mean()) + 1e-9
    return Waves(power[told], k2_y[told], k2[told], sensitivity, spacing**2, noise)
