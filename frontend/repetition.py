"""Repetition: waves of one length and direction look alike everywhere; they tell a floor's kind, not the place."""

from functools import lru_cache
from typing import NamedTuple

import numba
import numpy as np
from scipy.fft import fft2, fftfreq, ifft2, next_fast_len
from scipy.ndimage import gaussian_filter

from frontend.arrays import FloatArray, IntArray

_WIDTH = 1.5  # waves a raster [1] over which power is averaged: crests wander, and a raster is short
_N_PASSES = 2  # what the gaps and rims of a raster spread of tall waves is less, and goes in the second
_EXCESS = 2.0  # times the usual power of its wavelength that is left to a direction; chance hardly makes more


class _Rings(NamedTuple):
    """Coefficients of a transform by their wavenumber: each one's ring, their order by ring, where each ring begins."""

    number: IntArray
    order: IntArray
    starts: IntArray


def without_repetition(values: FloatArray, weight: FloatArray) -> FloatArray:
    """Bring waves that run in one direction down to what all directions have.

    Parameters
    ----------
    values, weight : ndarray, shape (n_y, n_x)
        A raster of about zero mean and the trust in its cells [1]; cells of weight 0 count as 0.

    Returns
    -------
    rest : ndarray, shape (n_y, n_x)
        The raster, its power at each wavenumber at most twice the median over all directions at that wavelength; 0
        where the weight is 0.

    Notes
    -----
    Sand waves and ripples shifted by a wavelength lie on themselves. Where they hold most of the relief's power, the
    right alignment is one of many that are nearly as good, though the floor between the crests fits but once. A relief
    that looks alike in all directions stays as it is.
    """
    rest = np.where(weight > 0, values, 0.0)
    n_y, n_x = values.shape
    rings = _rings(next_fast_len(2 * n_y), next_fast_len(2 * n_x), min(n_y, n_x))
    for _ in range(_N_PASSES):
        rest = np.where(weight > 0, _evened(rest, rings), 0.0)
    return np.asarray(rest)


def _evened(values: FloatArray, rings: _Rings) -> FloatArray:
    """A raster, the power of each coefficient of its padded transform limited by that of its ring."""
    shape = rings.number.shape
    spectrum = fft2(values, shape)
    widths = [_WIDTH * padded / n for padded, n in zip(shape, values.shape, strict=True)]
    power = gaussian_filter(np.abs(spectrum) ** 2, widths, mode="wrap", truncate=3.0)
    usual = _medians(power.ravel()[rings.order], rings.starts)[rings.number]
    gain = np.sqrt(np.minimum(1.0, _EXCESS * usual / np.maximum(power, np.finfo(np.float64).tiny)))
    return np.asarray(ifft2(gain * spectrum).real[: values.shape[0], : values.shape[1]])


@lru_cache(maxsize=16)
def _rings(n_y: int, n_x: int, n: int) -> _Rings:
    """The rings of wavenumbers of a transform of (n_y, n_x) coefficients, each one wave in n cells wide."""
    number = np.rint(n * np.hypot(fftfreq(n_y)[:, None], fftfreq(n_x)[None, :])).astype(np.int64)
    ends = np.cumsum(np.bincount(number.ravel()))
    return _Rings(number, np.argsort(number, axis=None, kind="stable"), np.concatenate([[0], ends]))


@numba.njit(cache=True, nogil=True)
def _medians(values: FloatArray, starts: IntArray) -> FloatArray:
    """Median of each stretch ``values[starts[k] : starts[k + 1]]``; 0 where there is none."""
    medians = np.zeros(len(starts) - 1)
    for k in range(len(medians)):
        if starts[k + 1] > starts[k]:
            medians[k] = np.median(values[starts[k] : starts[k + 1]])
    return medians
