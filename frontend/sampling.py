"""Sampling: the inner loops of alignment, rasters of one submap read at the turned and shifted cells of another."""

from typing import NamedTuple

import numba
import numpy as np

from frontend.arrays import FloatArray, IntArray

_VARIES = 1e-12  # mean product of two deviations below which rasters count as constant


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
    samples, which, n = _met(rasters, positions, frame, planar)
    _spread(samples, which, n)
    return samples


def samples_that_meet(
    rasters: FloatArray,
    positions: FloatArray,
    frame: tuple[float, float, float],
    planar: tuple[float, float, float],
) -> tuple[FloatArray, IntArray]:
    """Sample rasters as `sample_rasters` does, only where positions meet trusted cells.

    Parameters
    ----------
    rasters, positions, frame, planar
        As there.

    Returns
    -------
    samples : ndarray, shape (M, C)
        Bilinear samples where all four cells around have trust.
    which : ndarray of int, shape (M,)
        Which of the positions these are.
    """
    samples, which, n = _met(rasters, positions, frame, planar)
    return samples[:n], which[:n]


def correlations(
    rasters: FloatArray,
    cells: FloatArray,
    frame: tuple[float, float, float],
    planar: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray, int]:
    """Correlate rasters with those of another level frame at one pose, and keep no sample.

    Parameters
    ----------
    rasters : ndarray, shape (n_y, n_x, 1 + C)
        The target's weight [1], 0 where unknown, and rasters.
    cells : ndarray, shape (K, 3 + C)
        x and y [m] of the source's cells, then the same.
    frame : tuple of float
        x and y of the target's first cell and the spacing of its grid [m].
    planar : tuple of float
        x, y [m] and yaw [rad] of ``T_target_source``.

    Returns
    -------
    correlations : ndarray, shape (C,)
        Weighted correlation coefficients [1]; 0 where a raster is constant over the cells that meet.
    coincidences : ndarray, shape (C,)
        Mean product of both squares over the product of the mean squares [1], as `frontend.overlap.concentration`
        wants it; 0 likewise.
    n_cells : int
        Cells that meet.
    """
    samples, which = samples_that_meet(rasters, cells, frame, planar)
    sums = np.zeros((rasters.shape[2], 6))
    _sum_up(samples, np.ascontiguousarray(cells), which, sums)
    total = float(sums[0, 0])
    if not total > 0:
        return np.zeros(len(sums) - 1), np.zeros(len(sums) - 1), len(which)
    a, b, aa, bb, ab, aabb = sums[1:].T
    scale = np.sqrt(np.maximum(aa - a * a / total, 0.0) * np.maximum(bb - b * b / total, 0.0))
    varies = scale > _VARIES * total
    correlations = np.where(varies, (ab - a * b / total) / np.where(varies, scale, 1.0), 0.0)
    coincidences = np.where(varies, aabb * total / np.where(varies, aa * bb, 1.0), 0.0)
    return np.clip(correlations, -1.0, 1.0), coincidences, len(which)


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
    samples, which = samples_that_meet(rasters, cells, frame, planar)
    if len(which) >= 3:
        _normal_equations(samples, np.ascontiguousarray(cells), which, planar[2], tuning, H, H_common, g)
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


