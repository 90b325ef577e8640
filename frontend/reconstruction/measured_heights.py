"""Heights that are measured otherwise than by the brightness of echoes, as linear rows over the cells of a raster."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, vstack

from frontend.arrays import FloatArray, IntArray
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.window_data import WindowData


@dataclass(frozen=True)
class MeasuredHeights:
    """Weighted sums of the heights of a few cells each, and what was measured of them.

    Parameters
    ----------
    weights : csr_array, shape (N, n_cells)
        Weights of the cells.
    height : ndarray, shape (N,)
        What the sums should be, in the submap frame [m].
    precision : ndarray, shape (N,)
        Inverse variances [1/m^2].
    """

    weights: csr_array
    height: FloatArray
    precision: FloatArray

    def miss(self, z: FloatArray) -> FloatArray:
        """How far a surface is from what was measured.

        Parameters
        ----------
        z : ndarray, shape (n_y, n_x)
            Heights [m].

        Returns
        -------
        miss : ndarray, shape (N,)
            Sum less measurement [m].
        """
        return np.asarray(self.weights @ z.ravel() - self.height)

    def and_also(self, other: "MeasuredHeights") -> "MeasuredHeights":
        """All measurements of both.

        Parameters
        ----------
        other : MeasuredHeights
            Over the same raster.

        Returns
        -------
        both : MeasuredHeights
            First these, then those of the other.
        """
        weights = csr_array(vstack([self.weights, other.weights]))
        both = (np.concatenate(pair) for pair in ((self.height, other.height), (self.precision, other.precision)))
        return MeasuredHeights(weights, *both)


def bilinear(raster: Raster, places: FloatArray) -> tuple[IntArray, FloatArray]:
    """The four cells around each place, and what each weighs there.

    Parameters
    ----------
    raster : Raster
        The grid.
    places : ndarray, shape (N, 2)
        x and y in the submap frame [m]; what lies outside is taken to its rim.

    Returns
    -------
    cells : ndarray of int, shape (N, 4)
        Cell numbers.
    weights : ndarray, shape (N, 4)
        They add up to 1.
    """
    position = (places - np.array(raster.origin)) / raster.spacing
    position = np.clip(position, 0.0, np.array([raster.n_x, raster.n_y]) - 1.001)
    (column, row), (ax, ay) = position.astype(np.int64).T, (position % 1.0).T
    cells = np.stack([row * raster.n_x + column + o for o in (0, 1, raster.n_x, raster.n_x + 1)], axis=1)
    return cells, np.stack([(1 - ax) * (1 - ay), ax * (1 - ay), (1 - ax) * ay, ax * ay], axis=1)


def rows_of(raster: Raster, cells: IntArray, weights: FloatArray) -> csr_array:
    """A sparse matrix of rows of equal length.

    Parameters
    ----------
    raster : Raster
        The grid.
    cells : ndarray of int, shape (N, K)
        Cell numbers; one that comes twice counts twice.
    weights : ndarray, shape (N, K)
        Their weights.

    Returns
    -------
    matrix : csr_array, shape (N, n_cells)
        The rows.
    """
    n, k = cells.shape
    return csr_array((weights.ravel(), (np.repeat(np.arange(n), k), cells.ravel())), shape=(n, raster.n_cells))


def below_track(data: WindowData, raster: Raster, sigma: float, length: float) -> MeasuredHeights:
    """What the altimeter says.

    Parameters
    ----------
    data : WindowData
        The window.
    raster : Raster
        The grid.
    sigma : float
        Standard deviation of one measured height [m].
    length : float
        Track over which errors repeat [m].

    Returns
    -------
    measured : MeasuredHeights
        One row a ping; those of a length together count as one.
    """
    place = data.sensors[:, :, :2].mean(axis=1)
    height = data.sensors[:, :, 2].mean(axis=1) - data.altitude
    precision = share_of_length(place, length) / sigma**2
    return MeasuredHeights(rows_of(raster, *bilinear(raster, place)), height, precision)


def share_of_length(place: FloatArray, length: float) -> FloatArray:
    """How much of a measurement each of a row of neighbours is, where errors repeat over a length of track.

    Parameters
    ----------
    place : ndarray, shape (P, 2)
        Where each was taken, in order [m].
    length : float
        Track over which errors repeat [m].

    Returns
    -------
    share : ndarray, shape (P,)
        Distance to the next over the length, at most 1.
    """
    if len(place) < 2:
        return np.ones(len(place))
    return np.asarray(np.minimum(np.hypot(*np.gradient(place, axis=0).T) / length, 1.0))
