"""The silent tail of a ping: at low altitude every echo is back before the end of the recording."""

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.bottom_levels import Cells
from frontend.recording import Recording

_N_SMOOTHED = 5  # cells: single cells of noise exceed any threshold
_SHADOW, _N_GROUPS = 10.0, (11, 101)  # a shadow that reaches the end is shorter than half of this [m]; in groups
_ABOVE = 2.0  # standard deviations of single cells, 4.5 of smoothed ones
_LEAST_RISE = 0.1  # share of the step from water to bottom below which all is silence
_MOST_RISE = 0.6  # share that noise may gain towards far ranges


def last_usable_samples(recording: Recording, cells: Cells, first_bottom_return: FloatArray) -> IntArray:
    """Last sample of each ping and side before nothing but noise is left.

    Parameters
    ----------
    recording : Recording
        The dive.
    cells : Cells
        Its levels.
    first_bottom_return : ndarray, shape (N, 2)
        Slant range of the first echo from the seafloor [m]; NaN on a side where it is not known.

    Returns
    -------
    last_usable_sample : ndarray of int, shape (N, 2)
        The last sample of the ping where there is no silent tail.

    Notes
    -----
    Noise is known from the water column; its gain over range is continued beyond it. A shadow that reaches the end
    of the recording is silent too, but only in a few pings.
    """
    n, step = recording.n_samples, cells.group * float(np.nan_to_num(recording.ping_spacing))
    length = int(np.clip(_SHADOW / max(step, 1e-3), *_N_GROUPS)) // 2 * 2 + 1
    result = np.full((recording.n_pings, 2), n - 1, dtype=np.int64)
    ping = np.round(cells.middle_ping).astype(int).clip(0, recording.n_pings - 1)
    group = np.arange(recording.n_pings) // cells.group
    for side in np.flatnonzero(np.isfinite(first_bottom_return).all(axis=0)):
        end = _ends(cells.level[side], cells.slant_range, first_bottom_return[ping, side])
        end = median_filter(end, length, mode="nearest")
        has_tail = end < cells.level.shape[2] - 2 * _N_SMOOTHED
        sample = np.floor(end[group] * cells.width / recording.sample_spacing).astype(np.int64) - 1
        result[:, side] = np.where(has_tail[group], np.clip(sample, 0, n - 1), n - 1)
    return result


def _ends(level: FloatArray, slant_range: FloatArray, edge: FloatArray) -> IntArray:
    """Shape (G,): cell at which the tail of a group begins, the number of cells where it has none."""
    n = level.shape[1]
    in_water = (slant_range > 0.4 * edge[:, None]) & (slant_range < 0.9 * edge[:, None] - 2 * slant_range[1])
    in_water &= np.isfinite(level)
    beyond = (slant_range > edge[:, None]) & (slant_range < 1.5 * edge[:, None]) & np.isfinite(level)
    if in_water.sum() < 20 or not beyond.any():
        return np.full(len(level), n)
    noise, spread = _noise(level, slant_range, in_water)
    rise = float(np.median(level[beyond])) - float(np.median(level[in_water]))
    noise = np.minimum(noise, _means(level, in_water) + _MOST_RISE * rise)
    threshold = noise + max(_ABOVE * spread, _LEAST_RISE * rise)
    known = np.where(np.isfinite(level), level, threshold - 1.0)
    is_loud = uniform_filter1d(known, _N_SMOOTHED, axis=1, mode="nearest") > threshold
    return np.where(is_loud.any(axis=1), n - np.argmax(is_loud[:, ::-1], axis=1), n)


def _noise(level: FloatArray, slant_range: FloatArray, in_water: BoolArray) -> tuple[FloatArray, float]:
    """Shape (G, C): noise level, a straight line over the logarithm of range that never falls; its spread."""
    log_range = np.log(np.maximum(slant_range, slant_range[1]))
    middle_level, middle_range = _means(level, in_water), _means(np.broadcast_to(log_range, level.shape), in_water)
    rest, along = (level - middle_level)[in_water], (log_range - middle_range)[in_water]
    slope = max(float(along @ rest) / max(float(along @ along), 1e-9), 0.0)
    off = rest - slope * along
    return middle_level + slope * (log_range - middle_range), 1.4826 * float(np.median(np.abs(off)))


def _means(values: FloatArray, chosen: BoolArray) -> FloatArray:
    """Shape (G, 1): mean of the chosen values of each row, of all rows where a row has none."""
    count = chosen.sum(axis=1, keepdims=True)
    mean = np.where(chosen, values, 0.0).sum(axis=1, keepdims=True) / np.maximum(count, 1)
    return np.asarray(np.where(count > 0, mean, values[chosen].mean()))
