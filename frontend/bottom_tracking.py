"""First bottom return tracked along a dive: coarse in cells, fine in samples, bridged by a Kalman filter."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from frontend.arrays import AnyArray, BoolArray, FloatArray, IntArray
from frontend.bottom_levels import Cells, echo_level, level_bounds
from frontend.bottom_paths import best_path, contrast, evidence, first_samples
from frontend.recording import Recording

_MOVE_CELL, _MOVE_SAMPLE = 0.05, 0.7  # cost of a move: in evidence of one group, in samples of one ping
_APART, _APART_MOST = 0.02, 0.4  # cost of a side's distance from both sides' path, a cell and at most
_SHARE = 0.35  # of the way from water to bottom, where the bottom begins: nadir is faint
_GATE = 4.0  # standard deviations
_GROUP, _LOST = 5, 4  # pings the Kalman filter takes together; groups off the track until it goes there
_SPREAD, _STEEP = 8.0, 0.5  # cells a ping may lie off the smooth track: boulders, not fish; and a slope besides


@dataclass(frozen=True)
class Track:
    """Where the bottom begins.

    Parameters
    ----------
    slant_range : ndarray, shape (N, 2)
        Middle of the first sample of the bottom, port and starboard [m]; NaN on a side where none is seen at all.
    is_found : ndarray of bool, shape (N, 2)
        Whether the ping itself shows it; elsewhere it is interpolated.
    """

    slant_range: FloatArray
    is_found: BoolArray


def track_bottom(recording: Recording, cells: Cells, is_allowed: BoolArray, step: tuple[float, float]) -> Track:
    """Follow the first bottom return along the dive.

    Parameters
    ----------
    recording : Recording
        The dive.
    cells : Cells
        Its levels.
    is_allowed : ndarray of bool, shape (G, C)
        Cells in which the bottom may begin.
    step : tuple of float
        Length compared before an edge [m]; least contrast of an edge, in standard deviations.

    Returns
    -------
    track : Track
        One place a ping and side.
    """
    length, least = step
    width = max(2, round(length / cells.width))
    z = np.stack([contrast(level, width) for level in cells.level])
    paths, is_seen = _coarse_paths(z, is_allowed, width, least)
    shape = (recording.n_pings, 2)
    measured, is_found = np.full(shape, np.nan), np.zeros(shape, dtype=bool)
    for side in np.flatnonzero(is_seen.any(axis=1)):
        echoes = (recording.port, recording.starboard)[side]
        piece = _Piece(cells, cells.level[side], paths[side], width)
        measured[:, side], is_found[:, side] = _refine(echoes, recording, piece)
        is_found[:, side] &= np.repeat(is_seen[side], cells.group)[: recording.n_pings]
    return _bridge(measured, is_found, recording, cells.width)


def _coarse_paths(z: FloatArray, is_allowed: BoolArray, width: int, least: float) -> tuple[IntArray, BoolArray]:
    """Shape (2, G): cell of the bottom and where it is seen; a side without evidence follows the other."""
    sides = np.stack([evidence(part, is_allowed, width) for part in z])
    both = best_path(sides.sum(axis=0), 2 * _MOVE_CELL)
    distance = np.abs(np.arange(z.shape[2])[None, :] - both[:, None])
    pull = np.minimum(_APART * distance, _APART_MOST)
    paths = np.stack([best_path(side - pull, _MOVE_CELL) for side in sides])
    rows = np.arange(z.shape[1])
    strength = np.stack([part[rows, path] * is_allowed[rows, path] for part, path in zip(z, paths, strict=True)])
    is_seen = strength > 0.5 * least
    # a side where hardly any group shows an edge shows none: noise has its largest rise somewhere, too
    typical = np.array([np.quantile(s, 0.75) for s in strength])
    return paths, is_seen & (typical > least)[:, None]


@dataclass(frozen=True)
class _Piece:
    """A side's levels (G, C) and its coarse path (G,), to be refined."""

    cells: Cells
    level: FloatArray
    path: IntArray
    width: int

    def thresholds(self) -> FloatArray:
        """Shape (G, 2): level between water and bottom, and half their difference."""
        k = np.arange(self.width)[None, :]
        last, at = self.level.shape[1] - 1, self.path[:, None]
        water = _mean(np.take_along_axis(self.level, np.clip(at - 2 - k, 0, last), axis=1))
        floor = _mean(np.take_along_axis(self.level, np.clip(at + 1 + k, 0, last), axis=1))
        rise = np.maximum(floor - water, 1e-3)
        return np.stack([water + _SHARE * rise, _SHARE * rise], axis=1)


def _mean(values: FloatArray) -> FloatArray:
    known = np.isfinite(values)
    return np.asarray(np.where(known, values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1))


