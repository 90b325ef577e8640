"""Turning: a relief brought onto coarse grids along other axes, each made once for all its partners."""

from dataclasses import dataclass
from threading import Lock
from typing import TypeVar

import numpy as np

from frontend.arrays import FloatArray
from frontend.correlation import Spectra, spectra
from frontend.relief import Relief, block_means
from frontend.sampling import sample_rasters

_Key = TypeVar("_Key")
_Value = TypeVar("_Value")
_MOST_KEPT = 24  # spectra of one relief: what a narrow gate asks for again; a whole circle is not kept


@dataclass(frozen=True)
class Turned:
    """A relief and its weight on a grid along other axes.

    Parameters
    ----------
    values : ndarray, shape (2, n_y, n_x)
        Relief [m] and log-reflectivity [1].
    weight : ndarray, shape (n_y, n_x)
        The trust in both [1].
    origin : tuple of float
        x and y of the first cell along the new axes [m].
    spacing : float
        Distance between cells [m].
    """

    values: FloatArray
    weight: FloatArray
    origin: tuple[float, float]
    spacing: float

    @property
    def shape(self) -> tuple[int, int]:
        """Cells along y and x."""
        return self.weight.shape[0], self.weight.shape[1]


def turn(relief: Relief, yaw: float, spacing: float) -> Turned:
    """Turn a relief about its frame's origin and mean it over the cells of a coarse grid.

    Parameters
    ----------
    relief : Relief
        Rasters of a submap.
    yaw : float
        Angle of the submap's x axis from the new one [rad].
    spacing : float
        Spacing wanted [m]; taken to the nearest whole number of the relief's cells, at least one.

    Returns
    -------
    turned : Turned
        Weighted means over square blocks of bilinear samples.
    """
    n = max(round(spacing / relief.spacing), 1)
    grid = _grid_about(relief, yaw)
    rasters = np.stack([relief.weight, relief.z, relief.reflectivity], axis=-1)
    samples = sample_rasters(rasters, grid.reshape(-1, 2), (*relief.origin, relief.spacing), (0.0, 0.0, -yaw))
    weight, z, reflectivity = np.ascontiguousarray(samples.T).reshape(3, *grid.shape[:2])
    coarse = block_means(weight, n)
    values = np.stack([block_means(weight * a, n) for a in (z, reflectivity)]) / np.maximum(coarse, 1e-12)
    shift = (n - 1) / 2 * relief.spacing
    origin = (float(grid[0, 0, 0]) + shift, float(grid[0, 0, 1]) + shift)
    return Turned(values, coarse, origin, n * relief.spacing)


class TurnedRelief:
    """A relief with its copies turned in equal steps and their spectra, made when first asked for, from any thread.

    Parameters
    ----------
    relief : Relief
        Rasters of a submap.
    heading : float
        Angle of the submap's x axis from axes that all partners share, as well as it is known [rad].
    step : float
        Step of the turns [rad].
    spacing : float
        Cells of the copies [m].
    """

    def __init__(self, relief: Relief, heading: float, step: float, spacing: float) -> None:
        self.relief = relief
        self.step = step
        self._heading = heading
        self._spacing = spacing
        self._turned: dict[int, Turned] = {}
        self._spectra: dict[tuple[int, tuple[int, int]], Spectra] = {}
        self._lock = Lock()

    def yaw(self, k: int) -> float:
        """Angle of the submap's x axis from the shared axes after so many steps.

        Parameters
        ----------
        k : int
            Number of steps; 0 is the heading as it is known.

        Returns
        -------
        yaw : float
            The angle [rad].
        """
        return self._heading + k * self.step

    def at(self, k: int) -> Turned:
        """Copy after so many steps.

        Parameters
        ----------
        k : int
            Number of steps.

        Returns
        -------
        turned : Turned
            On a grid along the shared axes.
        """
        turned = self._turned.get(k)
        return (
            turned if turned is not None else self._kept(self._turned, k, turn(self.relief, self.yaw(k), self._spacing))
        )

    def spectra(self, k: int, padded: tuple[int, int]) -> Spectra:
        """Fourier transforms of the copy after so many steps.

        Parameters
        ----------
        k : int
            Number of steps.
        padded : tuple of int
            Size to pad to [cells].

        Returns
        -------
        spectra : Spectra
            Of relief and reflectivity: what `frontend.correlation.correlate` needs.
        """
        found = self._spectra.get((k, padded))
        if found is not None:
            return found
        turned = self.at(k)
        return self._kept(self._spectra, (k, padded), spectra(turned.values, turned.weight, padded))

    def _kept(self, kept: dict[_Key, _Value], key: _Key, value: _Value) -> _Value:
        """The value, added to what is kept; the oldest goes where that is too much."""
        with self._lock:  # two threads may have made the same: one is kept
            if key not in kept and len(kept) >= _MOST_KEPT:
                del kept[next(iter(kept))]
            return kept.setdefault(key, value)


def _grid_about(relief: Relief, yaw: float) -> FloatArray:
    """x and y of a grid along the new axes that holds all of a turned relief, shape (n_y, n_x, 2) [m]."""
    (n_y, n_x), spacing = relief.z.shape, relief.spacing
    columns, rows = np.meshgrid(np.array([0, n_x - 1]), np.array([0, n_y - 1]))
    corners = np.stack([columns, rows], axis=-1).reshape(-1, 2) * spacing + np.array(relief.origin)
    cosine, sine = np.cos(yaw), np.sin(yaw)
    corners = corners @ np.array([[cosine, sine], [-sine, cosine]])
    low, size = corners.min(axis=0), np.ceil(np.ptp(corners, axis=0) / spacing).astype(int) + 1
    return np.stack(np.meshgrid(*(low[k] + spacing * np.arange(size[k]) for k in (0, 1))), axis=-1)
