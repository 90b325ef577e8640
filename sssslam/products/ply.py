"""Submaps as binary PLY: points with normals, sigma, shadow flags and reflectivity; written and read.

The comments of the header hold the rest of the submap, so that reading gives the submap back.
"""

import os
from pathlib import Path
from typing import Any

import numpy as np

from frontend.arrays import AnyArray, FloatArray
from frontend.frames import attitude_from_rotation, planar_parameters, planar_pose, pose, rotation_world_body
from frontend.heightfield import Heightfield
from frontend.submaps import Submap

_VERTEX = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz", "sigma")] + [("shadow", "u1"), ("reflectivity", "<f4")]
)
_TYPES = {"<f4": "float", "|u1": "uchar"}
_MAX_HEADER = 1 << 16  # bytes; ours is below 2 kB
_MAX_CELLS = 10**8  # a damaged header must not ask for all memory; a submap has about 10**5


def format_ply(submap: Submap, T_world_submap: FloatArray) -> bytes:
    """A submap as a binary little-endian PLY file.

    Parameters
    ----------
    submap : Submap
        The submap; each cell that has a height becomes a vertex in the submap's level frame.
    T_world_submap : ndarray, shape (4, 4)
        The corrected pose of that frame; kept in a comment for viewers.

    Returns
    -------
    content : bytes
        Vertices ``x y z nx ny nz sigma shadow reflectivity``: metres, shadow 0 or 1, reflectivity relative to the
        mean of the dive (linear).
    """
    vertices = np.empty(len(submap.points), dtype=_VERTEX)
    columns = [*submap.points.T, *submap.normals.T, submap.sigmas, submap.shadow, np.exp(submap.reflectivity)]
    for name, column in zip(_VERTEX.names or (), columns, strict=True):
        vertices[name] = column
    return _header(submap, T_world_submap, len(vertices)).encode("ascii") + vertices.tobytes()


def _header(submap: Submap, T_world_submap: FloatArray, n_vertices: int) -> str:
    surface, roll_pitch_yaw = submap.surface, attitude_from_rotation(submap.T_submap_body[:3, :3])
    comments: dict[str, list[Any]] = {
        "submap": [submap.number],
        "pings": [submap.first_ping, submap.end_ping, submap.anchor_ping],
        "anchor_time": [f"{submap.anchor_time:.6f}"],
        "grid": [surface.spacing, *surface.origin, *reversed(surface.z.shape)],
        "attitude": [float(angle) for angle in roll_pitch_yaw],
        "pose_dr": _pose_comment(submap.T_world_submap_dr),
        "pose": _pose_comment(T_world_submap),
    }
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += ["comment sssslam: metres and radians; level frame of the anchor ping, x along its heading, z up"]
    lines += [f"comment {key} {' '.join(str(value) for value in values)}" for key, values in comments.items()]
    lines += [f"element vertex {n_vertices}"]
    lines += [f"property {_TYPES[_VERTEX[name].str]} {name}" for name in _VERTEX.names or ()]
    return "\n".join([*lines, "end_header", ""])


def _pose_comment(T_world_submap: FloatArray) -> list[float]:
    x, y, yaw = planar_parameters(T_world_submap)
    return [x, y, float(T_world_submap[2, 3]), yaw]


