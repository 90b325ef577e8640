"""Sampling: the inner loops of alignment, rasters of one submap read at the turned and shifted cells of another."""

from typing import NamedTuple

import numba
import numpy as np

from frontend.arrays import FloatArray


def sample_rasters(
    rasters: FloatArray,
    positions: FloatArray,
    frame: tuple[float, float, float],
    planar: tuple[float, float, float],
) -> FloatArray:
    """Sample rasters at positions given in another level frame.

    Parameters
    ----------
    rasters : ndarray, shape (n_y, n_x, C)
        Rasters of one grid; the first is the trust [1], 0 where unknown.
    positions : ndarray, shape (K, 2 or more)
        x and y in the other frame [m].
    frame : tuple of float
        x and y of the first cell and the spacing of the grid [m].
    planar : tuple of float
        x, y [m] and yaw [rad] of the transform from the positions' frame to the grid's.

    Returns
    -------
    samples : ndarray, shape (K, C)
        Bilinear samples; all 0 where one of the four cells around is outside the grid or has no trust.
    """
    samples = np.zeros((len(positions), rasters.shape[2]))
    arguments = (np.array(frame, dtype=np.float64), np.array(planar, dtype=np.float64))
    _sample(np.ascontiguousarray(rasters), np.ascontiguousarray(positions), *arguments, samples)
    return samples


