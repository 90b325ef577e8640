"""Repetition: waves of one length and direction look alike everywhere; they tell a floor's kind, not the place."""

import numpy as np
from scipy.fft import fft2, fftfreq, ifft2, next_fast_len
from scipy.ndimage import gaussian_filter, median

from frontend.arrays import FloatArray, IntArray

_WIDTH = 1.5  # waves a raster [1] over which power is averaged: crests wander, and a raster is short
_N_PASSES = 2  # what the gaps and rims of a raster spread of tall waves is less, and goes in the second
_EXCESS = 2.0  # times the usual power of its wavelength that is left to a direction; chance hardly makes more


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
    ring = _rings(tuple(next_fast_len(2 * n) for n in values.shape), min(values.shape))
    for _ in range(_N_PASSES):
        rest = np.where(weight > 0, _evened(rest, ring), 0.0)
    return np.asarray(rest)


def _evened(values: FloatArray, ring: IntArray) -> FloatArray:
    """A raster, the power of each coefficient of its padded transform limited by that of its ring."""
    spectrum = fft2(values, ring.shape)
    widths = [_WIDTH * padded / n for padded, n in zip(ring.shape, values.shape, strict=True)]
    power = gaussian_filter(np.abs(spectrum) ** 2, widths, mode="wrap", truncate=3.0)
    usual = np.asarray(median(power, ring, np.arange(ring.max() + 1)))[ring]
    gain = np.sqrt(np.minimum(1.0, _EXCESS * usual / np.maximum(power, np.finfo(np.float64).tiny)))
    return np.asarray(ifft2(gain * spectrum).real[: values.shape[0], : values.shape[1]])


def _rings(shape: tuple[int, ...], n: int) -> IntArray:
    """Number of the ring of wavenumbers that each coefficient is of, a ring one wave in n cells wide."""
    k_y, k_x = (fftfreq(size) for size in shape)
    return np.rint(n * np.hypot(k_y[:, None], k_x[None, :])).astype(np.int64)
