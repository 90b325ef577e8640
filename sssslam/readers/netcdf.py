"""The open container: a recording as a NetCDF-4 file, through xarray; what is written reads back as it was."""

import json
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr

from frontend.arrays import AnyArray
from frontend.georeference import Georeference
from frontend.heightfield import Heightfield
from frontend.recording import Quantity, Recording, SonarGeometry, Truth
from frontend.trajectory import Trajectory
from sssslam.readers.netcdf_layout import (
    LEVER_ARMS,
    OPTIONAL,
    POSES,
    SLANT_RANGE_MAX,
    SONAR,
    TIME_UNITS,
    is_unit,
)
from sssslam.readers.netcdf_writing import write_netcdf

__all__ = ["read_netcdf", "write_netcdf"]

# Twice the memory of a large workstation's recording; more is a damaged header [bytes]. So is more, over what a small
# file may hold, than the deflation of zeros gives.
_MAX_BYTES, _MAX_RATIO, _SMALL = 1 << 36, 1100, 1 << 24
# What the libraries of the container raise where it is damaged.
_DAMAGE = (
    *(OSError, RuntimeError, LookupError, AttributeError, TypeError),
    *(ArithmeticError, UnicodeError, MemoryError, AssertionError),
)


def read_netcdf(path: str | Path) -> Recording:
    """Read a recording from the open container.

    Parameters
    ----------
    path : str or Path
        The file: one that `write_netcdf` wrote, or another with at least ``ping_time``, ``port``, ``starboard``,
        ``sample_spacing`` or ``slant_range_max``, ``sound_speed``, ``x y z`` and ``roll pitch yaw``.

    Returns
    -------
    recording : Recording
        The recording.

    Raises
    ------
    ValueError
        If the file cannot be read, or lacks or contradicts what is wanted.
    """
    path = Path(path)
    try:
        return _read(path)
    except _DAMAGE as error:
        raise ValueError(f"{path}: the container is damaged ({_in_one_line(error)})") from None
    except ValueError as error:
        raise ValueError(f"{path}: {_in_one_line(error)}") from None


def _in_one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _read(path: Path) -> Recording:
    root = _open(path, None)
    with netCDF4.Dataset(path) as file:
        groups = list(file.groups)
        sensors = list(file.groups["sensors"].groups) if "sensors" in groups else []
    spacing = _sample_spacing(root)
    n_pings = len(spacing)
    optional = [
        _values(root, name, unit) if name in root else np.full(n_pings, np.nan) for name, (unit, _) in OPTIONAL.items()
    ]
    altitude, depth, speed = optional
    return Recording(
        port=_side(root, "port"),
        starboard=_side(root, "starboard"),
        sample_spacing=spacing,
        sound_speed=_values(root, "sound_speed", "m/s"),
        trajectory_dr=_trajectory(root),
        altitude=altitude,
        depth=depth,
        speed=speed,
        sonar=_sonar(root.attrs),
        georeference=_georeference(root.attrs),
        source=str(root.attrs.get("source", "")),
        source_sha256=str(root.attrs.get("source_sha256", "")),
        notes=_notes(root.attrs.get("notes", "")),
        n_dropped=int(root.attrs.get("n_dropped", 0)),
        truth=_read_truth(_open(path, "truth")) if "truth" in groups else None,
        sensors={name: _series(_open(path, f"sensors/{name}")) for name in sensors},
    )


def _open(path: Path, group: str | None) -> xr.Dataset:
    with xr.open_dataset(path, group=group, engine="netcdf4", decode_times=False, decode_coords=False) as dataset:
        most = min(_MAX_BYTES, max(_MAX_RATIO * path.stat().st_size, _SMALL))
        if dataset.nbytes > most:
            raise ValueError(
                f"the container says it holds {dataset.nbytes / 1e6:.4g} MB; at most {most / 1e6:.4g} MB fit in it"
            )
        return dataset.load()


def _values(dataset: xr.Dataset, name: str, unit: str, dimensions: tuple[str, ...] = ("ping",)) -> AnyArray:
    """A variable of the layout, refused if it is missing, has other axes or another unit."""
    if name not in dataset:
        raise ValueError(f"the variable {name} is missing; {name}({', '.join(dimensions)}) is wanted")
    variable = dataset[name]
    given = str(variable.attrs.get("units", unit))
    if not is_unit(given, unit):
        raise ValueError(f"{name} is in {given!r}; {unit!r} is wanted")
    if set(variable.dims) != set(dimensions):
        raise ValueError(
            f"{name} has the dimensions ({', '.join(map(str, variable.dims))}); ({', '.join(dimensions)}) is wanted"
        )
    if variable.dtype.kind not in "fiu":
        raise ValueError(f"{name} is of type {variable.dtype}; numbers are wanted")
    values = variable.transpose(*dimensions).to_numpy()
    return values if values.dtype.kind == "f" else values.astype(np.float64)


