"""Speckle: what interference, and patches of the floor too small to see, do to the mean intensity."""

from typing import Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator
from scipy.signal import lfilter, oaconvolve

from frontend.arrays import FloatArray


class SpeckleConfig(BaseModel):
    """Statistics of the intensity about its mean."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    looks: float = Field(default=1.0, gt=0, description="Looks L: variance is mean^2 / L; a raw sonar has one.")
    shape: float | None = Field(
        default=None, gt=0, description="Shape of a K distribution; 2 to 10 on stones, none: gamma."
    )
    range_correlation: float = Field(default=0.0, ge=0, description="Range at which correlation is 1/e [m]; 0: white.")
    track_correlation: float = Field(
        default=0.0, ge=0, description="Distance run at which correlation is 1/e [m]; 0: white."
    )

    @model_validator(mode="after")
    def _whole_looks(self) -> Self:
        if (self.range_correlation or self.track_correlation) and self.looks != round(self.looks):
            raise ValueError(f"correlated speckle wants a whole number of looks, got {self.looks}")
        return self


class SpeckleSource:
    """Speckle of one side, drawn piece by piece; how it is cut changes nothing in it.

    Parameters
    ----------
    config : SpeckleConfig
        The statistics.
    spacing : tuple of float
        Distance between pings and between samples [m].
    rng : Generator
        Source of randomness.
    """

    def __init__(self, config: SpeckleConfig, spacing: tuple[float, float], rng: np.random.Generator) -> None:
        self._config, self._kernel = config, _range_kernel(config.range_correlation / spacing[1])
        self._keep = float(np.exp(-0.5 * spacing[0] / config.track_correlation)) if config.track_correlation else 0.0
        self._texture_rng, self._rng = rng.spawn(2)
        self._last: FloatArray | None = None

    def texture(self, n_pings: int, n_samples: int) -> FloatArray:
        """Factors of mean one on the floor's echo that no number of looks averages out.

        Parameters
        ----------
        n_pings, n_samples : int
            How many.

        Returns
        -------
        texture : ndarray, shape (n_pings, n_samples)
            Gamma of the K distribution's shape; ones without one.
        """
        shape = self._config.shape
        if shape is None:
            return np.ones((n_pings, n_samples))
        return np.asarray(self._texture_rng.standard_gamma(shape, (n_pings, n_samples)) / shape)

    def speckle(self, n_pings: int, n_samples: int) -> FloatArray:
        """Factors of mean one on every sample.

        Parameters
        ----------
        n_pings, n_samples : int
            How many.

        Returns
        -------
        speckle : ndarray, shape (n_pings, n_samples)
            Gamma distributed, correlated as the configuration says.
        """
        config = self._config
        if not config.range_correlation and not config.track_correlation:
            return np.asarray(self._rng.standard_gamma(config.looks, (n_pings, n_samples)) / config.looks)
        field = self._field((n_pings, 2 * int(config.looks), n_samples))
        return np.asarray((field**2).sum(axis=1) / (2 * config.looks))

    def _field(self, shape: tuple[int, int, int]) -> FloatArray:
        """Real and imaginary parts of each look, unit variance, correlated along the last axis and the first."""
        n_pings, n_parts, n_samples = shape
        white = self._rng.standard_normal((n_pings, n_parts, n_samples + self._kernel.size - 1))
        ranged = oaconvolve(white, self._kernel[None, None, :], mode="valid", axes=-1)
        if not self._keep:
            return np.asarray(ranged)
        # First-order recursion over pings; the first one of the dive has nothing before it.
        fresh = np.sqrt(1.0 - self._keep**2) * ranged
        if self._last is None:
            fresh[0] = ranged[0]
            self._last = np.zeros((n_parts, n_samples))
        field, _ = lfilter([1.0], [1.0, -self._keep], fresh, axis=0, zi=self._keep * self._last[None])
        self._last = field[-1]
        return np.asarray(field)


def _range_kernel(length: float) -> FloatArray:
    """Filter whose squared autocorrelation falls to 1/e at a lag of so many samples; sum of squares one."""
    if length == 0:
        return np.ones(1)
    sample = np.arange(-int(4 * length) - 1, int(4 * length) + 2)
    kernel = np.exp(-((sample / length) ** 2))
    return np.asarray(kernel / np.linalg.norm(kernel))
