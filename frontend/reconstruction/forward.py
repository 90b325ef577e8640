"""The forward model: expected intensity of every slant-range bin over a heightfield, and its exact derivatives.

A ping is walked outward over the surface in its beam plane. A sample is seen if its elevation exceeds all before it.
The energy of a seen sample, ``exp(rho) Phi(theta) G(r) cos^n(incidence) area``, is shared linearly between the two
nearest slant-range bins. Layover, foreshortening, shadows and the first bottom return come out; nothing is corrected
to ground range. Derivatives hold for the samples seen and the places walked at the point of linearisation. The walk
itself is in `frontend.reconstruction.kernels`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frontend.arrays import BoolArray, Float32Array, FloatArray
from frontend.radiometry import Tables
from frontend.reconstruction.kernels import _coverage, _linearise, _pull_back, _render

ROW_LENGTH = 24  # cells a bin may depend on in the curvature; the gradient is never cut


@dataclass(frozen=True)
class Beams:
    """Where each line of a window looked from, in the submap frame: P pings, two sides (port, starboard).

    Parameters
    ----------
    sensor : ndarray, shape (P, 2, 3)
        Transducers [m].
    forward, side, up : ndarray, shape (P, 3), (P, 2, 3), (P, 3)
        Body axes: normal of the beam plane, towards the looked-at side, up.
    advance : ndarray, shape (P,)
        Distance run in half the time between transmission and reception, a metre of slant range [1].
    turn : ndarray, shape (P,)
        Angle turned in the same time, to port positive [rad/m].
    """

    sensor: FloatArray
    forward: FloatArray
    side: FloatArray
    up: FloatArray
    advance: FloatArray
    turn: FloatArray


@dataclass(frozen=True)
class Raster:
    """The grid of the unknown surface.

    Parameters
    ----------
    n_y, n_x : int
        Cells along y and x.
    spacing : float
        Distance between cells [m].
    origin : tuple of float
        x and y of the centre of cell [0, 0] [m].
    """

    n_y: int
    n_x: int
    spacing: float
    origin: tuple[float, float]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.n_y, self.n_x

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return self.n_y * self.n_x


@dataclass(frozen=True)
class Bins:
    """Multilooked echoes of a window.

    Parameters
    ----------
    intensity : ndarray, shape (P, 2, B)
        Mean intensity of each bin.
    looks : ndarray, shape (P, 2, B)
        Independent looks in each mean; 0 where the bin says nothing.
    floor : ndarray, shape (2, B)
        Expected intensity of each bin without any seafloor in it.
    width : float
        Width of a bin [m]; bin b is centred at ``(b + 0.5) * width``.
    """

    intensity: FloatArray
    looks: FloatArray
    floor: FloatArray
    width: float


@dataclass(frozen=True)
class Curvature:
    """Derivatives of ln mu by the cells a bin depends on, row by row.

    Parameters
    ----------
    cell : ndarray of int32, shape (P, 2, B, ROW_LENGTH)
        Cell numbers.
    by_height, by_reflectivity : ndarray of float32, shape (P, 2, B, ROW_LENGTH)
        Derivatives [1/m] and [1].
    n_cells : ndarray of int32, shape (P, 2, B)
        Used length of each row.
    share : ndarray, shape (P, 2, B)
        Share of the seafloor in mu; what is left is floor.
    knot : ndarray, shape (P, 2, B)
        Mean knot of the beam pattern that a bin was seen with.
    """

    cell: NDArray[np.int32]
    by_height: Float32Array
    by_reflectivity: Float32Array
    n_cells: NDArray[np.int32]
    share: FloatArray
    knot: FloatArray


def render(z: FloatArray, rho: FloatArray, raster: Raster, beams: Beams, tables: Tables, bins: Bins) -> FloatArray:
    """Expected intensity of every bin.

    Parameters
    ----------
    z, rho : ndarray, shape (n_y, n_x)
        Heights [m] and log-reflectivity.
    raster : Raster
        Their grid.
    beams : Beams
        Where each line looked from.
    tables : Tables
        Radiometry.
    bins : Bins
        The bins; only their number and width matter here.

    Returns
    -------
    mu : ndarray, shape (P, 2, B)
        Expected intensity, noise floor included.
    """
    mu = np.empty(bins.intensity.shape)
    mu[:] = bins.floor
    _render(z, rho, _grid(raster), _pack(beams), _pack_tables(tables), bins.width, mu)
    return mu


def linearise(
    z: FloatArray, rho: FloatArray, raster: Raster, beams: Beams, tables: Tables, bins: Bins, mu: FloatArray
) -> Curvature:
    """Derivatives of ln mu by heights and log-reflectivities.

    Parameters
    ----------
    z, rho : ndarray, shape (n_y, n_x)
        Heights [m] and log-reflectivity.
    raster, beams, tables, bins
        As in `render`.
    mu : ndarray, shape (P, 2, B)
        What `render` gave there.

    Returns
    -------
    curvature : Curvature
        Rows of the Jacobian; a row longer than ROW_LENGTH loses its last cells.
    """
    shape = (*bins.intensity.shape, ROW_LENGTH)
    cell = np.empty(shape, dtype=np.int32)
    by_height, by_reflectivity = np.empty(shape, dtype=np.float32), np.empty(shape, dtype=np.float32)
    n_cells = np.zeros(bins.intensity.shape, dtype=np.int32)
    share, knot = np.zeros(bins.intensity.shape), np.zeros(bins.intensity.shape)
    rows = (cell, by_height, by_reflectivity, n_cells, share, knot)
    _linearise(z, rho, _grid(raster), _pack(beams), _pack_tables(tables), bins.width, mu, rows)
    np.divide(knot, share, out=knot, where=share > 0)
    return Curvature(*rows)


def pull_back(
    z: FloatArray, rho: FloatArray, raster: Raster, beams: Beams, tables: Tables, bins: Bins, weight: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Adjoint of the forward model: gradient of ``sum(weight * mu)`` by heights, log-reflectivities and beam pattern.

    Parameters
    ----------
    z, rho : ndarray, shape (n_y, n_x)
        Heights [m] and log-reflectivity.
    raster, beams, tables, bins
        As in `render`.
    weight : ndarray, shape (P, 2, B)
        Derivative of some cost by mu.

    Returns
    -------
    by_height, by_reflectivity : ndarray, shape (n_y, n_x)
        Gradient of the cost; exact for the samples seen and the places walked.
    by_beam : ndarray, shape (2, K)
        Gradient by the logarithmic beam pattern at its knots.
    """
    gradients, by_beam = np.zeros((2, raster.n_y, raster.n_x)), np.zeros(tables.log_beam.shape)
    _pull_back(z, rho, _grid(raster), _pack(beams), _pack_tables(tables), bins.width, weight, gradients, by_beam)
    return gradients[0], gradients[1], by_beam


