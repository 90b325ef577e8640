"""What is estimated of a window: a smooth seafloor, what stands on it, reflectivity, beam pattern and gains."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.fft import dctn, idctn

from frontend.arrays import FloatArray


@dataclass(frozen=True)
class Unknowns:
    """A point in the space of the unknowns, or a direction in it.

    As *coordinates*, ``background`` and ``log_reflectivity`` are orthonormal cosine coefficients, in which their priors
    are diagonal; all else is the same.

    Parameters
    ----------
    background : ndarray, shape (n_y, n_x)
        Heights of the smooth seafloor over the expected surface [m].
    objects : ndarray, shape (n_y, n_x)
        Heights of boulders, pits and edges over the background [m].
    log_reflectivity : ndarray, shape (n_y, n_x)
        Natural logarithm of the reflectivity.
    beam : ndarray, shape (2, K)
        Deviation of the logarithmic beam pattern from the dive's, at its knots.
    gain : ndarray, shape (P, 2)
        Logarithmic gain of each line.
    """

    background: FloatArray
    objects: FloatArray
    log_reflectivity: FloatArray
    beam: FloatArray
    gain: FloatArray

    def __iter__(self) -> Iterator[FloatArray]:
        """The five arrays in order."""
        yield from (self.background, self.objects, self.log_reflectivity, self.beam, self.gain)

    def plus(self, step: Self, length: float = 1.0) -> Self:
        """Go along a direction.

        Parameters
        ----------
        step : Unknowns
            The direction.
        length : float
            How far.

        Returns
        -------
        there : Unknowns
            ``self + length * step``.
        """
        return type(self)(*(a + length * b for a, b in zip(self, step, strict=True)))

    def times(self, factor: float) -> Self:
        """Lengthen a direction.

        Parameters
        ----------
        factor : float
            By how much.

        Returns
        -------
        direction : Unknowns
            ``factor * self``.
        """
        return type(self)(*(factor * a for a in self))

    def dot(self, other: Self) -> float:
        """Inner product.

        Parameters
        ----------
        other : Unknowns
            Another direction.

        Returns
        -------
        product : float
            Sum of the products of all entries.
        """
        # not by BLAS, whose threads would cost more than they save, and whose sums depend on their number
        return float(sum(np.einsum("ij,ij", a, b) for a, b in zip(self, other, strict=True)))

    def flat(self) -> FloatArray:
        """All entries in one row: the linear solves go along hundreds of directions.

        Returns
        -------
        row : ndarray, shape (3 * n_y * n_x + 2 * K + 2 * P,)
            Background, reflectivity, objects, beam pattern, gains; a copy.
        """
        parts = (self.background, self.log_reflectivity, self.objects, self.beam, self.gain)
        return np.concatenate([part.ravel() for part in parts])

    def filled(self, row: FloatArray) -> Self:
        """The same kind of point with other entries.

        Parameters
        ----------
        row : ndarray
            As `flat` gives it.

        Returns
        -------
        unknowns : Unknowns
            Views of the row.
        """
        parts = (self.background, self.log_reflectivity, self.objects, self.beam, self.gain)
        ends = np.cumsum([part.size for part in parts])
        pieces = zip(np.split(row, ends[:-1]), parts, strict=True)
        background, log_reflectivity, objects, beam, gain = (piece.reshape(part.shape) for piece, part in pieces)
        return type(self)(background, objects, log_reflectivity, beam, gain)

    def to_coordinates(self) -> Self:
        """Cosine coefficients in place of the two smooth rasters.

        Returns
        -------
        coordinates : Unknowns
            The same point or direction.
        """
        background, log_reflectivity = to_cosine(np.stack([self.background, self.log_reflectivity]))
        return type(self)(background, self.objects, log_reflectivity, self.beam, self.gain)

    def from_coordinates(self) -> Self:
        """Rasters in place of the cosine coefficients.

        Returns
        -------
        unknowns : Unknowns
            The same point or direction.
        """
        background, log_reflectivity = from_cosine(np.stack([self.background, self.log_reflectivity]))
        return type(self)(background, self.objects, log_reflectivity, self.beam, self.gain)


def nothing(shape: tuple[int, int], n_knots: int, n_lines: int) -> Unknowns:
    """The origin of the space of the unknowns.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the rasters.
    n_knots, n_lines : int
        Knots of the beam pattern and lines of the window.

    Returns
    -------
    unknowns : Unknowns
        All zero.
    """
    background, objects, log_reflectivity = (np.zeros(shape) for _ in range(3))
    return Unknowns(background, objects, log_reflectivity, np.zeros((2, n_knots)), np.zeros((n_lines, 2)))


def to_cosine(x: FloatArray) -> FloatArray:
    """Orthonormal cosine coefficients of rasters.

    Parameters
    ----------
    x : ndarray, shape (..., n_y, n_x)
        Rasters.

    Returns
    -------
    coefficients : ndarray, shape (..., n_y, n_x)
        Their coefficients.
    """
    return np.asarray(dctn(x, axes=(-2, -1), norm="ortho"))


def from_cosine(coefficients: FloatArray) -> FloatArray:
    """Rasters of orthonormal cosine coefficients.

    Parameters
    ----------
    coefficients : ndarray, shape (..., n_y, n_x)
        Coefficients.

    Returns
    -------
    x : ndarray, shape (..., n_y, n_x)
        The rasters.
    """
    return np.asarray(idctn(coefficients, axes=(-2, -1), norm="ortho"))
