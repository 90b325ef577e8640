"""Linear operators on the cells of lines: slopes, reflectivity in shadow, beam pattern."""

import numpy as np
from scipy.sparse import csr_array

from frontend.arrays import BoolArray, FloatArray
from frontend.geometry import PORT
from frontend.reconstruction.lines import LineFrames


def slope_on_line(n_lines: int, n_cells: int, spacing: float) -> csr_array:
    """Slope between the neighbours of each cell on its line.

    Parameters
    ----------
    n_lines, n_cells : int
        Lines, and cells a line.
    spacing : float
        Size of a cell [m].

    Returns
    -------
    slope : csr_array, shape (N, N)
        Central difference quotients, one-sided at the ends of a line.
    """
    column = np.arange(n_cells)
    before, after = np.maximum(column - 1, 0), np.minimum(column + 1, n_cells - 1)
    step = 1.0 / ((after - before) * spacing)
    start = n_cells * np.arange(n_lines)[:, None]
    rows = (start + column).ravel()
    columns = np.concatenate([(start + after).ravel(), (start + before).ravel()])
    values = np.concatenate([np.tile(step, n_lines), -np.tile(step, n_lines)])
    n = n_lines * n_cells
    return csr_array((values, (np.concatenate([rows, rows]), columns)), shape=(n, n))


def fill_shadow(is_lit: BoolArray) -> csr_array:
    """Interpolation on each line from lit cells.

    Parameters
    ----------
    is_lit : ndarray of bool, shape (L, C)
        Cells that keep their value.

    Returns
    -------
    fill : csr_array, shape (N, N)
        Linear between the nearest lit cells of the line, constant beyond the last; a line without any keeps its values.
    """
    n_lines, n_cells = is_lit.shape
    lit = is_lit | ~is_lit.any(axis=1, keepdims=True)
    column = np.broadcast_to(np.arange(n_cells), lit.shape)
    before = np.maximum.accumulate(np.where(lit, column, -1), axis=1)
    after = np.minimum.accumulate(np.where(lit, column, n_cells)[:, ::-1], axis=1)[:, ::-1]
    before, after = np.where(before < 0, after, before), np.where(after >= n_cells, before, after)
    share = np.where(after > before, (column - before) / np.maximum(after - before, 1), 0.0)
    start = n_cells * np.arange(n_lines)[:, None]
    rows = np.tile((start + column).ravel(), 2)
    columns = np.concatenate([(start + before).ravel(), (start + after).ravel()])
    values = np.concatenate([(1 - share).ravel(), share.ravel()])
    return csr_array((values, (rows, columns)), shape=(lit.size, lit.size))


def beam_knots(frames: LineFrames, angle: FloatArray, angle_step: float, track_step: float) -> tuple[csr_array, int]:
    """Interpolation of a beam pattern that varies over angle and, slowly, over the track.

    Parameters
    ----------
    frames : LineFrames
        The lines.
    angle : ndarray, shape (L, C)
        Angle of each cell from the body's nadir, outwards [rad].
    angle_step : float
        Distance between knots [rad].
    track_step : float
        Distance run between knots, at least [m].

    Returns
    -------
    beam : csr_array, shape (N, K)
        Bilinear; knots are ordered by side, then place on the track, then angle.
    n_angles : int
        Knots over the angle.
    """
    n_angles = int(np.ceil(np.ptp(angle) / angle_step)) + 2
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(frames.sensor, axis=0), axis=1))])
    n_places = int(run[-1] // track_step) + 2
    at_angle = (angle - angle.min()) / angle_step
    at_place = np.broadcast_to((run * (n_places - 1) / max(run[-1], 1e-9))[:, None], angle.shape)
    low_angle, low_place = np.floor(at_angle), np.minimum(np.floor(at_place), n_places - 2)
    side = np.broadcast_to(np.where(frames.side == PORT, 0, 1), angle.shape)
    columns, values = [], []
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        columns.append(((side * n_places + low_place + i) * n_angles + low_angle + j).astype(np.int64).ravel())
        by_place = 1 - np.abs(at_place - low_place - i)
        values.append((by_place * (1 - np.abs(at_angle - low_angle - j))).ravel())
    rows = np.tile(np.arange(angle.size), 4)
    shape = (angle.size, 2 * n_places * n_angles)
    return csr_array((np.concatenate(values), (rows, np.concatenate(columns))), shape=shape), n_angles
