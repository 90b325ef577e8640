"""Relief: what of a submap's heights can be compared with another's, whatever its offset, tilt and long waves."""

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.fft import irfft2, next_fast_len, rfft2
from scipy.ndimage import gaussian_filter

from frontend.arrays import BoolArray, FloatArray
from frontend.footprints import distance_from_track, evenness, without_profile
from frontend.repetition import without_repetition
from frontend.submaps import Submap


class ReliefConfig(BaseModel):
    """Which part of the heights is relief."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    longest: float = Field(
        default=12.0,
        gt=0,
        description="Wavelength [m] of which half is kept: longer waves come from priors, not from echoes.",
    )
    longest_across: float = Field(
        default=30.0,
        gt=0,
        description="The same [m] for each strip across the track: how high one ping's strip lies is all but a guess.",
    )
    shortest: float = Field(
        default=0.0, ge=0, description="Wavelength [m] of which half is kept: shorter waves go; 0 keeps all."
    )
    min_cells: float = Field(
        default=8.0, gt=0, description="Least ``longest`` [cells of the grid]: a coarse grid holds no shape below."
    )
    clip: float = Field(
        default=3.0,
        gt=0,
        description="Robust standard deviations [1] to which heights are drawn in: one boulder makes no place.",
    )


# A Gaussian of standard deviation s passes exp(-(2 pi s / wavelength)^2 / 2); half at wavelength = s / _HALF.
_HALF = np.sqrt(2 * np.log(2)) / (2 * np.pi)
_ROUNDING = 1e-6  # [m] of relief that is none
_LONGEST_LAG = 20.0  # [m] beyond which an autocorrelation of one submap is mostly chance


@dataclass(frozen=True)
class Relief:
    """Band-passed rasters of a submap, on its grid.

    Parameters
    ----------
    z : ndarray, shape (n_y, n_x)
        Relief [m]: heights without tilt, long waves and strips; 0 where the weight is 0.
    weight : ndarray, shape (n_y, n_x)
        Trust in each cell [1]: 0 where unknown or in shadow, else in (0, 1].
    reflectivity : ndarray, shape (n_y, n_x)
        Log-reflectivity treated like the heights [1].
    height, sigma : ndarray, shape (n_y, n_x)
        Heights as reconstructed and their standard deviations [m]; 0 and 1 where the weight is 0.
    spacing : float
        Distance between cells [m].
    origin : tuple of float
        x and y of the first cell in the submap frame [m].
    """

    z: FloatArray
    weight: FloatArray
    reflectivity: FloatArray
    height: FloatArray
    sigma: FloatArray
    spacing: float
    origin: tuple[float, float]

    @cached_property
    def is_trusted(self) -> BoolArray:
        """Shape (n_y, n_x): cells of positive weight."""
        return np.asarray(self.weight > 0)

    @cached_property
    def area(self) -> float:
        """Area of the trusted cells [m^2]."""
        return float(self.is_trusted.sum()) * self.spacing**2

    @cached_property
    def correlation_area(self) -> float:
        """Integral of the squared autocorrelation of the relief [m^2]: how much floor tells one independent thing."""
        return correlation_area(self.z, self.weight, self.spacing)

    @cached_property
    def reflectivity_correlation_area(self) -> float:
        """Integral of the squared autocorrelation of the reflectivity [m^2]."""
        return correlation_area(self.reflectivity, self.weight, self.spacing)

    @cached_property
    def information(self) -> float:
        """Root-mean-square relief over the median height sigma [1]; sigma counts long waves, so 0.3 is rough floor."""
        if not self.z.any():
            return 0.0
        return _rms(self.z, self.weight) / max(float(np.median(self.sigma[self.is_trusted])), _ROUNDING)

    @cached_property
    def centre(self) -> FloatArray:
        """Shape (2,): centroid of the trusted cells in the submap frame [m]."""
        rows, columns = np.nonzero(self.is_trusted)
        return np.array([columns.mean(), rows.mean()]) * self.spacing + np.array(self.origin)


def extract_relief(submap: Submap, config: ReliefConfig | None = None) -> Relief:
    """Take what is comparable out of a submap: neither tilt, long waves and marks of the sonar, nor what repeats.

    Parameters
    ----------
    submap : Submap
        Heights, sigmas, reflectivity and shadow.
    config : ReliefConfig, optional
        The band of wavelengths.

    Returns
    -------
    relief : Relief
        Rasters without NaN; cells that are unknown, in shadow, without a usable sigma or at an edge
        have weight 0.
    """
    config = config or ReliefConfig()
    known = submap.is_known & np.isfinite(submap.sigma) & (submap.sigma >= 0) & ~submap.is_shadow
    height, sigma = np.where(known, submap.surface.z, 0.0), np.where(known, submap.sigma, 1.0)
    spacing = submap.surface.spacing
    weight = known / (1 + (sigma / max(float(np.median(sigma[known])), 1e-9)) ** 2) if known.any() else sigma * 0.0
    distance = distance_from_track(submap)
    z, reflectivity = (band_pass(a, weight, spacing, config) for a in (height, np.nan_to_num(submap.log_reflectivity)))
    z, reflectivity = (without_repetition(a, weight) for a in (z, reflectivity))
    even = evenness(z, weight, distance, spacing)
    z, reflectivity = (without_profile(a, weight, distance, spacing) for a in (z, reflectivity))
    weight = weight * even
    weight = weight * _support(known, _longest(spacing, config) * _HALF / spacing)
    trusted = weight > 0
    z, reflectivity = _clipped(z, trusted, config.clip), np.where(trusted, reflectivity, 0.0)
    rasters = (np.where(trusted, height, 0.0), np.where(trusted, sigma, 1.0))
    return Relief(z, weight, reflectivity, *rasters, spacing, submap.surface.origin)


def band_pass(values: FloatArray, weight: FloatArray, spacing: float, config: ReliefConfig) -> FloatArray:
    """Keep a band of wavelengths of a raster with gaps.

    Parameters
    ----------
    values : ndarray, shape (n_y, n_x)
        A raster, finite everywhere.
    weight : ndarray, shape (n_y, n_x)
        Trust in each cell [1]; cells of weight 0 have no influence.
    spacing : float
        Distance between cells [m].
    config : ReliefConfig
        The band.

    Returns
    -------
    passed : ndarray, shape (n_y, n_x)
        The raster without plane, long waves, strips across the track and short waves; 0 where the weight is 0.

    Notes
    -----
    Smoothing is by normalised convolution with a Gaussian. The grid's y axis runs across the track. A side-scan hears
    slopes across the track; the height of one ping's strip against the next is left to a reconstruction's priors, whose
    errors are streaks along y. So long waves along y alone go too.
    """
    longest = _longest(spacing, config) * _HALF / spacing
    values = values - _plane(values, weight)
    values = values - _smooth(values, weight, (longest, longest))
    values = values - _smooth(values, weight, (max(config.longest_across * _HALF / spacing, longest), 0.0))
    if config.shortest > 0:
        values = _smooth(values, weight, (config.shortest * _HALF / spacing,) * 2)
    return np.asarray(np.where(weight > 0, values, 0.0))


def block_means(values: FloatArray, n: int) -> FloatArray:
    """Mean a raster over square blocks.

    Parameters
    ----------
    values : ndarray, shape (n_y, n_x)
        A raster.
    n : int
        Cells along each side of a block.

    Returns
    -------
    means : ndarray, shape (ceil(n_y / n), ceil(n_x / n))
        The means, the raster filled up with 0.
    """
    means = np.empty((-(-values.shape[0] // n), -(-values.shape[1] // n)))
    _block_means(np.ascontiguousarray(values, dtype=np.float64), n, means)
    return means


def correlation_area(values: FloatArray, weight: FloatArray, spacing: float) -> float:
    """Integral of the squared autocorrelation of a raster with gaps.

    Two unrelated rasters that overlap by an area A correlate by chance with a variance of about this area over A.

    Parameters
    ----------
    values, weight : ndarray, shape (n_y, n_x)
        A raster of zero mean and the trust in its cells [1].
    spacing : float
        Distance between cells [m].

    Returns
    -------
    area : float
        The integral over lags up to 20 m [m^2], at least one cell; infinite for a raster that is constant.
    """
    longest = int(_LONGEST_LAG / spacing)  # longer lags may wrap around
    shape = tuple(next_fast_len(n + min(longest, n - 1), real=True) for n in values.shape)
    power, count = (irfft2(np.abs(rfft2(a, shape)) ** 2, shape) for a in (values * weight, weight))
    if not power[0, 0] > 1e-12 * count[0, 0]:
        return float("inf")
    covariance = power / np.maximum(count, 0.05 * count[0, 0])
    lag = np.hypot(*np.meshgrid(*(_lags(n, spacing) for n in shape), indexing="ij"))
    return float(np.sum((covariance / covariance[0, 0])[lag <= _LONGEST_LAG] ** 2)) * spacing**2


def _lags(n: int, spacing: float) -> FloatArray:
    """Signed lags of a circular correlation of n cells [m]."""
    return np.asarray(np.fft.fftfreq(n, 1 / n) * spacing)


def _rms(values: FloatArray, weight: FloatArray | BoolArray) -> float:
    """Weighted root mean square; 0 where nothing is known."""
    return float(np.sqrt(np.sum(weight * values**2) / max(float(np.sum(weight)), 1e-12)))


def _plane(values: FloatArray, weight: FloatArray) -> FloatArray:
    """The weighted least-squares plane."""
    rows, columns = np.meshgrid(*(np.linspace(-1, 1, n) for n in values.shape), indexing="ij")
    basis = np.stack([np.ones_like(rows), rows, columns])
    normal = np.einsum("iyx,jyx,yx->ij", basis, basis, weight)
    return np.asarray(np.tensordot(np.linalg.pinv(normal) @ np.einsum("iyx,yx->i", basis, weight * values), basis, 1))


def _longest(spacing: float, config: ReliefConfig) -> float:
    """Longest wavelength kept [m]."""
    return max(config.longest, config.min_cells * spacing)


def _smooth(values: FloatArray, weight: FloatArray, sigma: tuple[float, float]) -> FloatArray:
    """Normalised convolution with a Gaussian of ``sigma`` cells along y and x."""
    blurred, total = (gaussian_filter(a, sigma, mode="constant", truncate=3.0) for a in (values * weight, weight))
    return np.asarray(blurred / np.maximum(total, 1e-12))


def _support(known: BoolArray, sigma: float) -> FloatArray:
    """Trust in a smoothing: 1 inside, 0 at a straight edge, where it looks to one side only."""
    share = gaussian_filter(known.astype(np.float64), sigma, mode="constant", truncate=3.0)
    return np.asarray(np.where(known, np.maximum(2 * share - 1, 0.0), 0.0))


def _clipped(z: FloatArray, trusted: BoolArray, limit: float) -> FloatArray:
    """The trusted relief with its outliers drawn in to ``limit`` robust standard deviations, 0 elsewhere."""
    scale = 1.4826 * float(np.median(np.abs(z[trusted]))) if trusted.any() else 0.0
    if scale < _ROUNDING:
        return np.zeros_like(z)
    return np.asarray(np.where(trusted, np.clip(z, -limit * scale, limit * scale), 0.0))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _block_means(values: FloatArray, n: int, means: FloatArray) -> None:
    """Mean of each block, cells outside the raster counted as 0."""
    for i in range(means.shape[0]):
        for j in range(means.shape[1]):
            total = 0.0
            for k in range(n * i, min(n * i + n, values.shape[0])):
                for m in range(n * j, min(n * j + n, values.shape[1])):
                    total += values[k, m]
            means[i, j] = total / n**2
