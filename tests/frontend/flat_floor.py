"""Echoes of a flat, level floor by the formula, with speckle of known looks."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from frontend.arrays import FloatArray
from frontend.geometry import off_nadir_angle
from frontend.recording import Quantity, Recording, SonarGeometry
from frontend.trajectory import Trajectory

SPACING = 0.05


def fan(side: int, angle: FloatArray) -> FloatArray:
    """Natural logarithm of a two-way beam pattern, not the same on both sides; shape of the angles."""
    return np.asarray(-(((angle - 1.0 - 0.05 * side) / 0.55) ** 2))


@dataclass(frozen=True)
class FlatFloor:
    """A floor at some altitude [m] under each ping, and a sonar; strength and noise are intensities."""

    altitude: FloatArray
    n_samples: int = 900
    looks: float = 1.0
    power: float = 3.0
    noise: tuple[float, float] = (2.0, 1.0)
    strength: float = 3e6
    beam: Callable[[int, FloatArray], FloatArray] = fan
    ringing: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0

    @property
    def slant_range(self) -> FloatArray:
        """Middles of the samples [m], shape (M,)."""
        return np.asarray((np.arange(self.n_samples) + 0.5) * SPACING)

    def mean_intensity(self) -> FloatArray:
        """Expected intensity, shape (N, 2, M): beam, range law, Lambert's law, area of a range cell, noise, ringing."""
        n, r = len(self.altitude), self.slant_range
        angle = off_nadir_angle(r, self.altitude, (np.full(n, self.roll), np.full(n, self.pitch)))
        beam = np.stack([np.exp(self.beam(side, angle[:, side])) for side in (0, 1)], axis=1)
        cosine = self.altitude[:, None] / r
        shape = np.where(cosine < 1, cosine**2 / np.sqrt(np.abs(1 - cosine**2)), 0.0)
        echo = np.nan_to_num(beam) * (self.strength * r**-self.power * shape)[:, None]
        return echo + np.array(self.noise)[None, :, None] + self.ringing * np.exp(-r / 0.3)

    def record(self, rng: np.random.Generator, quantity: Quantity = Quantity.UNKNOWN) -> Recording:
        """Intensities with gamma speckle, on a straight track of half a metre a ping, without altimeter."""
        mean = self.mean_intensity()
        echoes = (mean * rng.gamma(self.looks, 1 / self.looks, mean.shape)).astype(np.float32)
        n = len(self.altitude)
        zero, nothing = np.zeros(n), np.full(n, np.nan)
        track = Trajectory(
            np.arange(n) / 4.0, 0.5 * np.arange(n), zero, zero - 30.0, zero + self.roll, zero + self.pitch, zero
        )
        return Recording(
            port=echoes[:, 0],
            starboard=echoes[:, 1],
            sample_spacing=np.full(n, SPACING),
            sound_speed=np.full(n, 1500.0),
            trajectory_dr=track,
            altitude=nothing,
            depth=nothing,
            speed=nothing,
            sonar=SonarGeometry(quantity=quantity),
        )
