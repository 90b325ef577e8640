"""Layers of a seafloor without a direction: fractal relief, patches of sediment, boulders and pits."""

from typing import Literal

import numpy as np
from pydantic import Field, field_validator
from typing_extensions import override

from frontend.arrays import FloatArray
from sssslam.simulation.fields import GridLike, Surface, TerrainLayer, random_field


class Fractal(TerrainLayer):
    """Relief whose power falls with wavenumber by a power law."""

    kind: Literal["fractal"] = "fractal"
    rms: float = Field(default=0.8, ge=0, description="Standard deviation of the heights [m].")
    exponent: float = Field(
        default=4.2, gt=0, description="Power spectral density falls as k^-exponent; real floors 3 to 4.5."
    )
    longest: float = Field(default=400.0, gt=0, description="Wavelength above which the spectrum is flat [m].")
    shortest: float = Field(
        default=0.0, ge=0, description="Wavelength below which there is nothing [m]; 0: down to the grid."
    )

    @override
    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """Heights of a random field, scaled to the wanted rms."""
        field = random_field(grid, (self.exponent, self.longest, self.shortest), rng)
        return self.rms * field, np.zeros(grid.shape)


class Sediment(TerrainLayer):
    """Patches of brighter and darker sediment."""

    kind: Literal["sediment"] = "sediment"
    rms: float = Field(default=0.2, ge=0, description="Standard deviation of the natural log of the reflectivity.")
    exponent: float = Field(
        default=3.0, gt=0, description="Power spectral density falls as k^-exponent; rougher than relief."
    )
    longest: float = Field(default=60.0, gt=0, description="Wavelength above which the spectrum is flat [m].")
    shortest: float = Field(
        default=0.0, ge=0, description="Wavelength below which there is nothing [m]; 0: down to the grid."
    )

    @override
    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """Log-reflectivity of a random field, scaled to the wanted rms."""
        field = random_field(grid, (self.exponent, self.longest, self.shortest), rng)
        return np.zeros(grid.shape), self.rms * field


class Objects(TerrainLayer):
    """Boulders that stand on the floor and pits that are sunk into it, at random places."""

    kind: Literal["objects"] = "objects"
    count: int = Field(default=300, ge=0, le=1_000_000, description="Boulders and pits together.")
    pits: float = Field(default=0.4, ge=0, le=1, description="Share of the objects that are pits.")
    radius: tuple[float, float] = Field(default=(0.8, 3.5), description="Smallest and largest radius [m]; log-uniform.")
    steepness: tuple[float, float] = Field(default=(0.25, 0.6), description="Smallest and largest height over radius.")
    log_reflectivity: float = Field(
        default=0.3, description="Natural log of a boulder's brightness over its surroundings."
    )

    @field_validator("radius", "steepness")
    @classmethod
    def _in_order(cls, limits: tuple[float, float]) -> tuple[float, float]:
        if not 0 < limits[0] <= limits[1]:
            raise ValueError(f"a smallest and a largest positive number wanted, got {limits[0]} and {limits[1]}")
        return limits

    @override
    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """Smooth bumps ``height (1 - (d/radius)^2)^2``, up for a boulder and down for a pit."""
        x, y = rng.uniform(grid.x[0], grid.x[-1], self.count), rng.uniform(grid.y[0], grid.y[-1], self.count)
        radius = self.radius[0] * (self.radius[1] / self.radius[0]) ** rng.uniform(size=self.count)
        height = radius * rng.uniform(*self.steepness, size=self.count)
        is_pit = rng.uniform(size=self.count) < self.pits
        z, log_factor = np.zeros(grid.shape), np.zeros(grid.shape)
        for k in range(self.count):
            patch, bump = _bump(grid, (x[k], y[k]), radius[k])
            z[patch] += -height[k] * bump if is_pit[k] else height[k] * bump
            log_factor[patch] += 0.0 if is_pit[k] else self.log_reflectivity * (bump > 0)
        return z, log_factor


def _bump(grid: GridLike, centre: tuple[float, float], radius: float) -> tuple[tuple[slice, slice], FloatArray]:
    columns = slice(*np.searchsorted(grid.x, [centre[0] - radius, centre[0] + radius]))
    rows = slice(*np.searchsorted(grid.y, [centre[1] - radius, centre[1] + radius]))
    square = ((grid.x[columns][None, :] - centre[0]) ** 2 + (grid.y[rows][:, None] - centre[1]) ** 2) / radius**2
    return (rows, columns), np.maximum(1.0 - square, 0.0) ** 2