def coverage(z: FloatArray, raster: Raster, beams: Beams, slant_range_max: float) -> tuple[BoolArray, BoolArray]:
    """Cells that some line passes over, and those that some line sees.

    Parameters
    ----------
    z : ndarray, shape (n_y, n_x)
        Heights [m].
    raster, beams
        As in `render`.
    slant_range_max : float
        Where the lines end [m].

    Returns
    -------
    is_passed, is_seen : ndarray of bool, shape (n_y, n_x)
        Cells in the swath, and cells in the swath and not in shadow.
    """
    passed = np.zeros(raster.shape, dtype=np.bool_)
    seen = np.zeros(raster.shape, dtype=np.bool_)
    _coverage(z, _grid(raster), _pack(beams), slant_range_max, passed, seen)
    return passed, seen


def _grid(raster: Raster) -> tuple[int, int, float, float, float]:
    return raster.n_y, raster.n_x, raster.spacing, raster.origin[0], raster.origin[1]


def _pack(beams: Beams) -> FloatArray:
    """One row of 16 numbers a line, as `frontend.reconstruction.kernels` wants it."""
    horizontal = np.hypot(beams.forward[:, 0], beams.forward[:, 1])
    heading = beams.forward[:, :2] / horizontal[:, None]
    packed = np.zeros((len(beams.forward), 2, 16))
    packed[..., 0:3] = beams.sensor
    packed[..., 3:6] = beams.side
    packed[..., 6:9] = beams.up[:, None]
    packed[..., 9:11] = heading[:, None]
    left = np.stack([-heading[:, 1], heading[:, 0]], axis=-1)
    packed[:, 0, 11:13], packed[:, 1, 11:13] = left, -left
    packed[..., 13] = (-beams.forward[:, 2] / horizontal)[:, None]
    packed[..., 14] = beams.advance[:, None]
    packed[:, 0, 15], packed[:, 1, 15] = -beams.turn, beams.turn
    return packed


def _pack_tables(tables: Tables) -> tuple[FloatArray, FloatArray, FloatArray]:
    scalars = np.array([tables.angle_first, tables.angle_step, tables.range_step, tables.exponent])
    return tables.log_beam, tables.log_range[None], scalars