def _refine(echoes: AnyArray, recording: Recording, piece: _Piece) -> tuple[FloatArray, BoolArray]:
    """Shape (N,): range of the first sample of the bottom, and whether the ping shows it."""
    cells, ping = piece.cells, np.arange(recording.n_pings)
    expected = np.interp(ping, cells.middle_ping, piece.path * cells.width)
    spacing = recording.sample_spacing
    half = max(4, round(1.5 * piece.width * cells.width / float(np.median(spacing))))
    half = min(half, (recording.n_samples - 1) // 2)
    start = np.clip(np.round(expected / spacing).astype(np.int64) - half, 0, recording.n_samples - 2 * half)
    some = np.take_along_axis(echoes, start[:, None] + np.arange(2 * half)[None, :], axis=1)
    quantity = recording.sonar.quantity
    level = echo_level(some, quantity, level_bounds(echoes, quantity)).astype(np.float64)
    threshold = piece.thresholds()[ping // cells.group]
    sample, gain = first_samples(level, threshold, start, _MOVE_SAMPLE)
    return (sample + 0.5) * spacing, gain > 0.25 * half


def _bridge(measured: FloatArray, is_found: BoolArray, recording: Recording, width: float) -> Track:
    """Fill what was not found from the Kalman smoother, and replace what lies off its track."""
    if not is_found.any():
        return Track(np.full_like(measured, np.nan), is_found)
    spacing = float(np.median(recording.sample_spacing))
    middles = _group_medians(np.where(is_found, measured, np.nan), _GROUP)
    step = _GROUP * float(np.nan_to_num(recording.ping_spacing))
    smooth = _smooth(middles, max(2 * spacing, width), step)
    ping, middle = np.arange(len(measured)), np.arange(len(middles)) * _GROUP + 0.5 * (_GROUP - 1)
    track = np.stack([np.interp(ping, middle, side) for side in smooth.T], axis=1)
    is_good = is_found & (np.abs(measured - track) < _SPREAD * width + _STEEP * step)
    is_side = is_found.any(axis=0)
    return Track(np.where(is_good, measured, np.where(is_side, track, np.nan)), is_good)


def _group_medians(values: FloatArray, group: int) -> FloatArray:
    """Shape (G, 2): middle value of each group, NaN where nothing was found."""
    padded = np.pad(values, ((0, -len(values) % group), (0, 0)), constant_values=np.nan)
    ordered = np.sort(padded.reshape(-1, group, 2), axis=1)
    count = np.isfinite(ordered).sum(axis=1)
    middle = np.maximum(count - 1, 0) // 2
    return np.asarray(np.take_along_axis(ordered, middle[:, None, :], axis=1)[:, 0])


def _smooth(measured: FloatArray, sigma: float, step: float) -> FloatArray:
    """Shape (G, 2): range of each side, by a Kalman filter forward and a smoother back."""
    kalman, good = _kalman(measured, sigma, step), np.isfinite(measured)
    means, covariances, lost = np.empty((len(measured), 3)), np.empty((len(measured), 3, 3)), np.zeros(2, dtype=int)
    for i, z in enumerate(measured):
        if i > 0:
            kalman.predict()
        is_near = good[i] & ((np.abs(z - kalman.H @ kalman.x) < _gates(kalman)) | (lost >= _LOST))
        lost = np.where(good[i] & ~is_near, lost + 1, 0)
        if is_near.any():
            noise = np.where(is_near, sigma**2, 1e6)
            kalman.update(np.where(is_near, z, kalman.H @ kalman.x), R=np.diag(noise))
        means[i], covariances[i] = kalman.x, kalman.P
    smooth, *_ = kalman.rts_smoother(means, covariances)
    return np.asarray(smooth @ kalman.H.T)


def _gates(kalman: Any) -> FloatArray:
    spread = np.einsum("ij,jk,ik->i", kalman.H, kalman.P, kalman.H) + kalman.R[0, 0]
    return np.asarray(_GATE * np.sqrt(spread))


def _kalman(measured: FloatArray, sigma: float, step: float) -> Any:
    """A filter over mean range, its change a group, and half the difference between the sides."""
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=3, dim_z=2)
    start = np.nanmedian(measured[np.isfinite(measured).any(axis=1)][:9])
    kalman.x = np.array([start, 0.0, 0.0])
    kalman.F = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    kalman.H = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, -1.0]])
    kalman.P, kalman.R = np.diag([1.0, 0.01, 0.1]), np.eye(2) * sigma**2
    rate = max(0.02, 0.1 * step)  # a seafloor changes its slope by about a tenth from group to group
    kalman.Q = np.zeros((3, 3))
    kalman.Q[:2, :2] = rate**2 * np.array([[0.25, 0.5], [0.5, 1.0]])
    kalman.Q[2, 2] = (0.3 * rate) ** 2
    return kalman
