"""Masked normalised cross-correlation of two places over every shift, by FFT: of all that is known there at once."""

from dataclasses import dataclass

import numba
import numpy as np
from scipy.fft import fft, ifft, irfft, rfft

from frontend.arrays import AnyArray, FloatArray

_SIZES = (8, 9, 10, 12, 15, 16)  # in eighths of an octave, with factors that an FFT likes
_ROUNDING = 1e-4  # of the largest sum of squares: single precision is better


@dataclass(frozen=True)
class CorrelationSurface:
    """Correlation of a target with a source shifted by every whole number of cells.

    Parameters
    ----------
    correlation : ndarray, shape (C, n_y, n_x)
        Weighted correlation coefficient of each raster over the overlap [1]; 0 where nothing overlaps.
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
class Shifts:
    """The shifts wanted of a correlation.

    Parameters
    ----------
    first_y, end_y, first_x, end_x : int
        Target cells that the source's first cell falls on: ``first <= cell < end`` along each axis.
    """

    first_y: int
    end_y: int
    first_x: int
    end_x: int

    def within(self, target: tuple[int, int], source: tuple[int, int]) -> "Shifts":
        """Leave out the shifts at which two rasters have no cell in common.

        Parameters
        ----------
        target, source : tuple of int
            Cells of the two rasters.

        Returns
        -------
        shifts : Shifts
            Those of these at which at least one cell is common; perhaps none.
        """
        first_y, first_x = max(self.first_y, 1 - source[0]), max(self.first_x, 1 - source[1])
        return Shifts(
            first_y, max(min(self.end_y, target[0]), first_y), first_x, max(min(self.end_x, target[1]), first_x)
        )

    def needs(self, target: tuple[int, int], source: tuple[int, int]) -> tuple[int, int]:
        """Least raster size at which these shifts wrap nothing around.

        Parameters
        ----------
        target, source : tuple of int
            Cells of the two rasters.

        Returns
        -------
        cells : tuple of int
            Cells to pad to; fewer shifts need fewer.
        """
        ranges = ((self.first_y, self.end_y), (self.first_x, self.end_x))
        rows, columns = (
            max(a, b, a - first, end - 1 + b) for (first, end), a, b in zip(ranges, target, source, strict=True)
        )
        return rows, columns


def all_shifts(target: tuple[int, int], source: tuple[int, int]) -> Shifts:
    """Every shift at which two rasters have a cell in common.

    Parameters
    ----------
    target, source : tuple of int
        Cells of the two rasters.

    Returns
    -------
    shifts : Shifts
        From the source's last cell on the target's first to its first on the target's last.
    """
    return Shifts(1 - source[0], target[0], 1 - source[1], target[1])


@dataclass(frozen=True)
class Spectra:
    """Fourier transforms of rasters that share a weight: mask, weight, then of each its weighted values and squares.

    Parameters
    ----------
    transforms : ndarray of complex, shape (2 + 2 C, n_y, n_x // 2 + 1)
        The transforms, zero-padded.
    shape : tuple of int
        Cells of the rasters before padding.
    padded : tuple of int
        Cells after padding.
    """

    transforms: AnyArray
    shape: tuple[int, int]
    padded: tuple[int, int]


def common_size(n: int) -> int:
    """Size of a padded raster that many rasters of about one size share.

    Parameters
    ----------
    n : int
        Least size [cells].

    Returns
    -------
    size : int
        Not smaller, of few factors, at most a quarter larger where ``n`` is 16 or more.
    """
    octave = 2 ** max((n - 1).bit_length() - 4, 0)
    return next(m * octave for m in _SIZES if m * octave >= n)


def spectra(values: FloatArray, weight: FloatArray, padded: tuple[int, int]) -> Spectra:
    """Transform rasters for correlation.

    Parameters
    ----------
    values : ndarray, shape (C, n_y, n_x)
        Values of each raster.
    weight : ndarray, shape (n_y, n_x)
        The trust in all of them [1], 0 where unknown.
    padded : tuple of int
        At least what `Shifts.needs`; any size will do, `common_size` is fast and shared by many.

    Returns
    -------
    spectra : Spectra
        What `correlate` needs; reusable for every partner of the same padded size.
    """
    rasters = np.empty((2 + 2 * len(values), *weight.shape), dtype=np.float32)
    _weigh(np.ascontiguousarray(values), np.ascontiguousarray(weight), rasters)
    rows = rfft(rasters, padded[1], axis=2)  # of what is known alone: the padding's are 0
    return Spectra(fft(rows, padded[0], axis=1, overwrite_x=True), (weight.shape[0], weight.shape[1]), padded)


def correlate(target: Spectra, source: Spectra, shifts: Shifts | None = None) -> CorrelationSurface:
    """Correlate two places over shifts, raster by raster.

    Parameters
    ----------
    target, source : Spectra
        Transforms of as many rasters and the same padded size.
    shifts : Shifts, optional
        Those wanted; all where left out.

    Returns
    -------
    surface : CorrelationSurface
        One value a shift, as in the masked correlation of [1]_ with weights in the place of masks.

    Raises
    ------
    ValueError
        If the numbers of rasters or the padded sizes differ, or these are too small for the two places.

    Notes
    -----
    The mean over each overlap is taken to be zero and not removed, which spares two transforms a raster and one: a
    relief has no waves that are longer than an overlap. Mask, weight and the cells in common are shared by all rasters.

    References
    ----------
    .. [1] D. Padfield, "Masked Object Registration in the Fourier Domain", IEEE Trans. Image Processing 21(5), 2012.
       :doi:`10.1109/TIP.2011.2181402`
    """
    shifts = shifts or all_shifts(target.shape, source.shape)
    if len(target.transforms) != len(source.transforms):
        raise ValueError(
            f"spectra of as many rasters are wanted, got {len(target.transforms) // 2 - 1} "
            f"and {len(source.transforms) // 2 - 1}"
        )
    if target.padded != source.padded or any(
        p < n for p, n in zip(target.padded, shifts.needs(target.shape, source.shape), strict=True)
    ):
        raise ValueError(
            f"spectra must be padded alike and enough for both, got {target.padded} of {target.shape} "
            f"and {source.padded} of {source.shape}"
        )
    y, x = np.arange(shifts.first_y, shifts.end_y), np.arange(shifts.first_x, shifts.end_x)
    products = np.empty((3 * len(target.transforms) // 2 - 2, *target.transforms.shape[1:]), dtype=np.complex64)
    _multiply(target.transforms, source.transforms, products)
    rows = np.take(ifft(products, axis=1, overwrite_x=True), y, axis=1)  # negative shifts: at the end, as Python counts
    sums = irfft(rows, target.padded[1], axis=2, overwrite_x=True)
    correlation, overlap = np.zeros((len(sums) // 3, len(y), len(x))), np.empty((len(y), len(x)))
    _coefficients(sums, x, correlation, overlap)
    return CorrelationSurface(correlation, overlap, y, x)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _weigh(values: FloatArray, weight: FloatArray, rasters: FloatArray) -> None:
    """Mask, weight, then of each raster its weighted values and squares."""
    for i in range(weight.shape[0]):
        for j in range(weight.shape[1]):
            w = weight[i, j]
            rasters[0, i, j], rasters[1, i, j] = w > 0, w
            for c in range(values.shape[0]):
                rasters[2 + 2 * c, i, j] = w * values[c, i, j]
                rasters[3 + 2 * c, i, j] = w * values[c, i, j] ** 2


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _multiply(target: AnyArray, source: AnyArray, products: AnyArray) -> None:
    """Mask times mask, then of each raster wa wb, waa w and w wbb, the source conjugate."""
    for i in range(target.shape[1]):
        for j in range(target.shape[2]):
            weight = np.conj(source[1, i, j])
            products[0, i, j] = target[0, i, j] * np.conj(source[0, i, j])
            for c in range(target.shape[0] // 2 - 1):
                products[1 + 3 * c, i, j] = target[2 + 2 * c, i, j] * np.conj(source[2 + 2 * c, i, j])
                products[2 + 3 * c, i, j] = target[3 + 2 * c, i, j] * weight
                products[3 + 3 * c, i, j] = target[1, i, j] * np.conj(source[3 + 2 * c, i, j])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _coefficients(sums: FloatArray, x: AnyArray, correlation: FloatArray, overlap: FloatArray) -> None:
    """Cells in common and correlations from the sums of mask, then ab, aa, bb; left 0 where squares are rounding."""
    for i in range(overlap.shape[0]):
        for j in range(overlap.shape[1]):
            overlap[i, j] = max(np.rint(sums[0, i, x[j]]), 0.0)
    for c in range(correlation.shape[0]):
        ab, aa, bb = sums[1 + 3 * c], sums[2 + 3 * c], sums[3 + 3 * c]
        most_a, most_b = 0.0, 0.0
        for i in range(overlap.shape[0]):
            for j in x:
                most_a, most_b = max(most_a, aa[i, j]), max(most_b, bb[i, j])
        least_a, least_b = max(_ROUNDING * most_a, 1e-30), max(_ROUNDING * most_b, 1e-30)
        for i in range(overlap.shape[0]):
            for k, j in enumerate(x):
                if aa[i, j] > least_a and bb[i, j] > least_b:
                    coefficient = ab[i, j] / np.sqrt(np.float64(aa[i, j]) * np.float64(bb[i, j]))
                    correlation[c, i, k] = min(max(coefficient, -1.0), 1.0)
