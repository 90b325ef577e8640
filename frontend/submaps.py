"""A submap: the seafloor of one window of pings, in its own level frame."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from frontend.arrays import BoolArray, FloatArray
from frontend.heightfield import Heightfield


@dataclass(frozen=True)
class Submap:
    """The reconstructed seafloor of one window.

    The frame is level: origin at the body of the anchor ping, x along the heading, z up. All rasters share the grid of
    ``surface``; cells that no ping has seen are NaN.

    Parameters
    ----------
    number : int
        Position in the dive.
    first_ping, end_ping : int
        The window: pings ``first_ping <= i < end_ping`` of the recording.
    anchor_ping : int
        The reference ping; its body is the frame's origin.
    anchor_time : float
        Time of the anchor ping [s since 1970 UTC].
    T_world_submap_dr : ndarray, shape (4, 4)
        The frame in the world as dead reckoning has it.
    T_submap_body : ndarray, shape (4, 4)
        The anchor's body in the level frame: roll and pitch, no shift.
    surface : Heightfield
        Heights in the submap frame [m].
    sigma : ndarray, shape (n_y, n_x)
        Standard deviation of the heights [m].
    log_reflectivity : ndarray, shape (n_y, n_x)
        Natural logarithm of the reflectivity against the dive's mean.
    is_shadow : ndarray of bool, shape (n_y, n_x)
        Cells that no ping of the window sees directly.
    track : ndarray, shape (n_pings, 3)
        Body positions of the window's pings in the submap frame [m]; none where nobody knows them any more.
    """

    number: int
    first_ping: int
    end_ping: int
    anchor_ping: int
    anchor_time: float
    T_world_submap_dr: FloatArray
    T_submap_body: FloatArray
    surface: Heightfield
    sigma: FloatArray
    log_reflectivity: FloatArray
    is_shadow: BoolArray
    track: FloatArray = field(default_factory=lambda: np.empty((0, 3)))

    @cached_property
    def is_known(self) -> BoolArray:
        """Shape (n_y, n_x): cells that have a height."""
        return np.isfinite(self.surface.z)

    @cached_property
    def points(self) -> FloatArray:
        """Shape (K, 3): known cells as points in the submap frame [m], row by row."""
        x, y = np.meshgrid(self.surface.x, self.surface.y)
        return np.stack([x, y, self.surface.z], axis=-1)[self.is_known]

    @cached_property
    def normals(self) -> FloatArray:
        """Shape (K, 3): upward unit normals of `points`."""
        return surface_normals(self.surface)[self.is_known]

    @property
    def sigmas(self) -> FloatArray:
        """Shape (K,): standard deviations of the heights of `points` [m]."""
        return self.sigma[self.is_known]

    @property
    def shadow(self) -> BoolArray:
        """Shape (K,): which of `points` no ping of the window sees directly."""
        return self.is_shadow[self.is_known]

    @property
    def reflectivity(self) -> FloatArray:
        """Shape (K,): natural logarithm of the reflectivity at `points`."""
        return self.log_reflectivity[self.is_known]


def surface_normals(surface: Heightfield) -> FloatArray:
    """Upward unit normals of a heightfield.

    Parameters
    ----------
    surface : Heightfield
        Heights [m]; NaN where unknown.

    Returns
    -------
    normals : ndarray, shape (n_y, n_x, 3)
        Unit normals with a positive z; NaN where the height is unknown. Beside an unknown cell the slope is one-sided,
        and zero where neither neighbour is known.
    """
    slope_y, slope_x = (_slope(surface.z, surface.spacing, axis) for axis in (0, 1))
    normals = np.stack([-slope_x, -slope_y, np.ones_like(surface.z)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    normals[~np.isfinite(surface.z)] = np.nan
    return normals


def _slope(z: FloatArray, spacing: float, axis: int) -> FloatArray:
    """Mean of the forward and backward difference quotients that are known, else 0."""
    step = np.diff(z, axis=axis) / spacing
    edge = np.full_like(np.take(z, [0], axis=axis), np.nan)
    both = np.stack([np.concatenate([step, edge], axis=axis), np.concatenate([edge, step], axis=axis)])
    known = np.isfinite(both)
    return np.asarray(np.where(known, both, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))
