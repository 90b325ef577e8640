"""What is believed of lines before they are looked at: bounded slopes, smooth lines side by side, even reflectivity."""

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import label, maximum_filter1d
from scipy.sparse import block_diag, csr_array, diags_array, eye_array, vstack

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.reconstruction.lines import LineFrames
from frontend.reconstruction.neighbours import Neighbours


class LinePriorConfig(BaseModel):
    """How steep a seafloor may be, how patchy, and how far the beam pattern may be off."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    slope: float = Field(default=0.15, gt=0, description="Standard deviation of slopes [1]; 0.15 is 9 degrees.")
    slope_length: float = Field(
        default=2.0, gt=0, description="Correlation length of slopes [m]; shorter relief is taken for speckle."
    )
    shadow_slope: float = Field(
        default=4.0,
        ge=1,
        description="How much steeper it may be in and beside a shadow of one cell [1]; less by the root of its cells.",
    )
    reflectivity: float = Field(
        default=0.15, gt=0, description="Standard deviation of log-reflectivity as amplitude [1]; half of intensity's."
    )
    reflectivity_length: float = Field(
        default=12.0, gt=0, description="Correlation length of reflectivity on a line [m]; sediments change slowly."
    )
    altimeter_sigma: float = Field(
        default=0.3,
        gt=0,
        description="Altitude against the floor midway between the sides [m]; a cell is not its middle.",
    )
    altimeter_length: float = Field(
        default=4.0, gt=0, description="Track over which altimeter errors repeat [m]: its footprint, and more."
    )
    beam: float = Field(
        default=0.05,
        gt=0,
        description="Standard deviation of the log beam pattern as amplitude [1]; the dive has fixed it.",
    )
    beam_change: float = Field(
        default=0.03,
        gt=0,
        description="The same of its change from knot to knot along the track [1]; it varies slowly.",
    )
    beam_angle: float = Field(default=0.09, gt=0, description="Distance of its knots over the angle [rad]; 5 degrees.")
    beam_track: float = Field(default=100.0, gt=0, description="Distance of its knots along the track [m].")


@dataclass(frozen=True)
class LinePrior:
    """A belief as a stack of unit-variance residuals, ``matrix @ x + offset``.

    Parameters
    ----------
    matrix : csr_array, shape (R, 2 N + K)
        Rows of the belief.
    offset : ndarray, shape (R,)
        Their values at zero.
    banded : tuple of ndarray, shapes (3, N) and (3, N)
        Normal equations of relief and of log-reflectivity on each line by itself: diagonal and two above it, as upper
        banded storage.
    beam : ndarray, shape (K,)
        Diagonal of the beam pattern's.
    """

    matrix: csr_array
    offset: FloatArray
    banded: tuple[FloatArray, FloatArray]
    beam: FloatArray


def make_line_prior(
    frames: LineFrames, is_shadow: BoolArray, neighbours: Neighbours, knots: tuple[int, int], config: LinePriorConfig
) -> LinePrior:
    """The belief about one registration.

    Parameters
    ----------
    frames : LineFrames
        The lines.
    is_shadow : ndarray of bool, shape (L, C)
        Cells in shadow.
    neighbours : Neighbours
        Planes through other lines.
    knots : tuple of int
        Knots of the beam pattern, and how many of them lie over the angle.
    config : LinePriorConfig
        Its scales.

    Returns
    -------
    prior : LinePrior
        Slopes on a line are a stationary Gauss-Markov process, so are reflectivities; the plane through other lines
        passes a cell within what such slopes allow over its distance; altitudes hold midway between the sides. In and
        beside a shadow slopes are freer, so that its whole height may be so many times that of a usual step.
    """
    n_lines, n_cells = frames.shape
    on_line = _slope_rows(n_cells, frames.spacing, config)
    slopes = csr_array(
        diags_array(_trust(is_shadow, config).ravel()) @ block_diag([on_line] * n_lines, format="csr"), dtype=np.float64
    )
    patches = csr_array(
        block_diag([_markov(n_cells, config.reflectivity, frames.spacing / config.reflectivity_length)] * n_lines)
    )
    anchor, beam = _anchor_rows(frames, config), _beam_rows(*knots, config)
    reach = neighbours.distance
    allowed = config.slope * reach * np.sqrt(np.minimum(reach / config.slope_length, 1.0))
    trust = np.where(np.isfinite(reach), 1.0 / np.where(np.isfinite(reach), np.maximum(allowed, 1e-6), 1.0), 0.0)
    side_by_side = csr_array(diags_array(trust) @ neighbours.departure)
    relief = csr_array(vstack([slopes, anchor, side_by_side], format="csr"))
    offset = np.zeros(relief.shape[0] + patches.shape[0] + beam.shape[0])
    offset[slopes.shape[0] + anchor.shape[0] : relief.shape[0]] = trust * neighbours.departure_0
    bands = upper_bands(csr_array(slopes.T @ slopes + anchor.T @ anchor))
    bands[2] += column_squares(side_by_side)
    matrix = csr_array(block_diag([relief, patches, beam], format="csr"))
    return LinePrior(matrix, offset, (bands, upper_bands(csr_array(patches.T @ patches))), column_squares(beam))


def upper_bands(normal: csr_array) -> FloatArray:
    """Diagonal and two diagonals above it of a symmetric matrix.

    Parameters
    ----------
    normal : csr_array, shape (N, N)
        What lies farther out is left away.

    Returns
    -------
    bands : ndarray, shape (3, N)
        Upper banded storage, as LAPACK has it.
    """
    n = normal.shape[0]
    bands = np.zeros((3, n))
    for k in range(min(3, n)):
        bands[2 - k, k:] = normal.diagonal(k)
    return bands


def column_squares(matrix: csr_array) -> FloatArray:
    """Diagonal of the normal equations.

    Parameters
    ----------
    matrix : csr_array, shape (R, N)
        Rows of a least-squares problem.

    Returns
    -------
    squares : ndarray, shape (N,)
        Sum of the squares of each column.
    """
    return np.asarray(matrix.power(2).T @ np.ones(matrix.shape[0]), dtype=np.float64)


def _markov(n: int, sigma: float, step: float) -> csr_array:
    """Shape (n, n): whitens a stationary Gauss-Markov sequence; step is the distance over the correlation length."""
    memory = np.exp(-step)
    scale = np.full(n, 1.0 / (sigma * np.sqrt(1 - memory**2)))
    scale[0] = 1.0 / sigma
    own, before = np.arange(n), np.arange(1, n)
    values = np.concatenate([scale, -memory * scale[1:]])
    return csr_array((values, (np.concatenate([own, before]), np.concatenate([own, before - 1]))), shape=(n, n))


def _slope_rows(n_cells: int, spacing: float, config: LinePriorConfig) -> csr_array:
    """Shape (C - 1, C): whitens the slopes between neighbouring cells of a line."""
    n = n_cells - 1
    whiten = _markov(n, config.slope, spacing / config.slope_length)
    return csr_array(whiten @ _differences(np.arange(n), 1, n_cells) / spacing)


def _trust(is_shadow: BoolArray, config: LinePriorConfig) -> FloatArray:
    """Shape (L, C - 1): weight of what is believed of the slope beyond each cell, less if shadow lies about it."""
    about = maximum_filter1d(_shadow_lengths(is_shadow), 5, axis=1, mode="constant")
    length = np.maximum(np.maximum(about[:, 1:], about[:, :-1]), 1)
    # one thing casts a shadow, however long: a walk of so many free slopes must not go farther than one
    steeper = np.maximum(config.shadow_slope / np.sqrt(length), 1.0)
    return np.where((about[:, 1:] > 0) | (about[:, :-1] > 0), 1.0 / steeper, 1.0)


def _shadow_lengths(is_shadow: BoolArray) -> IntArray:
    """Shape (L, C): cells of the shadow on its line that a cell lies in; 0 outside."""
    on_a_line = np.array([[0, 0, 0], [1, 1, 1], [0, 0, 0]])
    shadow, _ = label(is_shadow, structure=on_a_line)
    cells = np.bincount(shadow.ravel())
    cells[0] = 0
    return np.asarray(cells[shadow])


def _differences(cells: IntArray, offset: int, n: int) -> csr_array:
    """Shape (len(cells), n): value so many places on, less that of the cell."""
    rows, ones = np.arange(len(cells)), np.ones(len(cells))
    columns = np.concatenate([cells + offset, cells])
    return csr_array((np.concatenate([ones, -ones]), (np.tile(rows, 2), columns)), shape=(len(cells), n))


def _anchor_rows(frames: LineFrames, config: LinePriorConfig) -> csr_array:
    """Shape (L, N): the relief midway between the sides is that of the altitude, errors repeating along the track."""
    n_lines, n_cells = frames.shape
    step = np.linalg.norm(np.gradient(frames.sensor, axis=0), axis=1) if n_lines > 1 else np.full(1, np.inf)
    weight = np.sqrt(np.minimum(step / config.altimeter_length, 1.0)) / config.altimeter_sigma
    rows = np.repeat(np.arange(n_lines), 2)
    columns = (n_cells * np.arange(n_lines)[:, None] + n_cells // 2 + np.array([-1, 0])).ravel()
    return csr_array((np.repeat(0.5 * weight, 2), (rows, columns)), shape=(n_lines, n_lines * n_cells))


def _beam_rows(n_knots: int, n_angles: int, config: LinePriorConfig) -> csr_array:
    """Each knot is near the dive's pattern, and near the same angle's knot before it on the track."""
    n_places = n_knots // (2 * n_angles)
    itself = eye_array(n_knots, format="csr") / (config.beam * np.sqrt(n_places))
    place = np.arange(n_knots) // n_angles % n_places
    change = _differences(np.flatnonzero(place < n_places - 1), n_angles, n_knots)
    return csr_array(vstack([itself, change / config.beam_change], format="csr"))
