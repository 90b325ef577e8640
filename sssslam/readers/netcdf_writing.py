"""Writing the open container; the same recording gives the same bytes."""

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import netCDF4
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
    with _replaced(Path(path)) as temporary:
        _write(recording, temporary, min(_CHUNK_PINGS, recording.n_pings), ())


def write_netcdf_chunks(recordings: Iterable[Recording], path: str | Path) -> None:
    """Write a dive to the open container piece by piece; it reads back as if written at once.

    Parameters
    ----------
    recordings : iterable of Recording
        The pieces of the dive in the order of time, each with the sensors' answers from its own span; two are in
        memory at a time. What is not one row a ping (source, notes, terrain) is the first one's.
    path : str or Path
        The file; one that exists is replaced once the new one is whole.

    Raises
    ------
    ValueError
        If there is no recording, one does not follow the one before it, or the file cannot be written.
    """
    with _replaced(Path(path)) as temporary:
        previous = None
        for recording in recordings:
            if previous is None:
                _write(recording, temporary, _CHUNK_PINGS, ("ping", "time"))
            else:
                _check_follows(previous, recording)
                _append(recording, temporary)
            previous = recording
        if previous is None:
            raise ValueError("no recording given, at least one wanted")


@contextmanager
def _replaced(path: Path) -> Iterator[Path]:
    """A file to write that takes the path's place once it is whole."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield temporary
        temporary.replace(path)
    except (OSError, RuntimeError) as error:  # the latter from HDF5, on a full disk
        raise ValueError(f"{path}: cannot be written ({getattr(error, 'strerror', None) or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


def _write(recording: Recording, path: Path, chunk: int, growing: tuple[str, ...]) -> None:
    """Write the root group and those of truth and sensors; growing dimensions take more rows later."""
    chunks = (chunk, recording.n_samples)
    encoding = {side: {"zlib": True, "complevel": 1, "shuffle": True, "chunksizes": chunks} for side in SIDES}
    _group(_root(recording), path, None, growing, encoding)
    if recording.truth is not None:
        _group(_truth(recording.truth), path, "truth", growing, {})
    for name, series in sorted(recording.sensors.items()):
        _group(_sensor(series), path, f"sensors/{name}", growing, {})


def _group(dataset: xr.Dataset, path: Path, group: str | None, growing: tuple[str, ...], encoding: Any) -> None:
    unlimited = [name for name in growing if name in dataset.dims]
    mode: Literal["w", "a"] = "w" if group is None else "a"
    dataset.to_netcdf(path, mode, group=group, engine="netcdf4", encoding=encoding, unlimited_dims=unlimited)


def _append(recording: Recording, path: Path) -> None:
    """Add the rows of the next piece; a sensor that has not spoken before gets its group."""
    with netCDF4.Dataset(path, "a") as file:
        known = set(file.groups["sensors"].groups) if "sensors" in file.groups else set()
        n_pings = len(file.dimensions["ping"])
        _extend(file, _root(recording), n_pings)
        if recording.truth is not None:
            _extend(file["truth"], _truth(replace(recording.truth, terrain=None)), n_pings)
        for name in sorted(known & set(recording.sensors)):
            _check_later(file[f"sensors/{name}"], recording.sensors[name], name)
            _extend(file[f"sensors/{name}"], _sensor(recording.sensors[name]), len(file[f"sensors/{name}/time"]))
    for name in sorted(set(recording.sensors) - known):
        _group(_sensor(recording.sensors[name]), path, f"sensors/{name}", ("time",), {})


def _extend(group: netCDF4.Group | netCDF4.Dataset, dataset: xr.Dataset, start: int) -> None:
    for name, variable in dataset.variables.items():
        group[str(name)][start : start + variable.shape[0]] = variable.to_numpy()


def _check_follows(previous: Recording, recording: Recording) -> None:
    """Refuse a piece of another recording, and one that does not come after the one before."""
    given, wanted = (
        (piece.n_samples, piece.sonar, piece.georeference, piece.truth is None) for piece in (recording, previous)
    )
    if given != wanted:
        raise ValueError("pieces with different samples, sonar, place or truth given, pieces of one recording wanted")
    start, end = float(recording.ping_time[0]), float(previous.ping_time[-1])
    if start <= end:
        raise ValueError(f"a piece that begins at {start} s after one that ends at {end} s given, a later one wanted")


def _check_later(group: netCDF4.Group, series: dict[str, AnyArray], name: str) -> None:
    """Refuse a sensor's answers that were written before, and series that are not the ones begun."""
    if set(group.variables) != set(series):
        raise ValueError(f"the {name}'s series {sorted(series)} given, {sorted(group.variables)} wanted as before")
    if group["time"].size and series["time"].size and series["time"][0] <= group["time"][-1]:
        raise ValueError(f"answers of the {name} at {series['time'][0]} s given again, only those of the piece wanted")


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
