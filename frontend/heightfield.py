"""A height for every cell of a regular horizontal grid: terrain, submap rasters, maps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import map_coordinates

from frontend.arrays import FloatArray


@dataclass(frozen=True)
class Heightfield:
    """Heights on a grid; the first axis runs along y (north), the second along x (east).

    Parameters
    ----------
    z : ndarray, shape (n_y, n_x)
        Heights at the cell centres [m]; NaN where unknown.
    spacing : float
        Distance between cell centres [m].
    origin : tuple of float
        x and y of the centre of cell ``z[0, 0]`` [m].
    """

    z: FloatArray
    spacing: float
    origin: tuple[float, float]

    @property
    def x(self) -> FloatArray:
        """Shape (n_x,): x of the cell centres [m]."""
        return np.asarray(self.origin[0] + self.spacing * np.arange(self.z.shape[1]), dtype=np.float64)

    @property
    def y(self) -> FloatArray:
        """Shape (n_y,): y of the cell centres [m]."""
        return np.asarray(self.origin[1] + self.spacing * np.arange(self.z.shape[0]), dtype=np.float64)

    def sample(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Heights at positions, by bilinear interpolation.

        Parameters
        ----------
        x, y : array_like, shape (...)
            Positions [m].

        Returns
        -------
        z : ndarray, shape (...)
            Heights [m]; NaN outside the grid and beside unknown cells.
        """
        column = (np.asarray(x, dtype=np.float64) - self.origin[0]) / self.spacing
        row = (np.asarray(y, dtype=np.float64) - self.origin[1]) / self.spacing
        place = np.stack(np.broadcast_arrays(row, column))
        z = map_coordinates(self.z, place.reshape(2, -1), order=1, mode="constant", cval=np.nan)
        return np.asarray(z.reshape(place.shape[1:]))
