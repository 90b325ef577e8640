"""A trajectory: poses of the body in the world, one a ping."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from frontend.arrays import AnyArray, FloatArray
from frontend.frames import attitude_from_rotation, pose, rotation_world_body


@dataclass(frozen=True)
class Trajectory:
    """Body poses over time; where they come from is said by the name of the variable that holds them.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Seconds since 1970 UTC, strictly increasing.
    x, y, z : ndarray, shape (N,)
        Position in the world frame (ENU) [m].
    roll, pitch, yaw : ndarray, shape (N,)
        Attitude [rad]: starboard down, nose down, counter-clockwise from east.
    """

    time: FloatArray
    x: FloatArray
    y: FloatArray
    z: FloatArray
    roll: FloatArray
    pitch: FloatArray
    yaw: FloatArray

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, pings: slice | AnyArray) -> Self:
        return type(self)(*(getattr(self, name)[pings] for name in ("time", "x", "y", "z", "roll", "pitch", "yaw")))

    @classmethod
    def from_poses(cls, time: ArrayLike, T_world_body: ArrayLike) -> Self:
        """Make a trajectory of homogeneous transforms.

        Parameters
        ----------
        time : array_like, shape (N,)
            Seconds since 1970 UTC.
        T_world_body : array_like, shape (N, 4, 4)
            Body poses.

        Returns
        -------
        trajectory : Trajectory
            The same poses.
        """
        T = np.asarray(T_world_body, dtype=np.float64)
        x, y, z = T[:, :3, 3].T
        return cls(np.asarray(time, dtype=np.float64), x, y, z, *attitude_from_rotation(T[:, :3, :3]))

    def joined(self, later: Self) -> Self:
        """This trajectory and the one after it.

        Parameters
        ----------
        later : Trajectory
            Poses that come after these.

        Returns
        -------
        trajectory : Trajectory
            Both.
        """
        names = ("time", "x", "y", "z", "roll", "pitch", "yaw")
        return type(self)(*(np.concatenate([getattr(self, name), getattr(later, name)]) for name in names))

    @property
    def positions(self) -> FloatArray:
        """Shape (N, 3): positions in the world frame [m]."""
        return np.stack([self.x, self.y, self.z], axis=-1)

    @property
    def poses(self) -> FloatArray:
        """Shape (N, 4, 4): the poses as ``T_world_body``."""
        return pose(self.positions, rotation_world_body(self.roll, self.pitch, self.yaw))

    @property
    def distance(self) -> FloatArray:
        """Shape (N,): horizontal distance run since the first ping [m]."""
        step = np.hypot(np.diff(self.x), np.diff(self.y))
        return np.concatenate([[0.0], np.cumsum(step)])

    @property
    def ping_spacing(self) -> float:
        """Median distance run between pings [m]; NaN for fewer than two."""
        steps = np.diff(self.distance)
        return float(np.median(steps)) if steps.size else float("nan")
