"""Wave motion: roll, pitch, yaw and heave as sums of sines."""

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray


class WavesConfig(BaseModel):
    """Quasi-periodic motion about the mean attitude."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    roll_deg: float = Field(
        default=0.8, ge=0, description="Standard deviation of roll [deg]; a small AUV well below the surface."
    )
    pitch_deg: float = Field(default=0.6, ge=0, description="Standard deviation of pitch [deg].")
    yaw_deg: float = Field(default=0.3, ge=0, description="Standard deviation of yaw about the course [deg].")
    heave: float = Field(default=0.05, ge=0, description="Standard deviation of height about the planned height [m].")
    period: float = Field(default=8.0, gt=0, description="Peak period [s].")


@dataclass(frozen=True)
class Waves:
    """Sums of sines: angular rates (K,) [rad/s], amplitudes (K, 4) of roll, pitch, yaw [rad], heave [m], and phases."""

    rate: FloatArray
    amplitude: FloatArray
    phase: FloatArray

    def at(self, time: FloatArray) -> FloatArray:
        """Roll, pitch, yaw [rad] and heave [m] at times [s], shape (N, 4)."""
        total = np.zeros((time.size, 4))
        for rate, amplitude, phase in zip(self.rate, self.amplitude, self.phase, strict=True):
            total += amplitude * np.sin(rate * time[:, None] + phase)
        return total


def make_waves(config: WavesConfig, rng: np.random.Generator) -> Waves:
    """Choose rates, amplitudes and phases of wave motion: sixteen sines in the octave about the peak.

    Parameters
    ----------
    config : WavesConfig
        Standard deviations and peak period.
    rng : Generator
        Phases and the jitter of the rates, which keeps the sum from repeating.

    Returns
    -------
    waves : Waves
        The sums of sines.
    """
    n = 16
    octave = np.linspace(-1.0, 1.0, n) + rng.uniform(-0.5, 0.5, n) / n
    weight = np.exp(-2.0 * octave**2)
    deviations = np.array([*np.radians([config.roll_deg, config.pitch_deg, config.yaw_deg]), config.heave])
    amplitude = np.sqrt(2.0) * weight[:, None] / np.linalg.norm(weight) * deviations
    return Waves(2 * np.pi / config.period * 2.0**octave, amplitude, rng.uniform(0, 2 * np.pi, (n, 4)))
