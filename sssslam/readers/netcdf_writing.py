"""Writing the open container; the same recording gives the same bytes."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from frontend.arrays import AnyArray
from frontend.recording import Recording, Truth
from frontend.trajectory import Trajectory
from sssslam.readers.netcdf_layout import (
    FORMAT,
    GEOMETRY,
    LEVER_ARMS,
    OPTIONAL,
    POSES,
    SIDES,
    SONAR,
    TERRAIN,
    TIME_UNITS,
    sensor_unit,
)

_CHUNK_PINGS = 256


def write_netcdf(recording: Recording, path: str | Path) -> None:
    """Write a recording to the open container.

    Parameters
    ----------
    recording : Recording
        The recording.
    path : str or Path
        The file; one that exists is replaced once the new one is whole.

    Raises
    ------
    ValueError
        If the file cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        _write(recording, temporary)
        temporary.replace(path)
    except OSError as error:
        raise ValueError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


def _write(recording: Recording, path: Path) -> None:
    """Write the root group and those of truth and sensors."""
    chunks = (min(_CHUNK_PINGS, recording.n_pings), recording.n_samples)
    encoding = {side: {"zlib": True, "complevel": 1, "shuffle": True, "chunksizes": chunks} for side in SIDES}
    _root(recording).to_netcdf(path, mode="w", encoding=encoding, engine="netcdf4")
    if recording.truth is not None:
        _truth(recording.truth).to_netcdf(path, mode="a", group="truth", engine="netcdf4")
    for name, series in sorted(recording.sensors.items()):
        _sensor(series).to_netcdf(path, mode="a", group=f"sensors/{name}", engine="netcdf4")


def _variable(dimensions: tuple[str, ...], values: AnyArray, unit: str, long_name: str) -> xr.Variable:
    return xr.Variable(dimensions, values, {"units": unit, "long_name": long_name}, {"_FillValue": None})


def _root(recording: Recording) -> xr.Dataset:
    variables = {side: _variable(("ping", "sample"), getattr(recording, side), *SIDES[side]) for side in SIDES}
    for name, (unit, long_name) in (GEOMETRY | OPTIONAL).items():
        variables[name] = _variable(("ping",), getattr(recording, name), unit, long_name)
    variables |= _poses(recording.trajectory_dr)
    return xr.Dataset(variables, attrs=_attributes(recording))


def _poses(trajectory: Trajectory) -> dict[str, xr.Variable]:
    poses = {name: _variable(("ping",), getattr(trajectory, name), *POSES[name]) for name in POSES}
    return {"ping_time": _variable(("ping",), trajectory.time, TIME_UNITS, "time of the ping, UTC"), **poses}


def _attributes(recording: Recording) -> dict[str, Any]:
    sonar, place = recording.sonar, recording.georeference
    attributes: dict[str, Any] = {"format": FORMAT}
    for name, unit in SONAR.items():
        attributes |= {name: float(getattr(sonar, name)), f"{name}_units": unit}
    for name in LEVER_ARMS:
        attributes |= {name: np.array(getattr(sonar, name)), f"{name}_units": "m (forward, port, up)"}
    attributes["quantity"] = str(sonar.quantity)
    if place is not None:
        attributes |= {
            "origin_latitude": place.latitude,
            "origin_longitude": place.longitude,
            "crs": place.crs.to_wkt(),
        }
    # A list of words as JSON: a NetCDF attribute cannot tell one string from a list of one.
    attributes |= {"source": recording.source, "source_sha256": recording.source_sha256}
    return attributes | {"notes": json.dumps(recording.notes), "n_dropped": recording.n_dropped}


def _truth(truth: Truth) -> xr.Dataset:
    variables, attributes = _poses(truth.trajectory), {}
    if (terrain := truth.terrain) is not None:
        axes = {"terrain_x": ("terrain_x",), "terrain_y": ("terrain_y",), "terrain": ("terrain_y", "terrain_x")}
        values = {"terrain_x": terrain.x, "terrain_y": terrain.y, "terrain": terrain.z}
        variables |= {name: _variable(axes[name], values[name], *TERRAIN[name]) for name in TERRAIN}
        variables["terrain"].encoding |= {"zlib": True, "complevel": 1, "shuffle": True}
        attributes = {"terrain_spacing": float(terrain.spacing), "terrain_origin": np.array(terrain.origin)}
    return xr.Dataset(variables, attrs=attributes)


def _sensor(series: dict[str, AnyArray]) -> xr.Dataset:
    """The series of a sensor, by name: the first axis is time, the others are the series' own."""
    variables = {}
    for name, values in sorted(series.items()):
        axes = ("time", *(f"{name}_axis_{k}" for k in range(1, values.ndim)))
        variables[name] = _variable(axes, values, sensor_unit(name), name.replace("_", " "))
    return xr.Dataset(variables)
