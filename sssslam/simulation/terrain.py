"""The seafloor of a scene: heights and reflectivity on one grid, the sum of the scene's layers."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import Float32Array, FloatArray
from frontend.heightfield import Heightfield
from sssslam.simulation.landforms import Box, Groove, Ridge, Scarp, Waves
from sssslam.simulation.layers import Fractal, Objects, Sediment
from sssslam.simulation.terrain_files import GridFile

_LARGEST_GRID = 400_000_000

Layer = Annotated[
    Fractal | Sediment | Objects | Waves | Ridge | Scarp | Groove | Box | GridFile, Field(discriminator="kind")
]


class TerrainConfig(BaseModel):
    """The seafloor; layers add up, in any order."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    size: tuple[float, float] = Field(
        default=(400.0, 400.0), description="East and north extent [m]; track and swath fit in."
    )
    spacing: float = Field(
        default=0.25, gt=0, description="Distance between heights [m]; about five range bins at 400 kHz."
    )
    depth: float = Field(default=50.0, gt=0, description="Mean water depth [m]; the floor lies about z = -depth.")
    layers: tuple[Layer, ...] = Field(
        default=(Fractal(), Sediment()), description="What the floor is made of; heights and log-reflectivities add up."
    )


class Grid(NamedTuple):
    """Cell centres of a terrain: x (n_x,) and y (n_y,) [m], centred on the world's origin."""

    x: FloatArray
    y: FloatArray
    spacing: float

    @property
    def shape(self) -> tuple[int, int]:
        """Rows along y, columns along x."""
        return self.y.size, self.x.size


@dataclass(frozen=True)
class Terrain:
    """Heights and reflectivity of the seafloor.

    Parameters
    ----------
    z : ndarray of float32, shape (n_y, n_x)
        Heights [m] in the world frame; bilinear between cell centres.
    reflectivity : ndarray of float32, shape (n_y, n_x)
        Factor on the backscattered intensity; 1 on average in the logarithm.
    spacing : float
        Distance between cell centres [m].
    origin : tuple of float
        x and y of the centre of cell ``z[0, 0]`` [m].
    """

    z: Float32Array
    reflectivity: Float32Array
    spacing: float
    origin: tuple[float, float]

    @cached_property
    def heightfield(self) -> Heightfield:
        """The same heights as the rest of the package knows them."""
        return Heightfield(self.z.astype(np.float64), self.spacing, self.origin)


def make_terrain(config: TerrainConfig, rng: np.random.Generator) -> Terrain:
    """Add up the layers of a seafloor.

    Parameters
    ----------
    config : TerrainConfig
        Extent, depth and layers.
    rng : Generator
        Each layer gets its own child, so that a change in one leaves the others as they are.

    Returns
    -------
    terrain : Terrain
        Heights and reflectivity.
    """
    grid = make_grid(config.size, config.spacing)
    z, log_reflectivity = np.full(grid.shape, -config.depth), np.zeros(grid.shape)
    for layer, layer_rng in zip(config.layers, rng.spawn(len(config.layers)), strict=True):
        height, log_factor = layer.add(grid, layer_rng)
        z, log_reflectivity = z + height, log_reflectivity + log_factor
    origin = (float(grid.x[0]), float(grid.y[0]))
    return Terrain(z.astype(np.float32), np.exp(log_reflectivity).astype(np.float32), config.spacing, origin)


def make_grid(size: tuple[float, float], spacing: float) -> Grid:
    """Lay cell centres over a rectangle about the origin.

    Parameters
    ----------
    size : tuple of float
        East and north extent [m].
    spacing : float
        Distance between cell centres [m].

    Returns
    -------
    grid : Grid
        The cell centres.
    """
    n_x, n_y = (round(extent / spacing) + 1 for extent in size)
    if min(n_x, n_y) < 4 or n_x * n_y > _LARGEST_GRID:
        raise ValueError(f"terrain of {n_x} x {n_y} cells given, 4 x 4 to {_LARGEST_GRID} cells in all wanted")
    x, y = (np.asarray(spacing * (np.arange(n) - 0.5 * (n - 1)), dtype=np.float64) for n in (n_x, n_y))
    return Grid(x, y, spacing)
