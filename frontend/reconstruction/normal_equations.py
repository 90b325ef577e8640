"""The curvature of a posterior as products, never as a matrix, and a preconditioner that goes with it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from frontend.arrays import AnyArray, FloatArray
from frontend.reconstruction.forward import Curvature, Raster
from frontend.reconstruction.normal_kernels import _multiply_bins, _multiply_places, _pull, _square
from frontend.reconstruction.priors import Prior, wavenumbers
from frontend.reconstruction.unknowns import Unknowns, from_cosine, to_cosine


@dataclass(frozen=True)
class NormalEquations:
    """The curvature of a posterior at one state, as products with coordinates, in which the prior is diagonal.

    Parameters
    ----------
    raster : Raster
        The grid.
    prior : Prior
        Belief about the unknowns.
    rows : Curvature
        Jacobian of ln mu.
    weight : ndarray, shape (P, 2, B)
        Information of each bin.
    below : tuple of csr_array, shape (A, n_cells), and ndarray, shape (A,)
        Weights of the cells below the track, and precisions of the heights measured there [1/m^2].
    object_precision : ndarray, shape (n_y, n_x)
        Precision of each cell's object [1/m^2].
    """

    raster: Raster
    prior: Prior
    rows: Curvature
    weight: FloatArray
    below: tuple[csr_array, FloatArray]
    object_precision: FloatArray

    def multiply(self, v: Unknowns) -> Unknowns:
        """Curvature times a vector.

        Parameters
        ----------
        v : Unknowns
            A direction, as coordinates.

        Returns
        -------
        product : Unknowns
            As coordinates.
        """
        return v.filled(self.multiply_flat(v.flat()))

    def multiply_flat(self, v: FloatArray) -> FloatArray:
        """Curvature times a vector in one row.

        Parameters
        ----------
        v : ndarray
            A direction as coordinates, as `Unknowns.flat` gives it.

        Returns
        -------
        product : ndarray, shape of v
            As coordinates.
        """
        n, shape = self.raster.n_cells, (2, *self.raster.shape)
        beam = slice(3 * n, 3 * n + 2 * len(self.prior.beam))
        product = self._prior_diagonal * v
        product[beam] = (v[beam].reshape(2, -1) @ self.prior.beam).ravel()
        rasters, back = from_cosine(v[: 2 * n].reshape(shape)).reshape(2, n), np.zeros((2, n))
        rasters[0] += v[2 * n : 3 * n]
        _multiply_bins(self._entries, self.weight, (rasters, v[3 * n :]), back, product[3 * n :])
        _multiply_places(self._below, rasters[0], back[0])
        product[2 * n : 3 * n] += back[0]
        product[: 2 * n] += to_cosine(back.reshape(shape)).ravel()
        return product

    def precondition(self, v: Unknowns) -> Unknowns:
        """Roughly the inverse curvature times a vector.

        Parameters
        ----------
        v : Unknowns
            A gradient, as coordinates.

        Returns
        -------
        step : Unknowns
            As coordinates; exact where all cells are seen alike.
        """
        return v.filled(self.precondition_flat(v.flat()))

    def precondition_flat(self, v: FloatArray) -> FloatArray:
        """Roughly the inverse curvature times a vector in one row.

        Parameters
        ----------
        v : ndarray
            A gradient as coordinates, as `Unknowns.flat` gives it.

        Returns
        -------
        step : ndarray, shape of v
            As coordinates.
        """
        diagonal, beam = self._preconditioner
        first, n_knots = 3 * self.raster.n_cells, len(self.prior.beam)
        step = v / diagonal
        for side in range(2):
            knots = slice(first + side * n_knots, first + (side + 1) * n_knots)
            step[knots] = beam[side] @ v[knots]
        return step

    def draw(self, rng: np.random.Generator) -> Unknowns:
        """A random vector whose covariance is the curvature.

        Parameters
        ----------
        rng : Generator
            Source of randomness.

        Returns
        -------
        draw : Unknowns
            As coordinates; solve the curvature for it to draw from the posterior.
        """
        weights, precision = self.below
        noise = rng.standard_normal(self.weight.shape) * np.sqrt(self.weight)
        data = self._pull(noise, weights.T @ (np.sqrt(precision) * rng.standard_normal(len(precision))))
        return data.to_coordinates().plus(self.prior.draw(self.object_precision, len(self.weight), rng))

    @property
    def background_gain(self) -> FloatArray:
        """Shape (n_y, n_x): share of each wave's variance that the data tell, patches of sediment being possible."""
        background, reflectivity = self._smooth_information
        patches = self.prior.reflectivity / reflectivity  # what is left once an unknown reflectivity is allowed for
        told = (background - self.prior.background) * patches
        return np.asarray(told / (told + self.prior.background))

    @cached_property
    def beam_information(self) -> FloatArray:
        """Shape (2, K): what the echoes say about each knot of the beam pattern."""
        knots = np.zeros((2, len(self.prior.beam)))
        position = np.clip(self.rows.knot, 0, len(self.prior.beam) - 1)
        for side in range(2):
            information = self.weight[:, side] * self.rows.share[:, side] ** 2
            nearest = np.rint(position[:, side]).astype(np.int64)
            knots[side] = np.bincount(nearest.ravel(), information.ravel(), knots.shape[1])
        return knots

    def _pull(self, values: FloatArray, height: FloatArray) -> Unknowns:
        """Adjoint of the Jacobian of ln mu, and something added to the heights."""
        cells, beam = np.zeros((2, self.raster.n_cells)), np.zeros((2, len(self.prior.beam)))
        gain = np.zeros(self.weight.shape[:2])
        _pull(self._entries, values, cells, beam, gain)
        by_height, by_reflectivity = cells.reshape(2, *self.raster.shape)
        by_height += height.reshape(self.raster.shape)
        return Unknowns(by_height, by_height, by_reflectivity, beam, gain)

    @cached_property
    def _entries(self) -> tuple[AnyArray, ...]:
        rows = self.rows
        return rows.cell, rows.by_height, rows.by_reflectivity, rows.n_cells, rows.share, rows.knot

    @cached_property
    def _below(self) -> tuple[AnyArray, ...]:
        weights, precision = self.below
        return weights.indptr, weights.indices, weights.data, precision

    @cached_property
    def _prior_diagonal(self) -> FloatArray:
        """Precisions in the order of `Unknowns.flat`; those of the beam pattern are a matrix and left out."""
        zero, gain = np.zeros((2, len(self.prior.beam))), np.full(self.weight.shape[:2], self.prior.gain)
        prior = self.prior
        return Unknowns(prior.background, self.object_precision, prior.reflectivity, zero, gain).flat()

    @cached_property
    def _squares(self) -> tuple[FloatArray, FloatArray]:
        """What the data say about the height of each cell, and about the level of heights and of reflectivity."""
        cells, levels = np.zeros(self.raster.n_cells), np.zeros(2)
        _square(self._entries, self.weight, cells, levels)
        weights, precision = self.below
        levels[0] += (precision * np.asarray(weights.sum(axis=1)) ** 2).sum()
        return cells, levels / self.raster.n_cells

    @cached_property
    def _smooth_information(self) -> tuple[FloatArray, FloatArray]:
        """Diagonals in coordinates: of the background and of the reflectivity."""
        cells, (height, reflectivity) = self._squares
        k2_y, k2_x = wavenumbers(self.raster)
        across = (0.8 * k2_y + 0.2 * k2_x) * self.raster.spacing**2  # the frame's y runs across the track
        return self.prior.background + 0.5 * cells.mean() * across + height, self.prior.reflectivity + reflectivity

    @cached_property
    def _preconditioner(self) -> tuple[FloatArray, FloatArray]:
        """Diagonal in the order of `Unknowns.flat`, 1 for the beam pattern; of that the inverse of a matrix a side."""
        background, reflectivity = self._smooth_information
        objects = self.object_precision + self._squares[0].reshape(self.raster.shape)
        gain = self.prior.gain + (self.weight * self.rows.share**2).sum(axis=2)
        information = [np.diag(side) for side in self.beam_information]
        diagonal = Unknowns(background, objects, reflectivity, np.ones((2, len(self.prior.beam))), gain).flat()
        return diagonal, np.stack([np.linalg.inv(self.prior.beam + side) for side in information])