def _met(
    rasters: FloatArray, positions: FloatArray, frame: tuple[float, float, float], planar: tuple[float, float, float]
) -> tuple[FloatArray, IntArray, int]:
    """Samples and numbers of the positions that meet trusted cells, in the first rows; and how many do."""
    samples, which = np.empty((len(positions), rasters.shape[2])), np.empty(len(positions), dtype=np.int64)
    arguments = (np.array(frame, dtype=np.float64), np.array(planar, dtype=np.float64))
    n = _meet(np.ascontiguousarray(rasters), np.ascontiguousarray(positions), *arguments, samples, which)
    return samples, which, int(n)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _spread(samples: FloatArray, which: IntArray, n: int) -> None:
    """Move the first rows to their positions, from the last on, and fill up with 0."""
    end = len(samples)
    for m in range(n - 1, -1, -1):
        samples[which[m] + 1 : end] = 0.0
        samples[which[m]] = samples[m]
        end = which[m]
    samples[:end] = 0.0


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _meet(rasters, cells, frame, planar, samples, which):  # type: ignore[no-untyped-def]
    """Bilinear samples where turned and shifted positions meet trusted cells, from the first row on; how many do."""
    cosine, sine, n = np.cos(planar[2]), np.sin(planar[2]), 0
    for k in range(cells.shape[0]):
        x, y = cells[k, 0], cells[k, 1]
        column = (planar[0] + cosine * x - sine * y - frame[0]) / frame[2]
        row = (planar[1] + sine * x + cosine * y - frame[1]) / frame[2]
        if not (0.0 <= column < rasters.shape[1] - 1 and 0.0 <= row < rasters.shape[0] - 1):
            continue
        i, j = int(row), int(column)
        if min(rasters[i, j, 0], rasters[i, j + 1, 0], rasters[i + 1, j, 0], rasters[i + 1, j + 1, 0]) <= 0.0:
            continue
        u, v = column - j, row - i
        for c in range(rasters.shape[2]):
            low = (1 - u) * rasters[i, j, c] + u * rasters[i, j + 1, c]
            high = (1 - u) * rasters[i + 1, j, c] + u * rasters[i + 1, j + 1, c]
            samples[n, c] = (1 - v) * low + v * high
        which[n] = k
        n += 1
    return n


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _sum_up(samples: FloatArray, cells: FloatArray, which: IntArray, sums: FloatArray) -> None:
    """Weight of the samples, then of each raster the weighted a, b, aa, bb, ab and aabb."""
    for n, k in enumerate(which):
        weight = samples[n, 0] * cells[k, 2]
        sums[0, 0] += weight
        for c in range(1, samples.shape[1]):
            a, b = samples[n, c], cells[k, 2 + c]
            sums[c, 0] += weight * a
            sums[c, 1] += weight * b
            sums[c, 2] += weight * a * a
            sums[c, 3] += weight * b * b
            sums[c, 4] += weight * a * b
            sums[c, 5] += weight * a * a * b * b


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _normal_equations(samples, cells, which, yaw, tuning, H, H_common, g):  # type: ignore[no-untyped-def]
    """J^T W J, J^T W J_source, J^T W e of x, y, yaw; samples and cells hold weight, relief, slopes along x and y."""
    error = np.empty(len(which))
    for n, k in enumerate(which):
        error[n] = cells[k, 3] - samples[n, 1]
    scale = tuning * (1.4826 * np.median(np.abs(error)) + 1e-9)
    cosine, sine = np.cos(yaw), np.sin(yaw)
    xx = xy = xt = yy = yt = tt = 0.0  # sums in registers: those in memory take twice the time
    c_xx = c_xy = c_xt = c_yx = c_yy = c_yt = c_tx = c_ty = c_tt = g_x = g_y = g_t = 0.0
    for n, k in enumerate(which):
        if not np.abs(error[n]) < scale:
            continue
        weight = samples[n, 0] * cells[k, 2] * (1 - (error[n] / scale) ** 2) ** 2
        u, v = cosine * cells[k, 0] - sine * cells[k, 1], sine * cells[k, 0] + cosine * cells[k, 1]
        s_x, s_y = cosine * cells[k, 4] - sine * cells[k, 5], sine * cells[k, 4] + cosine * cells[k, 5]
        s_t, x, y = s_y * u - s_x * v, samples[n, 2], samples[n, 3]
        t = y * u - x * v
        w_x, w_y, w_t = weight * x, weight * y, weight * t
        xx, xy, xt, yy, yt, tt = xx + w_x * x, xy + w_x * y, xt + w_x * t, yy + w_y * y, yt + w_y * t, tt + w_t * t
        c_xx, c_xy, c_xt = c_xx + w_x * s_x, c_xy + w_x * s_y, c_xt + w_x * s_t
        c_yx, c_yy, c_yt = c_yx + w_y * s_x, c_yy + w_y * s_y, c_yt + w_y * s_t
        c_tx, c_ty, c_tt = c_tx + w_t * s_x, c_ty + w_t * s_y, c_tt + w_t * s_t
        g_x, g_y, g_t = g_x + w_x * error[n], g_y + w_y * error[n], g_t + w_t * error[n]
    H[0, 0], H[0, 1], H[0, 2], H[1, 1], H[1, 2], H[2, 2] = xx, xy, xt, yy, yt, tt
    H[1, 0], H[2, 0], H[2, 1] = xy, xt, yt
    H_common[0], H_common[1], H_common[2] = (c_xx, c_xy, c_xt), (c_yx, c_yy, c_yt), (c_tx, c_ty, c_tt)
    g[0], g[1], g[2] = g_x, g_y, g_t


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _descend(rasters: FloatArray, cells: FloatArray, frame: FloatArray, planar: FloatArray, descent: Descent) -> None:
    """Bounded steps, added to the pose until they stand still or nothing meets."""
    samples, which = np.empty((cells.shape[0], rasters.shape[2])), np.empty(cells.shape[0], np.int64)
    for _ in range(descent.n_steps):
        n = _meet(rasters, cells, frame, planar, samples, which)
        if n < 3:
            return
        H, H_common, g = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
        _normal_equations(samples, cells, which[:n], planar[2], descent.tuning, H, H_common, g)
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