def normal_equations(
    rasters: FloatArray,
    cells: FloatArray,
    frame: tuple[float, float, float],
    planar: tuple[float, float, float],
    tuning: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Robust least squares of x, y and yaw, linearised at one pose.

    Parameters
    ----------
    rasters : ndarray, shape (n_y, n_x, 4)
        The target's weight [1], relief [m] and its slopes along x and y [1].
    cells : ndarray, shape (K, 6)
        x and y [m] of the source's cells, then the same four.
    frame : tuple of float
        x and y of the target's first cell and the spacing of its grid [m].
    planar : tuple of float
        x, y [m] and yaw [rad] of ``T_target_source``.
    tuning : float
        Residuals of so many robust standard deviations [1] weigh nothing (Tukey's biweight).

    Returns
    -------
    H, H_common : ndarray, shape (3, 3)
        ``J^T W J`` of the target's slopes, and ``J^T W J_source`` of what both reliefs' slopes have in common.
    g : ndarray, shape (3,)
        ``J^T W e`` with e the source's less the target's relief; all 0 where fewer than 3 cells meet.
    """
    H, H_common, g = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    arguments = (np.array(frame, dtype=np.float64), np.array(planar, dtype=np.float64), tuning)
    _normal_equations(np.ascontiguousarray(rasters), np.ascontiguousarray(cells), *arguments, H, H_common, g)
    return H, H_common, g


class Descent(NamedTuple):
    """How Gauss-Newton steps of x, y and yaw are taken.

    Parameters
    ----------
    n_steps : int
        Most steps.
    max_step, max_turn : float
        Longest shift [m] and turn [rad] of one step.
    still, still_turn : float
        Shift [m] and turn [rad] of a step that is the last.
    tuning : float
        Residuals of so many robust standard deviations [1] weigh nothing.
    damping : float
        Share of the target's own slopes in what is solved [1]; common slopes alone are weak where little is common.
    """

    n_steps: int
    max_step: float
    max_turn: float
    still: float
    still_turn: float
    tuning: float
    damping: float


def descend(
    rasters: FloatArray,
    cells: FloatArray,
    frame: tuple[float, float, float],
    planar: tuple[float, float, float],
    descent: Descent,
) -> tuple[float, float, float]:
    """Follow `normal_equations` from a pose to where the residuals are least.

    Parameters
    ----------
    rasters, cells, frame
        As for `normal_equations`.
    planar : tuple of float
        Where to start: x, y [m] and yaw [rad] of ``T_target_source``.
    descent : Descent
        How steps are taken.

    Returns
    -------
    planar : tuple of float
        Where the steps end; the start where nothing fixes a step.
    """
    end = np.array(planar, dtype=np.float64)
    arguments = (np.ascontiguousarray(rasters), np.ascontiguousarray(cells), np.array(frame, dtype=np.float64))
    _descend(*arguments, end, descent)
    return float(end[0]), float(end[1]), float(end[2])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _sample(rasters: FloatArray, cells: FloatArray, frame: FloatArray, planar: FloatArray, out: FloatArray) -> None:
    """Bilinear samples of all rasters at the turned and shifted positions, left 0 where a corner is not trusted."""
    cosine, sine = np.cos(planar[2]), np.sin(planar[2])
    n_y, n_x, n_channels = rasters.shape
    for k in range(cells.shape[0]):
        x, y = cells[k, 0], cells[k, 1]
        column = (planar[0] + cosine * x - sine * y - frame[0]) / frame[2]
        row = (planar[1] + sine * x + cosine * y - frame[1]) / frame[2]
        j, i = int(np.floor(column)), int(np.floor(row))
        if i < 0 or j < 0 or i >= n_y - 1 or j >= n_x - 1:
            continue
        corners = min(rasters[i, j, 0], rasters[i, j + 1, 0], rasters[i + 1, j, 0], rasters[i + 1, j + 1, 0])
        if corners <= 0.0:
            continue
        u, v = column - j, row - i
        for c in range(n_channels):
            low = (1 - u) * rasters[i, j, c] + u * rasters[i, j + 1, c]
            high = (1 - u) * rasters[i + 1, j, c] + u * rasters[i + 1, j + 1, c]
            out[k, c] = (1 - v) * low + v * high


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _normal_equations(rasters, cells, frame, planar, tuning, H, H_common, g):  # type: ignore[no-untyped-def]
    """J^T W J, J^T W J_source, J^T W e of x, y, yaw; rasters and cells hold weight, relief, slopes along x and y."""
    samples = np.zeros((cells.shape[0], 4))
    _sample(rasters, cells, frame, planar, samples)
    met = samples[:, 0] > 0
    if met.sum() < 3:
        return
    error = cells[:, 3] - samples[:, 1]
    scale = tuning * (1.4826 * np.median(np.abs(error[met])) + 1e-9)
    cosine, sine, J, J_source = np.cos(planar[2]), np.sin(planar[2]), np.empty(3), np.empty(3)
    for k in np.flatnonzero(met & (np.abs(error) < scale)):
        weight = samples[k, 0] * cells[k, 2] * (1 - (error[k] / scale) ** 2) ** 2
        u, v = cosine * cells[k, 0] - sine * cells[k, 1], sine * cells[k, 0] + cosine * cells[k, 1]
        J[0], J[1] = samples[k, 2], samples[k, 3]
        J_source[0] = cosine * cells[k, 4] - sine * cells[k, 5]
        J_source[1] = sine * cells[k, 4] + cosine * cells[k, 5]
        J[2], J_source[2] = J[1] * u - J[0] * v, J_source[1] * u - J_source[0] * v
        for i in range(3):
            g[i] += weight * J[i] * error[k]
            for j in range(3):
                H[i, j] += weight * J[i] * J[j]
                H_common[i, j] += weight * J[i] * J_source[j]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _descend(rasters: FloatArray, cells: FloatArray, frame: FloatArray, planar: FloatArray, descent: Descent) -> None:
    """Bounded steps, added to the pose until they stand still."""
    H, H_common, g = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    for _ in range(descent.n_steps):
        H[:], H_common[:], g[:] = 0.0, 0.0, 0.0
        _normal_equations(rasters, cells, frame, planar, descent.tuning, H, H_common, g)
        step = _step(H, H_common, g, descent)
        planar += step
        if np.hypot(step[0], step[1]) < descent.still and abs(step[2]) < descent.still_turn:
            return


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _step(H: FloatArray, H_common: FloatArray, g: FloatArray, descent: Descent) -> FloatArray:
    """One Gauss-Newton step, shortened to its limits; zero where nothing fixes it."""
    spread = np.linalg.eigvalsh(H)
    if not spread[0] > 1e-12 * spread[2]:
        return np.zeros(3)
    damped = (H_common + H_common.T) / 2 + descent.damping * H
    if not np.linalg.eigvalsh(damped)[0] > 0:
        damped = H
    step = np.linalg.solve(damped, g)
    excess = max(np.hypot(step[0], step[1]) / descent.max_step, abs(step[2]) / descent.max_turn, 1.0)
    return step / excess
