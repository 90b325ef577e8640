"""The curvature of a posterior as products, never as a matrix, and a preconditioner that goes with it."""

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from scipy.sparse import csr_array

from frontend.arrays import AnyArray, FloatArray
from frontend.reconstruction.forward import Curvature, Raster
from frontend.reconstruction.priors import Prior, wavenumbers
from frontend.reconstruction.unknowns import Unknowns, nothing


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
        data = self._multiply_data(v.from_coordinates()).to_coordinates()
        return data.plus(self.prior.multiply(v, self.object_precision))

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
        background, objects, reflectivity, beam, gain = self._preconditioner
        turned = np.stack([b @ w for b, w in zip(beam, v.beam, strict=True)])
        return Unknowns(
            v.background / background, v.objects / objects, v.log_reflectivity / reflectivity, turned, v.gain / gain
        )

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
        background, _, reflectivity, _, _ = self._preconditioner
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

    def _multiply_data(self, v: Unknowns) -> Unknowns:
        """What bins and altimeter add to the curvature, times a direction, as rasters."""
        heights = (v.background + v.objects).ravel()
        change = np.empty(self.weight.shape)
        rasters = (heights, np.ascontiguousarray(v.log_reflectivity).ravel())
        _push(self._entries, rasters, v.beam, v.gain, change)
        weights, precision = self.below
        return self._pull(self.weight * change, weights.T @ (precision * (weights @ heights)))

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
    def _preconditioner(self) -> tuple[FloatArray, ...]:
        """Diagonals in coordinates; of the beam pattern the inverse of a matrix a side."""
        cells = np.zeros(self.raster.n_cells)
        _square(self.rows.cell, self.rows.by_height, self.rows.n_cells, self.weight, cells)
        k2_y, k2_x = wavenumbers(self.raster)
        across = (0.8 * k2_y + 0.2 * k2_x) * self.raster.spacing**2  # the frame's y runs across the track
        information = [np.diag(side) for side in self.beam_information]
        return (
            self.prior.background + 0.5 * cells.mean() * across + self._information_of_level("background"),
            self.object_precision + cells.reshape(self.raster.shape),
            self.prior.reflectivity + self._information_of_level("log_reflectivity"),
            np.stack([np.linalg.inv(self.prior.beam + side) for side in information]),
            self.prior.gain + (self.weight * self.rows.share**2).sum(axis=2),
        )

    def _information_of_level(self, name: str) -> float:
        """What the data say, a cell, about adding the same to a whole raster."""
        v = nothing(self.raster.shape, len(self.prior.beam), len(self.weight))
        getattr(v, name)[:] = 1.0
        return float(getattr(self._multiply_data(v), name).mean())


@numba.njit(cache=True, nogil=True)
def _push(entries, rasters, beam, gain, change):  # type: ignore[no-untyped-def]
    """Change of ln mu of every bin in a direction."""
    cell, by_height, by_reflectivity, n_cells, shares, knots = entries
    height, reflectivity = rasters
    for ping in range(cell.shape[0]):
        for side in range(2):
            for b in range(cell.shape[2]):
                c, jz, jr = cell[ping, side, b], by_height[ping, side, b], by_reflectivity[ping, side, b]
                knot = knots[ping, side, b]
                k = min(int(knot), beam.shape[1] - 2)
                sonar = gain[ping, side] + beam[side, k] + (knot - k) * (beam[side, k + 1] - beam[side, k])
                total = shares[ping, side, b] * sonar
                for i in range(n_cells[ping, side, b]):
                    total += jz[i] * height[c[i]] + jr[i] * reflectivity[c[i]]
                change[ping, side, b] = total


@numba.njit(cache=True, nogil=True)
def _pull(entries, values, out, beam, gain):  # type: ignore[no-untyped-def]
    """The transpose of `_push`."""
    cell, by_height, by_reflectivity, n_cells, shares, knots = entries
    for ping in range(cell.shape[0]):
        for side in range(2):
            for b in range(cell.shape[2]):
                value = values[ping, side, b]
                if value == 0.0:
                    continue
                c, jz, jr = cell[ping, side, b], by_height[ping, side, b], by_reflectivity[ping, side, b]
                for i in range(n_cells[ping, side, b]):
                    out[0, c[i]] += jz[i] * value
                    out[1, c[i]] += jr[i] * value
                knot, sonar = knots[ping, side, b], shares[ping, side, b] * value
                k = min(int(knot), beam.shape[1] - 2)
                beam[side, k] += (k + 1 - knot) * sonar
                beam[side, k + 1] += (knot - k) * sonar
                gain[ping, side] += sonar


@numba.njit(cache=True, nogil=True)
def _square(cell, by_height, n_cells, weight, cells):  # type: ignore[no-untyped-def]
    """Weighted sums of squared derivatives by the height of each cell."""
    for ping in range(weight.shape[0]):
        for side in range(2):
            for b in range(weight.shape[2]):
                for i in range(n_cells[ping, side, b]):
                    cells[cell[ping, side, b, i]] += weight[ping, side, b] * by_height[ping, side, b, i] ** 2
