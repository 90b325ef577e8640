"""The corrected track as a table, and both tracks for a map viewer."""

import csv
import io
import json
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from frontend.arrays import FloatArray
from frontend.frames import wrap_angle
from frontend.georeference import Georeference
from frontend.loop_closures import LoopClosure
from frontend.trajectory import Trajectory

SIGMA_COLUMNS = ("sigma_x", "sigma_y", "sigma_z", "sigma_yaw")
TRAJECTORY_COLUMNS = ("time", "x", "y", "z", "roll", "pitch", "yaw", *SIGMA_COLUMNS)


def format_number(value: float, decimals: int = 6) -> str:
    """A number in fixed notation; unknown is empty and zero has no sign.

    Parameters
    ----------
    value : float
        The number; NaN and infinity are unknown.
    decimals : int
        Digits behind the point.

    Returns
    -------
    text : str
        The number, or nothing.
    """
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}" if np.isfinite(value) else ""


def format_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Rows of text as comma-separated values under a header.

    Parameters
    ----------
    columns : sequence of str
        The header.
    rows : iterable of sequence of str
        The cells.

    Returns
    -------
    text : str
        Lines that end with a line feed.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue()


def format_trajectory_csv(trajectory: Trajectory, sigmas: FloatArray, georeference: Georeference | None) -> str:
    """The corrected track with its standard deviations as comma-separated values.

    Parameters
    ----------
    trajectory : Trajectory
        N poses.
    sigmas : ndarray, shape (N, 4)
        Standard deviations of x, y, z [m] and yaw [rad].
    georeference : Georeference or None
        Where the frame lies; known, it adds latitude and longitude [deg].

    Returns
    -------
    text : str
        A header and N rows: metres and radians (in [-pi, pi)) to 6 decimals, degrees to 9 (0.1 mm).
    """
    attitude = [wrap_angle(angle) for angle in (trajectory.roll, trajectory.pitch, trajectory.yaw)]
    values = np.column_stack([trajectory.time, trajectory.positions, *attitude, sigmas])
    rows = [[format_number(value) for value in row] for row in values]
    if georeference is None:
        return format_table(TRAJECTORY_COLUMNS, rows)
    positions = np.column_stack(georeference.to_geographic(trajectory.x, trajectory.y))
    located = [[*row, *(format_number(v, 9) for v in position)] for row, position in zip(rows, positions, strict=True)]
    return format_table((*TRAJECTORY_COLUMNS, "latitude", "longitude"), located)


def format_geojson(
    tracks: dict[str, Trajectory],
    loop_closures: Sequence[LoopClosure],
    anchors: dict[int, FloatArray],
    georeference: Georeference,
) -> str:
    """Tracks and accepted loop closures as GeoJSON lines (WGS 84, longitude first).

    Parameters
    ----------
    tracks : dict of str to Trajectory
        Tracks by name.
    loop_closures : sequence of LoopClosure
        Candidates; those accepted are drawn.
    anchors : dict of int to ndarray, shape (2,)
        Corrected x and y of each submap's anchor [m].
    georeference : Georeference
        Where the frame lies.

    Returns
    -------
    text : str
        A FeatureCollection.
    """
    features = [_line({"name": name}, track.x, track.y, georeference) for name, track in tracks.items()]
    for closure in (closure for closure in loop_closures if closure.accepted):
        x, y = np.transpose([anchors[closure.target], anchors[closure.source]])
        properties = {"name": "loop_closure", "target": closure.target, "source": closure.source}
        features.append(_line(properties, x, y, georeference))
    return json.dumps({"type": "FeatureCollection", "features": features}, indent=1, allow_nan=False) + "\n"


def _line(properties: dict[str, object], x: ArrayLike, y: ArrayLike, georeference: Georeference) -> dict[str, object]:
    latitude, longitude = georeference.to_geographic(x, y)
    positions = np.round(np.column_stack([longitude, latitude]), 9).tolist()
    if len(positions) > 1:
        geometry = {"type": "LineString", "coordinates": positions}
    else:
        geometry = {"type": "Point", "coordinates": positions[0]}
    return {"type": "Feature", "properties": properties, "geometry": geometry}