def _side(root: xr.Dataset, side: str) -> AnyArray:
    return np.ascontiguousarray(_values(root, side, "1", ("ping", "sample")), dtype=np.float32)


def _sample_spacing(root: xr.Dataset) -> AnyArray:
    if "sample_spacing" in root or "slant_range_max" not in root:
        return _values(root, "sample_spacing", "m")
    return _values(root, "slant_range_max", SLANT_RANGE_MAX[0]) / _side(root, "port").shape[1]


def _trajectory(dataset: xr.Dataset) -> Trajectory:
    return Trajectory(_ping_time(dataset), *(_values(dataset, name, unit) for name, (unit, _) in POSES.items()))


def _ping_time(dataset: xr.Dataset) -> AnyArray:
    """Seconds since 1970; another unit of time is converted by its CF description."""
    if "ping_time" not in dataset or dataset["ping_time"].attrs.get("units", TIME_UNITS) in (TIME_UNITS, "s"):
        unit = dataset["ping_time"].attrs.get("units", "s") if "ping_time" in dataset else "s"
        return _values(dataset, "ping_time", unit)
    decoded = xr.decode_cf(dataset[["ping_time"]].reset_coords())["ping_time"]
    if decoded.dtype.kind != "M":
        raise ValueError(f"ping_time is in {dataset['ping_time'].attrs['units']!r}; {TIME_UNITS!r} is wanted")
    return (decoded.to_numpy() - np.datetime64(0, "s")) / np.timedelta64(1, "s")


def _sonar(attributes: dict[str, Any]) -> SonarGeometry:
    """The sonar as the attributes describe it; any of them may be missing."""
    arms = [np.asarray(attributes.get(name, (0.0, 0.0, 0.0)), dtype=np.float64) for name in LEVER_ARMS]
    for name, arm in zip(LEVER_ARMS, arms, strict=True):
        if arm.shape != (3,):
            raise ValueError(f"{name} has {arm.size} numbers; forward, port and up are wanted")
    port, starboard = ((float(f), float(p), float(u)) for f, p, u in arms)
    numbers = (float(attributes.get(name, np.nan)) for name in SONAR)
    # The one NaN object, so that sonars with unknown numbers compare equal.
    frequency, horizontal, vertical, depression = (np.nan if np.isnan(n) else n for n in numbers)
    return SonarGeometry(frequency, horizontal, vertical, depression, port, starboard, _quantity(attributes))


def _georeference(attributes: dict[str, Any]) -> Georeference | None:
    if "origin_latitude" in attributes and "origin_longitude" in attributes:
        return Georeference(float(attributes["origin_latitude"]), float(attributes["origin_longitude"]))
    return None


def _quantity(attributes: dict[str, Any]) -> Quantity:
    given = str(attributes.get("quantity", Quantity.UNKNOWN))
    if given not in list(Quantity):
        raise ValueError(f"quantity is {given!r}; {', '.join(Quantity)} is wanted")
    return Quantity(given)


def _notes(given: object) -> tuple[str, ...]:
    """The notes; a text of another writer is one note."""
    try:
        notes = json.loads(str(given)) if given != "" else []
    except json.JSONDecodeError:
        notes = [given]
    return tuple(map(str, notes)) if isinstance(notes, list) else (str(given),)


def _read_truth(group: xr.Dataset) -> Truth:
    terrain = None
    if "terrain" in group:
        z = _values(group, "terrain", "m", ("terrain_y", "terrain_x"))
        spacing, origin = _terrain_grid(group)
        terrain = Heightfield(z, spacing, origin)
    return Truth(_trajectory(group), terrain)


def _terrain_grid(group: xr.Dataset) -> tuple[float, tuple[float, float]]:
    """Spacing and origin of the terrain, from the attributes or else from its axes."""
    if "terrain_spacing" in group.attrs and "terrain_origin" in group.attrs:
        x, y = map(float, group.attrs["terrain_origin"])
        return float(group.attrs["terrain_spacing"]), (x, y)
    x_axis, y_axis = (_values(group, name, "m", (name,)) for name in ("terrain_x", "terrain_y"))
    steps = np.concatenate([np.diff(x_axis), np.diff(y_axis)])
    if not steps.size or not np.allclose(steps, steps[0], rtol=1e-6) or steps[0] <= 0:
        raise ValueError("the axes of terrain are not evenly spaced; one positive spacing is wanted")
    return float(steps[0]), (float(x_axis[0]), float(y_axis[0]))


def _series(group: xr.Dataset) -> dict[str, AnyArray]:
    return {str(name): variable.to_numpy() for name, variable in group.variables.items()}
