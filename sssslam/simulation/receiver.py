"""What the receiver adds to the echo and what the recorder keeps of it."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import Float32Array, FloatArray
from frontend.recording import Quantity
from sssslam.simulation.sonar import SonarConfig


class ReceiverConfig(BaseModel):
    """Between water and recorder; levels are of the received intensity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    gain: float = Field(
        default=-60.0, description="From received level to recorded intensity [dB]; makes handy numbers."
    )
    crosstalk: float | None = Field(
        default=None, lt=0, description="Leak between the sides [dB]; -30 to -40, none: none."
    )
    volume_strength: float | None = Field(
        default=None, description="Backscatter of the water [dB re 1/m]; -80 is turbid."
    )
    ringing_level: float | None = Field(default=None, description="Transducer's own ringing at range 0 [dB re 1 uPa].")
    ringing_length: float = Field(default=0.3, gt=0, description="Range over which ringing falls by 1/e [m].")
    surface_loss: float | None = Field(default=None, ge=0, description="Loss at the surface [dB]; none: no multipath.")
    tvg_spreading: float = Field(
        default=0.0, ge=0, le=40, description="Gain over range, this times log10 r [dB]; 30 levels."
    )
    tvg_absorption: float = Field(
        default=0.0, ge=0, le=2, description="Gain over range, this share of two-way absorption."
    )


SampleType = Literal["u1", "<u2", "<f4"]


class _Recorder(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class FloatRecorder(_Recorder):
    """Keeps intensity as it is."""

    format: Literal["intensity"] = "intensity"

    @property
    def quantity(self) -> Quantity:
        """What the numbers are."""
        return Quantity.INTENSITY

    @property
    def sample_type(self) -> SampleType:
        """How a file holds them."""
        return "<f4"

    def record(self, intensity: FloatArray) -> Float32Array:
        """Recorded numbers of intensities, shape (N, M)."""
        return intensity.astype(np.float32)


class LinearRecorder(_Recorder):
    """Keeps amplitude in whole steps, as most 8 and 16-bit recorders do."""

    format: Literal["linear"] = "linear"
    bits: Literal[8, 16] = Field(default=16, description="Width of a sample.")
    full_scale: float = Field(default=50.0, description="Intensity of the largest number [dB]; louder echoes clip.")

    @property
    def quantity(self) -> Quantity:
        """What the numbers are."""
        return Quantity.AMPLITUDE

    @property
    def sample_type(self) -> SampleType:
        """How a file holds them."""
        return "u1" if self.bits == 8 else "<u2"

    def record(self, intensity: FloatArray) -> Float32Array:
        """Recorded numbers of intensities, shape (N, M)."""
        largest = 2**self.bits - 1
        amplitude = np.sqrt(intensity) * largest / 10 ** (0.05 * self.full_scale)
        return np.rint(np.minimum(amplitude, largest)).astype(np.float32)


class LogRecorder(_Recorder):
    """Keeps the logarithm of intensity in whole steps, as fish finders do."""

    format: Literal["log"] = "log"
    bits: Literal[8, 16] = Field(default=8, description="Width of a sample.")
    full_scale: float = Field(default=50.0, description="Intensity of the largest number [dB].")
    dynamic_range: float = Field(default=60.0, gt=0, description="From the smallest number to the largest [dB].")

    @property
    def quantity(self) -> Quantity:
        """What the numbers are."""
        return Quantity.LOG

    @property
    def sample_type(self) -> SampleType:
        """How a file holds them."""
        return "u1" if self.bits == 8 else "<u2"

    def record(self, intensity: FloatArray) -> Float32Array:
        """Recorded numbers of intensities, shape (N, M)."""
        level = 10 * np.log10(np.maximum(intensity, 1e-30))
        share = np.clip((level - self.full_scale) / self.dynamic_range + 1.0, 0.0, 1.0)
        return np.rint((2**self.bits - 1) * share).astype(np.float32)


Recorder = Annotated[FloatRecorder | LinearRecorder | LogRecorder, Field(discriminator="format")]


def background(sonar: SonarConfig, receiver: ReceiverConfig, sound_speed: float, absorption: float) -> FloatArray:
    """Mean intensity of a sonar without a seafloor: noise, backscatter of the water, ringing.

    Parameters
    ----------
    sonar : SonarConfig
        The sonar.
    receiver : ReceiverConfig
        Levels.
    sound_speed : float
        Sound speed [m/s].
    absorption : float
        One way [dB/m].

    Returns
    -------
    intensity : ndarray, shape (M,)
        In recorded units, before time-varying gain.
    """
    slant_range = sample_ranges(sonar)
    level = np.full(slant_range.size, 10 ** (0.1 * sonar.noise_level))
    if receiver.volume_strength is not None:
        # Two-way solid angle of a fan: 0.72 of each one-way width. SL - 2 TL + Sv + 10 log V, V = angle r^2 dr.
        angle = 0.72**2 * sonar.horizontal_beamwidth(sound_speed) * np.radians(sonar.vertical_beamwidth_deg)
        scattered = sonar.source_level + receiver.volume_strength - 2 * absorption * slant_range
        level += 10 ** (0.1 * scattered) * angle * sonar.sample_spacing / slant_range**2
    if receiver.ringing_level is not None:
        level += 10 ** (0.1 * receiver.ringing_level) * np.exp(-slant_range / receiver.ringing_length)
    return np.asarray(level * 10 ** (0.1 * receiver.gain))


def time_varying_gain(sonar: SonarConfig, receiver: ReceiverConfig, absorption: float) -> FloatArray:
    """Gain of the receiver over range.

    Parameters
    ----------
    sonar : SonarConfig
        The sonar.
    receiver : ReceiverConfig
        The law.
    absorption : float
        One way [dB/m].

    Returns
    -------
    gain : ndarray, shape (M,)
        Factor on the intensity; 1 at 1 m but for absorption.
    """
    slant_range = sample_ranges(sonar)
    level = receiver.tvg_spreading * np.log10(slant_range) + 2 * receiver.tvg_absorption * absorption * slant_range
    return np.asarray(10 ** (0.1 * level))


def sample_ranges(sonar: SonarConfig) -> FloatArray:
    """Slant range of the middle of each sample [m], shape (M,)."""
    return np.asarray((np.arange(sonar.n_samples) + 0.5) * sonar.sample_spacing, dtype=np.float64)


def leak(port: FloatArray, starboard: FloatArray, crosstalk: float | None) -> tuple[FloatArray, FloatArray]:
    """Let a little of each side into the other.

    Parameters
    ----------
    port, starboard : ndarray, shape (N, M)
        Intensities.
    crosstalk : float or None
        Share that leaks [dB].

    Returns
    -------
    port, starboard : ndarray, shape (N, M)
        Intensities; the two signals add without a fixed phase.
    """
    if crosstalk is None:
        return port, starboard
    share = 10 ** (0.1 * crosstalk)
    return port + share * starboard, starboard + share * port
