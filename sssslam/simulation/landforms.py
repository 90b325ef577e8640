"""Layers of a seafloor with a direction: ripples, sand waves, ridges, scarps, grooves and boxes."""

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import override

from frontend.arrays import FloatArray
from sssslam.simulation.fields import GridLike, Surface, TerrainLayer, random_field, turned


class Waves(TerrainLayer):
    """Ripples (decimetres to metres) or sand waves (tens of metres): crests that wander, steeper on the lee side."""

    kind: Literal["waves"] = "waves"
    wavelength: float = Field(default=1.5, gt=0, description="Distance between crests [m].")
    height: float = Field(
        default=0.15, ge=0, description="Trough to crest [m]; ripples about a tenth of the wavelength."
    )
    direction_deg: float = Field(default=0.0, description="Direction the crests move, clockwise from north [deg].")
    skewness: float = Field(default=0.3, ge=0, lt=1, description="Lee side steeper than stoss side; 0 is a sine.")
    wander: float = Field(
        default=0.15, ge=0, description="How far crests stray from straight, in wavelengths (1 sigma)."
    )
    trough_log_reflectivity: float = Field(default=0.2, description="Natural log of a trough's brightness; coarse lag.")

    @override
    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """Height ``-h/2 cos(phase + skew cos(phase))`` over a phase that wanders from cell to cell."""
        along, _ = turned(grid, np.radians(self.direction_deg))
        stray = random_field(grid, (4.0, 12.0 * self.wavelength, 3.0 * self.wavelength), rng) if self.wander else 0.0
        phase = 2 * np.pi * (along / self.wavelength + self.wander * stray)
        profile = np.cos(phase + self.skewness * np.cos(phase))
        return -0.5 * self.height * profile, 0.5 * self.trough_log_reflectivity * profile


class Ridge(TerrainLayer):
    """A straight ridge of Gaussian section; of negative height a channel."""

    kind: Literal["ridge"] = "ridge"
    height: float = Field(default=3.0, description="Crest over the floor [m].")
    width: float = Field(default=20.0, gt=0, description="Full width at half height [m].")
    through: tuple[float, float] = Field(default=(0.0, 0.0), description="A point on the crest [m].")
    strike_deg: float = Field(default=0.0, description="Direction of the crest, clockwise from north [deg].")

    @override
    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """Height over the distance from the crest."""
        across = _across(grid, self.strike_deg, self.through)
        return self.height * 0.5 ** ((2 * across / self.width) ** 2), np.zeros(grid.shape)


class Scarp(TerrainLayer):
    """A step: the floor to the right of the strike lies higher."""

    kind: Literal["scarp"] = "scarp"
    height: float = Field(default=3.0, description="Height of the step [m].")
    width: float = Field(default=3.0, gt=0, description="Horizontal width of the face [m].")
    through: tuple[float, float] = Field(default=(0.0, 0.0), description="A point on the middle of the face [m].")
    strike_deg: float = Field(default=0.0, description="Direction of the step, clockwise from north [deg].")

    @override
    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """A straight face between two levels that average to zero."""
        across = _across(grid, self.strike_deg, self.through)
        return self.height * np.clip(across / self.width, -0.5, 0.5), np.zeros(grid.shape)


class Groove(TerrainLayer):
    """The synthetic scene of Woock 2011, figure 1: across track the floor rises per line, then drops steeply."""

    kind: Literal["groove"] = "groove"
    height: float = Field(default=4.0, gt=0, description="Rise from the foot of the slope to the brink [m].")
    foot: float = Field(default=8.0, description="Where the slope begins, to the right of the strike [m].")
    brink: float = Field(default=30.0, description="Where it ends and the drop begins [m].")
    drop: float = Field(default=1.0, gt=0, description="Horizontal width of the drop [m].")
    strike_deg: float = Field(
        default=0.0, description="Direction of the track the groove runs along, clockwise from north [deg]."
    )

    @model_validator(mode="after")
    def _foot_before_brink(self) -> Self:
        if not self.foot < self.brink:
            raise ValueError(f"the brink must lie beyond the foot, got foot {self.foot} m and brink {self.brink} m")
        return self

    @override
    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """A ramp and a drop on the right of the track, and the same mirrored on the left."""
        across = np.abs(_across(grid, self.strike_deg, (0.0, 0.0)))
        profile = np.interp(across, [self.foot, self.brink, self.brink + self.drop], [0.0, self.height, 0.0])
        return profile, np.zeros(grid.shape)


class Box(TerrainLayer):
    """A box that stands on the floor: a wreck's hull, a container, a test target."""

    kind: Literal["box"] = "box"
    centre: tuple[float, float] = Field(default=(0.0, 0.0), description="Middle of its base [m].")
    size: tuple[float, float, float] = Field(default=(10.0, 4.0, 2.0), description="Length, width and height [m].")
    heading_deg: float = Field(default=0.0, description="Direction of its length, clockwise from north [deg].")
    log_reflectivity: float = Field(default=0.0, description="Natural log of its brightness over the floor's.")

    @override
    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """The box's height inside its outline."""
        azimuth = np.radians(self.heading_deg)
        along, across = turned(grid, azimuth)
        along_0 = self.centre[0] * np.sin(azimuth) + self.centre[1] * np.cos(azimuth)
        across_0 = self.centre[0] * np.cos(azimuth) - self.centre[1] * np.sin(azimuth)
        inside = (np.abs(along - along_0) <= 0.5 * self.size[0]) & (np.abs(across - across_0) <= 0.5 * self.size[1])
        return self.size[2] * inside, self.log_reflectivity * inside


def _across(grid: GridLike, strike_deg: float, through: tuple[float, float]) -> FloatArray:
    azimuth = np.radians(strike_deg)
    _, across = turned(grid, azimuth)
    return across - (through[0] * np.cos(azimuth) - through[1] * np.sin(azimuth))
