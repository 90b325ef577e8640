"""Sonar lines registered in three dimensions.

A line lies in the beam plane of its ping. Its cells are counted along the horizontal direction in that plane (across,
to port) and its relief stands up from a flat floor along the direction in the plane that is orthogonal to it (up), so
that pitch tilts the relief, yaw turns it and roll only changes which cells are insonified.
"""

from dataclasses import dataclass, replace

import numpy as np

from frontend.arrays import FloatArray, IntArray
from frontend.frames import attitude_from_rotation, rotation_world_body
from frontend.geometry import PORT, STARBOARD, altitude_from_first_return
from frontend.reconstruction.window_data import WindowData


@dataclass(frozen=True)
class LineFrames:
    """Where L lines of C cells look from, in the submap frame.

    Parameters
    ----------
    pings : ndarray of int, shape (L, G)
        Pings of the window averaged to each line.
    sensor : ndarray, shape (L, 3)
        Midpoint of the transducers [m].
    across, forward, up : ndarray, shape (L, 3)
        Orthonormal: horizontal in the beam plane to port, normal of the beam plane, up in the beam plane.
    distance : ndarray, shape (L,)
        From the sensor to the flat floor, against ``up`` [m].
    roll, pitch : ndarray, shape (L,)
        Attitude [rad].
    arms : ndarray, shape (L, 2, 2)
        Port and starboard transducer about the sensor, along ``across`` and ``up`` [m].
    cell : ndarray, shape (C,)
        Middles of the cells, positive to port [m].
    spacing : float
        Size of a cell [m].
    """

    pings: IntArray
    sensor: FloatArray
    across: FloatArray
    forward: FloatArray
    up: FloatArray
    distance: FloatArray
    roll: FloatArray
    pitch: FloatArray
    arms: FloatArray
    cell: FloatArray
    spacing: float

    @property
    def shape(self) -> tuple[int, int]:
        """Lines and cells a line."""
        return len(self.sensor), len(self.cell)

    @property
    def side(self) -> IntArray:
        """Shape (C,): side that looks at each cell."""
        return np.where(self.cell > 0, PORT, STARBOARD)

    @property
    def horizontal(self) -> FloatArray:
        """Shape (L, C): across distance of each cell from its transducer, positive to port [m]."""
        return np.asarray(self.cell[None, :] - self.arms[:, self.side, 0])

    @property
    def vertical(self) -> FloatArray:
        """Shape (L, C): distance of the flat floor below the transducer, in the beam plane [m]."""
        return np.asarray(self.distance[:, None] + self.arms[:, self.side, 1])

    def points(self, relief: FloatArray) -> FloatArray:
        """Place the lines in space.

        Parameters
        ----------
        relief : ndarray, shape (L, C)
            Relief above the flat floor of each line, along ``up`` [m].

        Returns
        -------
        points : ndarray, shape (L, C, 3)
            Cells in the submap frame [m].
        """
        out = self.cell[None, :, None] * self.across[:, None, :]
        rise = (relief - self.distance[:, None])[..., None] * self.up[:, None, :]
        return np.asarray(self.sensor[:, None, :] + out + rise)

    def relief(self, z: FloatArray) -> FloatArray:
        """Relief of cells of known height; the inverse of `points` for z.

        Parameters
        ----------
        z : ndarray, shape (L, C)
            Heights in the submap frame [m].

        Returns
        -------
        relief : ndarray, shape (L, C)
            Relief above the flat floor of each line, along ``up`` [m].
        """
        return np.asarray((z - self.sensor[:, 2:]) / self.up[:, 2:] + self.distance[:, None])


def with_heave(data: WindowData) -> WindowData:
    """The window with altitudes from the first bottom return.

    Parameters
    ----------
    data : WindowData
        The window.

    Returns
    -------
    data : WindowData
        The same, altitude that of the nearer side's first return under the pitch (equation 1 of the paper): it follows
        the heave ping by ping, and no roll tilts it, as a fan with its sidelobes reaches nadir on one side or other.
    """
    _, pitch, _ = attitude_from_rotation(data.T_submap_pings[:, :3, :3])
    level = np.zeros(len(pitch))
    altitude = altitude_from_first_return(data.first_bottom_return, (level, pitch), 0.0).min(axis=1)
    return replace(data, altitude=altitude)


def frame_lines(data: WindowData, spacing: float) -> LineFrames:
    """Average pings to lines about as far apart as their cells are wide.

    Parameters
    ----------
    data : WindowData
        The window.
    spacing : float
        Size of a cell [m].

    Returns
    -------
    frames : LineFrames
        Lines at the mean pose of their pings; pings that do not fill a line at the end are left out.
    """
    pings = _groups(data, spacing)
    roll, pitch, yaw = attitude_from_rotation(data.T_submap_pings[:, :3, :3])
    roll, pitch, yaw = (np.asarray(a[pings].mean(axis=1), dtype=np.float64) for a in (roll, pitch, np.unwrap(yaw)))
    axes = rotation_world_body(np.zeros_like(roll), pitch, yaw)
    transducers = np.asarray(data.sensors[pings].mean(axis=1), dtype=np.float64)
    sensor = transducers.mean(axis=1)
    floor = (data.sensors[:, :, 2].mean(axis=1) - data.altitude)[pings].mean(axis=1)
    distance = np.asarray((sensor[:, 2] - floor) / axes[:, 2, 2], dtype=np.float64)
    arms = np.asarray(np.einsum("lsi,lik->lsk", transducers - sensor[:, None], axes[:, :, 1:]))
    n = max(2, int(np.ceil(np.sqrt(max(data.slant_range_max**2 - distance.min() ** 2, 0.0)) / spacing)))
    cell = np.asarray((np.arange(2 * n) - n + 0.5) * spacing, dtype=np.float64)
    forward, across, up = axes[:, :, 0], axes[:, :, 1], axes[:, :, 2]
    return LineFrames(pings, sensor, across, forward, up, distance, roll, pitch, arms, cell, spacing)


def _groups(data: WindowData, spacing: float) -> IntArray:
    """Shape (L, G): as many pings a line as make it about square cells, at least four lines if there are the pings."""
    place = data.sensors[:, 0, :2]
    n = len(place)
    step = float(np.median(np.hypot(*np.diff(place, axis=0).T))) if n > 1 else spacing
    size = int(np.clip(np.round(spacing / max(step, 1e-3)), 1, max(1, n // 4)))
    return np.arange(n // size * size).reshape(-1, size)
