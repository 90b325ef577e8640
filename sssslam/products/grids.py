"""Grids as GeoTIFF, north up, and grids as numpy archives: written and read."""

import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import rasterio
from rasterio.crs import CRS
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.io import MemoryFile
from rasterio.transform import from_origin

from frontend.arrays import FloatArray
from frontend.georeference import Georeference
from frontend.heightfield import Heightfield
from sssslam.regular_files import read_head


def format_geotiff(
    layers: Mapping[str, FloatArray], spacing: float, origin: tuple[float, float], georeference: Georeference | None
) -> bytes:
    """Layers on one grid as a GeoTIFF of 32-bit floats; unknown is NaN.

    Parameters
    ----------
    layers : mapping of str to ndarray, shape (n_y, n_x)
        Bands in order, by description; the first row is the southernmost.
    spacing : float
        Distance between cell centres [m].
    origin : tuple of float
        x and y of the centre of cell ``[0, 0]`` [m].
    georeference : Georeference or None
        Where the frame lies; unknown, the file has metres and no CRS.

    Returns
    -------
    content : bytes
        The file, north up.
    """
    bands = np.stack([np.flipud(layer) for layer in layers.values()]).astype(np.float32)
    n_y, n_x = bands.shape[1:]
    corner = from_origin(origin[0] - spacing / 2, origin[1] + (n_y - 0.5) * spacing, spacing, spacing)
    crs = None if georeference is None else CRS.from_wkt(georeference.crs.to_wkt())
    profile = {"count": len(bands), "height": n_y, "width": n_x, "dtype": "float32", "nodata": np.nan}
    with warnings.catch_warnings(), MemoryFile() as memory:
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with memory.open(driver="GTiff", transform=corner, crs=crs, compress="deflate", predictor=3, **profile) as file:
            file.write(bands)
            file.descriptions = tuple(layers)
        return bytes(memory.read())


def read_geotiff(path: str | os.PathLike[str]) -> tuple[tuple[Heightfield, ...], CRS | None]:
    """Read the bands of a GeoTIFF that lies north up with square cells.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    bands : tuple of Heightfield
        One a band; what the file calls nodata is NaN.
    crs : rasterio.crs.CRS or None
        The coordinate reference system, where the file names one.

    Raises
    ------
    ValueError
        If the file cannot be read, or its cells are turned or not square.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with rasterio.open(path) as file:
                values = file.read(masked=True).astype(np.float64).filled(np.nan)
                grid, crs = file.transform, file.crs
    except (RasterioError, OSError) as error:
        raise ValueError(f"{path}: a GeoTIFF is wanted, cannot read it ({str(error).splitlines()[0]})") from None
    if not (grid.b == grid.d == 0.0 and grid.a > 0 and np.isclose(grid.a, -grid.e)):
        raise ValueError(f"{path}: a grid north up with square cells is wanted, got the transform {tuple(grid)[:6]}")
    origin = (grid.c + grid.a / 2, grid.f + (values.shape[1] - 0.5) * grid.e)
    return tuple(Heightfield(np.flipud(band), grid.a, origin) for band in values), crs


def read_terrain(path: str | os.PathLike[str], crs: CRS | None = None) -> Heightfield:
    """Read a terrain grid: a GeoTIFF, or an ``.npz`` with ``z[north, east]``, ``spacing`` and ``origin``.

    Parameters
    ----------
    path : path-like
        The file.
    crs : rasterio.crs.CRS or None
        Coordinate reference system that the terrain must have, where both are known.

    Returns
    -------
    terrain : Heightfield
        Heights [m].

    Raises
    ------
    ValueError
        If the file cannot be read, is no such grid, or lies in another coordinate reference system.
    """
    read_head(Path(path), 1, "a terrain grid")
    if Path(path).suffix.lower() == ".npz":
        return _read_npz(path)
    bands, crs_terrain = read_geotiff(path)
    if crs is not None and crs_terrain is not None and crs != crs_terrain:
        raise ValueError(
            f"{path}: the terrain must be in the frame of the run ({_short(crs)}), got {_short(crs_terrain)}"
        )
    return bands[0]


def _short(crs: CRS) -> str:
    return crs.to_string() if crs.to_epsg() else crs.to_proj4().replace("+no_defs=True", "").strip()


def _read_npz(path: str | os.PathLike[str]) -> Heightfield:
    try:
        with np.load(path, allow_pickle=False) as archive:
            z, spacing = np.asarray(archive["z"], dtype=np.float64), float(archive["spacing"])
            x, y = (float(value) for value in archive["origin"])
    except (OSError, ValueError, TypeError, KeyError, BadZipFile, EOFError) as error:
        raise ValueError(f"{path}: an .npz with z[north, east], spacing and origin is wanted ({error})") from None
    if z.ndim != 2 or z.size == 0 or not spacing > 0:
        raise ValueError(f"{path}: z must be a grid and spacing positive, got shape {z.shape} and {spacing} m")
    return Heightfield(z, spacing, (x, y))
