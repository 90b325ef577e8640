"""Masked normalised cross-correlation of two reliefs over every shift, by FFT."""

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2

from frontend.arrays import AnyArray, FloatArray


@dataclass(frozen=True)
class CorrelationSurface:
    """Correlation of a target with a source shifted by every whole number of cells.

    Parameters
    ----------
    correlation : ndarray, shape (n_y, n_x)
        Weighted correlation coefficient over the overlap [1]; 0 where nothing overlaps.
    overlap : ndarray, shape (n_y, n_x)
        Cells trusted in both.
    shift_y, shift_x : ndarray of int, shape (n_y,), (n_x,)
        Target cell that the source's first cell falls on.
    """

    correlation: FloatArray
    overlap: FloatArray
    shift_y: AnyArray
    shift_x: AnyArray


@dataclass(frozen=True)
class Spectra:
    """Fourier transforms of one raster: its weights, weighted values, weighted squares and mask.

    Parameters
    ----------
    transforms : ndarray of complex, shape (4, n_y, n_x // 2 + 1)
        The transforms, zero-padded.
    shape : tuple of int
        Cells of the raster before padding.
    padded : tuple of int
        Cells after padding.
    """

    transforms: AnyArray
    shape: tuple[int, int]
    padded: tuple[int, int]


def padded_shape(first: tuple[int, int], second: tuple[int, int]) -> tuple[int, int]:
    """Raster size at which two rasters correlate without wrapping around.

    Parameters
    ----------
    first, second : tuple of int
        Cells of the two rasters.

    Returns
    -------
    padded : tuple of int
        A size that the FFT likes.
    """
    rows, columns = (next_fast_len(a + b - 1, real=True) for a, b in zip(first, second, strict=True))
    return rows, columns


def spectra(values: FloatArray, weight: FloatArray, padded: tuple[int, int]) -> Spectra:
    """Transform a raster for correlation.

    Parameters
    ----------
    values, weight : ndarray, shape (n_y, n_x)
        Values and the trust in them [1], 0 where unknown.
    padded : tuple of int
        Size from `padded_shape`.

    Returns
    -------
    spectra : Spectra
        What `correlate` needs; reusable for every partner of the same padded size.
    """
    rasters = np.stack([weight, weight * values, weight * values**2, weight > 0]).astype(np.float32)
    return Spectra(rfft2(rasters, padded), (values.shape[0], values.shape[1]), padded)


def correlate(target: Spectra, source: Spectra) -> CorrelationSurface:
    """Correlate two rasters over all shifts.

    Parameters
    ----------
    target, source : Spectra
        Transforms of the same padded size.

    Returns
    -------
    surface : CorrelationSurface
        One value a shift, as in the masked correlation of [1]_ with weights in the place of masks.

    Raises
    ------
    ValueError
        If the padded sizes differ or are too small for the two rasters.

    References
    ----------
    .. [1] D. Padfield, "Masked Object Registration in the Fourier Domain", IEEE Trans. Image Processing 21(5), 2012.
       :doi:`10.1109/TIP.2011.2181402`
    """
    if target.padded != source.padded or any(
        p < a + b - 1 for p, a, b in zip(target.padded, target.shape, source.shape, strict=True)
    ):
        raise ValueError(
            f"spectra must be padded alike and enough for both, got {target.padded} of {target.shape} "
            f"and {source.padded} of {source.shape}"
        )
    a, b = target.transforms, np.conj(source.transforms)
    products = np.stack([a[0] * b[0], a[1] * b[0], a[0] * b[1], a[2] * b[0], a[0] * b[2], a[1] * b[1], a[3] * b[3]])
    sums = irfft2(products, target.padded).astype(np.float64)
    shifts = [np.arange(1 - n_b, n_a) for n_a, n_b in zip(target.shape, source.shape, strict=True)]
    sums = sums[:, shifts[0][:, None], shifts[1]]
    return CorrelationSurface(_coefficient(sums[:6]), np.maximum(np.rint(sums[6]), 0.0), shifts[0], shifts[1])


def _coefficient(sums: FloatArray) -> FloatArray:
    """Correlation from the sums of w, wa, wb, waa, wbb and wab."""
    least = 1e-4 * float(sums[0].max(initial=0.0)) + 1e-30  # single precision is worse than that by two digits
    mean_a, mean_b, aa, bb, ab = sums[1:] / np.maximum(sums[0], least)
    variance = np.maximum(aa - mean_a**2, 0.0) * np.maximum(bb - mean_b**2, 0.0)
    usable = (sums[0] > least) & (variance > 1e-6 * float(aa.max(initial=0.0)) * float(bb.max(initial=0.0)))
    coefficient = (ab - mean_a * mean_b) / np.sqrt(np.where(usable, variance, 1.0))
    return np.asarray(np.where(usable, np.clip(coefficient, -1.0, 1.0), 0.0))
