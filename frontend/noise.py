"""Noise floor of a dive: what is heard where there is no seafloor, in the water column and in the silent tail."""

from itertools import pairwise

import numpy as np

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.bottom import Bottom
from frontend.recording import Recording

_WATER = (0.4, 0.85)  # shares of the first bottom return between which there is water: no ringing, no bottom
_LOUD = 6.0  # medians; fish and cross-talk are louder
_LEAST = 1e-6  # share of the mean echo; silence has a floor, too
_FEWEST = 30  # samples a knot


def mean_floor(echoes: FloatArray, recording: Recording, bottom: Bottom) -> FloatArray:
    """Mean intensity in the water column of each side.

    Parameters
    ----------
    echoes : ndarray, shape (N, 2, M)
        Intensities.
    recording : Recording
        The pings they are of.
    bottom : Bottom
        Their first bottom returns.

    Returns
    -------
    floor : ndarray, shape (2,)
        Above zero; fish and cross-talk are left out.
    """
    is_water = _is_water(recording, bottom)
    floor = [_mean_of_quiet(echoes[:, side][is_water[:, side]]) for side in range(2)]
    return np.maximum(floor, _smallest(echoes))


def floor_over_range(
    echoes: FloatArray, recording: Recording, bottom: Bottom, knots: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Noise floor at some ranges: gain that grows with range lifts it.

    Parameters
    ----------
    echoes : ndarray, shape (N, 2, M)
        Intensities.
    recording : Recording
        The pings they are of.
    bottom : Bottom
        Their first bottom returns and silent tails.
    knots : tuple of ndarray, shapes (J,) and (2,)
        Evenly spaced slant ranges [m], and the floor where it was never heard.

    Returns
    -------
    floor : ndarray, shape (2, J)
        As intensity; between and beyond ranges at which it was heard as at the nearest of them.
    """
    slant_range, usual = knots
    step = slant_range[1] - slant_range[0]
    sample = (np.arange(recording.n_samples) + 0.5)[None, :] * recording.sample_spacing[:, None]
    knot = np.minimum(np.round(sample / step).astype(np.int64), slant_range.size - 1)
    is_quiet = _is_water(recording, bottom) | _is_tail(recording, bottom)
    floor = np.empty((2, slant_range.size))
    for side in range(2):
        chosen = is_quiet[:, side] & np.isfinite(echoes[:, side])
        sums = _binned_mean(echoes[:, side][chosen], knot[chosen], slant_range.size)
        heard = np.isfinite(sums)
        floor[side] = np.interp(slant_range, slant_range[heard], sums[heard]) if heard.any() else usual[side]
    return np.maximum(floor, _smallest(echoes))


def _smallest(echoes: FloatArray) -> float:
    return _LEAST * float(np.nanmean(echoes))


def _is_water(recording: Recording, bottom: Bottom) -> BoolArray:
    sample = ((np.arange(recording.n_samples) + 0.5)[None, :] * recording.sample_spacing[:, None])[:, None, :]
    edge = bottom.first_bottom_return[:, :, None]
    return (sample > _WATER[0] * edge) & (sample < _WATER[1] * edge)


def _is_tail(recording: Recording, bottom: Bottom) -> BoolArray:
    if bottom.last_usable_sample is None:
        return np.zeros((recording.n_pings, 2, recording.n_samples), dtype=bool)
    return np.arange(recording.n_samples) > bottom.last_usable_sample[:, :, None]


def _mean_of_quiet(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    median = float(np.median(known)) if known.size else 0.0
    return float(np.mean(known[known <= _LOUD * median])) if median > 0 else 0.0


def _binned_mean(values: FloatArray, knot: IntArray, n: int) -> FloatArray:
    """Mean of the quiet values at each knot; NaN where there are too few."""
    order = np.argsort(knot, kind="stable")
    cuts = np.searchsorted(knot[order], np.arange(n + 1))
    pieces = (values[order[a:b]] for a, b in pairwise(cuts))
    return np.array([_mean_of_quiet(piece) if piece.size >= _FEWEST else np.nan for piece in pieces])
