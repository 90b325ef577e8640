"""Layers of a seafloor from files: grids of heights, ``.npz`` or GeoTIFF."""

import logging
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator
from scipy.ndimage import distance_transform_edt, map_coordinates
from typing_extensions import override

from frontend.arrays import FloatArray
from frontend.heightfield import Heightfield
from sssslam.simulation.fields import GridLike, Surface, TerrainLayer

_log = logging.getLogger(__name__)


class GridFile(TerrainLayer):
    """A grid of heights from a file; its middle is laid on the world's origin."""

    kind: Literal["grid"] = "grid"
    file: Path = Field(description="`.npz` with z[north, east] and spacing, or GeoTIFF; relative to the scene's file.")
    scale: float = Field(
        default=1.0, gt=0, description="Horizontal stretch; a reef photographed at 1 cm becomes a boulder field."
    )
    height_scale: float = Field(default=1.0, gt=0, description="Vertical stretch.")
    centre: tuple[float, float] = Field(
        default=(0.0, 0.0), description="Point laid on the origin, from the grid's middle [m]."
    )

    @field_validator("file")
    @classmethod
    def _beside_the_scene(cls, file: Path, info: ValidationInfo) -> Path:
        return Path((info.context or {}).get("folder", ".")) / file

    @override
    def add(self, grid: GridLike, rng: np.random.Generator) -> Surface:
        """Heights about their mean, by cubic interpolation."""
        z, spacing = (heights := read_grid(self.file)).z, heights.spacing * self.scale
        rows, columns = (
            0.5 * (n - 1) + (axis + shift) / spacing
            for n, axis, shift in zip(z.shape, (grid.y, grid.x), self.centre[::-1], strict=True)
        )
        if min(rows[0], columns[0]) < -1e-6 or rows[-1] > z.shape[0] - 1 + 1e-6 or columns[-1] > z.shape[1] - 1 + 1e-6:
            width, height = (spacing * (n - 1) for n in z.shape[::-1])
            raise ValueError(
                f"{self.file.name} covers {width:.0f} x {height:.0f} m: a terrain that fits in it is wanted"
            )
        places = np.meshgrid(rows, columns, indexing="ij")
        sampled = map_coordinates(_without_gaps(z, self.file), places, order=3, mode="nearest")
        return self.height_scale * (sampled - sampled.mean()), np.zeros(grid.shape)


def read_grid(path: Path) -> Heightfield:
    """Read a grid of heights.

    Parameters
    ----------
    path : Path
        `.npz` with ``z[north, east]`` [m], ``spacing`` [m] and perhaps ``origin``, or a GeoTIFF in metres.

    Returns
    -------
    heights : Heightfield
        The grid; NaN where the file has no height.
    """
    if not path.is_file():
        raise ValueError(f"terrain file {path} given, there is no such file")
    heights = _read_npz(path) if path.suffix.lower() == ".npz" else _read_geotiff(path)
    if heights.z.ndim != 2 or min(heights.z.shape) < 2 or not np.isfinite(heights.z).any():
        raise ValueError(f"{path}: a grid of at least 2 x 2 heights wanted, got shape {heights.z.shape}")
    if not heights.spacing > 0:
        raise ValueError(f"{path}: spacing must be positive, got {heights.spacing} m")
    return heights


def _read_npz(path: Path) -> Heightfield:
    try:
        with np.load(path, allow_pickle=False) as file:
            names = [name for name in ("z", "spacing", "origin") if name in file]
            arrays = {name: np.asarray(file[name], dtype=np.float64) for name in names}
    except Exception as error:
        raise ValueError(f"{path}: not a readable .npz of numbers ({type(error).__name__})") from error
    if missing := {"z", "spacing"} - set(arrays):
        raise ValueError(f"{path}: {' and '.join(sorted(missing))} wanted, the file has not got it")
    origin = arrays.get("origin", np.zeros(2)).ravel()
    if arrays["spacing"].size != 1 or origin.size != 2:
        raise ValueError(f"{path}: one spacing and an origin of two numbers wanted")
    return Heightfield(arrays["z"], float(arrays["spacing"].ravel()[0]), (float(origin[0]), float(origin[1])))


def _read_geotiff(path: Path) -> Heightfield:
    import rasterio

    try:
        with rasterio.open(path) as file:
            z = file.read(1, masked=True).astype(np.float64).filled(np.nan)
            corner, is_geographic = file.transform, bool(file.crs and file.crs.is_geographic)
    except rasterio.errors.RasterioError as error:
        raise ValueError(f"{path}: not a readable raster") from error
    if is_geographic:
        raise ValueError(f"{path}: a grid in degrees given, one in metres wanted: project it first")
    across, up = corner.a, -corner.e
    if not np.isclose(across, up, rtol=1e-3):
        raise ValueError(f"{path}: square cells with north up wanted, got {across} x {up} m")
    # A raster counts rows from the north and its corner is a cell's corner.
    return Heightfield(z[::-1], across, (corner.c + 0.5 * across, corner.f - (z.shape[0] - 0.5) * up))


def _without_gaps(z: FloatArray, path: Path) -> FloatArray:
    unknown = ~np.isfinite(z)
    if not unknown.any():
        return z
    _log.warning("%s: %d of %d heights are unknown and taken from their nearest neighbour", path, unknown.sum(), z.size)
    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return np.asarray(z[tuple(nearest)])