def read_ply(path: str | os.PathLike[str]) -> tuple[Submap, FloatArray]:
    """Read a submap from a PLY file of a run.

    Parameters
    ----------
    path : path-like
        ``submaps/0000.ply`` or a later one.

    Returns
    -------
    submap : Submap
        The submap; heights and rasters have the 24 bits of the file, and no shadow is known outside the vertices.
    T_world_submap : ndarray, shape (4, 4)
        The corrected pose of its frame.

    Raises
    ------
    ValueError
        If the file cannot be read, is cut, or is not a submap of a run.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise ValueError(f"{path}: a submap (PLY) is wanted, cannot read it ({error.strerror})") from None
    header, mark, body = content.partition(b"end_header\n")
    if not content.startswith(b"ply\nformat binary_little_endian 1.0\n") or not mark or len(header) > _MAX_HEADER:
        raise ValueError(f"{path}: a binary little-endian PLY file is wanted, the header is not of one")
    lines = header.decode("ascii", errors="replace").splitlines()
    try:
        return _parse_submap(_comments(lines), _parse_vertices(lines, body))
    except (KeyError, ValueError, IndexError) as error:
        raise ValueError(
            f"{path}: a submap that sssslam wrote is wanted, this is none or is damaged ({error})"
        ) from None


def _comments(lines: list[str]) -> dict[str, list[str]]:
    return {words[1]: words[2:] for line in lines if len(words := line.split()) > 2 and words[0] == "comment"}


def _parse_vertices(lines: list[str], body: bytes) -> AnyArray:
    elements = [line.split() for line in lines if line.startswith("element")]
    properties = [line for line in lines if line.startswith("property")]
    if properties != [f"property {_TYPES[_VERTEX[name].str]} {name}" for name in _VERTEX.names or ()]:
        raise ValueError(f"vertices must have {' '.join(_VERTEX.names or ())}")
    n_vertices = int(elements[0][2])
    if len(body) != n_vertices * _VERTEX.itemsize:
        raise ValueError(f"{n_vertices} vertices need {n_vertices * _VERTEX.itemsize} bytes, got {len(body)}")
    return np.frombuffer(body, dtype=_VERTEX)


def _parse_submap(comments: dict[str, list[str]], vertices: AnyArray) -> tuple[Submap, FloatArray]:
    spacing, x, y = (float(word) for word in comments["grid"][:3])
    n_x, n_y = (int(word) for word in comments["grid"][3:])
    rasters = _rasterise(vertices, (spacing, x, y), (n_y, n_x))
    first_ping, end_ping, anchor_ping = (int(word) for word in comments["pings"])
    roll, pitch, yaw = (float(word) for word in comments["attitude"])
    submap = Submap(
        number=int(comments["submap"][0]),
        first_ping=first_ping,
        end_ping=end_ping,
        anchor_ping=anchor_ping,
        anchor_time=float(comments["anchor_time"][0]),
        T_world_submap_dr=_parse_pose(comments["pose_dr"]),
        T_submap_body=pose([0.0, 0.0, 0.0], rotation_world_body(roll, pitch, yaw)),
        surface=Heightfield(rasters["z"], spacing, (x, y)),
        sigma=rasters["sigma"],
        log_reflectivity=np.log(rasters["reflectivity"]),
        is_shadow=rasters["shadow"] == 1.0,
    )
    return submap, _parse_pose(comments["pose"])


def _rasterise(vertices: AnyArray, grid: tuple[float, float, float], shape: tuple[int, int]) -> dict[str, FloatArray]:
    spacing, x, y = grid
    if not (spacing > 0 and min(shape) > 0 and shape[0] * shape[1] <= _MAX_CELLS):
        raise ValueError(f"the grid must have 1 to {_MAX_CELLS} cells, got {shape[1]} x {shape[0]} of {spacing} m")
    columns = np.rint((vertices["x"].astype(np.float64) - x) / spacing).astype(np.int64)
    rows = np.rint((vertices["y"].astype(np.float64) - y) / spacing).astype(np.int64)
    if vertices.size and (rows.min() < 0 or columns.min() < 0 or rows.max() >= shape[0] or columns.max() >= shape[1]):
        raise ValueError(f"vertices must lie on the grid of {shape[1]} x {shape[0]} cells, some lie outside")
    rasters = {name: np.full(shape, np.nan) for name in ("z", "sigma", "shadow", "reflectivity")}
    for name, raster in rasters.items():
        raster[rows, columns] = vertices[name]
    return rasters


def _parse_pose(words: list[str]) -> FloatArray:
    x, y, z, yaw = (float(word) for word in words)
    return planar_pose(x, y, yaw, z)
