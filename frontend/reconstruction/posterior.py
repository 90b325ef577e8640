"""The cost that a surface is judged by, its exact gradient, and its curvature."""

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from scipy.sparse import csr_array

from frontend.arrays import FloatArray
from frontend.radiometry import Tables
from frontend.reconstruction.forward import N_CHUNKS, Beams, Bins, Curvature, Raster, linearise, pull_back, render
from frontend.reconstruction.priors import Prior, from_cosine, to_cosine, wavenumbers


@dataclass(frozen=True)
class Altimeter:
    """Heights measured below the track.

    Parameters
    ----------
    weights : csr_array, shape (P, n_cells)
        Bilinear weights of the cells around each place.
    height : ndarray, shape (P,)
        Measured heights in the submap frame [m].
    precision : ndarray, shape (P,)
        Inverse variances [1/m^2].
    """

    weights: csr_array
    height: FloatArray
    precision: FloatArray


@dataclass(frozen=True)
class Posterior:
    """Gamma likelihood of multilooked bins with a robust tail, altimeter and prior, at one resolution.

    The state is an array of shape (2, n_y, n_x): heights [m] and log-reflectivities.

    Parameters
    ----------
    raster, beams, tables, bins
        The forward model's arguments.
    prior : Prior
        Belief about relief and reflectivity.
    expected : ndarray, shape (2, n_y, n_x)
        Mean of the prior: a smooth surface through the altimeter's heights, and no reflectivity contrast.
    altimeter : Altimeter
        Heights below the track.
    tail : float
        Deviance at which a bin counts half; larger outliers count less.
    """

    raster: Raster
    beams: Beams
    tables: Tables
    bins: Bins
    prior: Prior
    expected: FloatArray
    altimeter: Altimeter
    tail: float

    def predict(self, x: FloatArray) -> FloatArray:
        """Expected intensity of every bin.

        Parameters
        ----------
        x : ndarray, shape (2, n_y, n_x)
            The state.

        Returns
        -------
        mu : ndarray, shape (P, 2, B)
            Expected intensities.
        """
        return render(x[0], x[1], self.raster, self.beams, self.tables, self.bins)

    def cost(self, x: FloatArray, mu: FloatArray) -> float:
        """Negative log-posterior, up to a constant.

        Parameters
        ----------
        x : ndarray, shape (2, n_y, n_x)
            The state.
        mu : ndarray, shape (P, 2, B)
            What `predict` gave for it.

        Returns
        -------
        cost : float
            To be made small.
        """
        robust = 0.5 * self.tail * np.log1p(_deviance(self.bins, mu) / self.tail)
        miss = self.altimeter.weights @ x[0].ravel() - self.altimeter.height
        off = x - self.expected
        believed = 0.5 * (off * self.prior.apply(off)).sum()
        return float(robust.sum() + 0.5 * (self.altimeter.precision * miss**2).sum() + believed)

    def gradient(self, x: FloatArray, mu: FloatArray) -> FloatArray:
        """Exact gradient of the cost for the samples seen at x.

        Parameters
        ----------
        x : ndarray, shape (2, n_y, n_x)
            The state.
        mu : ndarray, shape (P, 2, B)
            What `predict` gave for it.

        Returns
        -------
        gradient : ndarray, shape (2, n_y, n_x)
            Derivative of the cost by each unknown.
        """
        by_mu = self.data_weight(mu) * (1.0 - self.bins.intensity / mu) / mu
        gradient = np.stack(pull_back(x[0], x[1], self.raster, self.beams, self.tables, self.bins, by_mu))
        miss = self.altimeter.weights @ x[0].ravel() - self.altimeter.height
        gradient[0] += (self.altimeter.weights.T @ (self.altimeter.precision * miss)).reshape(self.raster.shape)
        return gradient + self.prior.apply(x - self.expected)

    def data_weight(self, mu: FloatArray) -> FloatArray:
        """Looks of each bin, less where the echo is far from what is expected.

        Parameters
        ----------
        mu : ndarray, shape (P, 2, B)
            Expected intensities.

        Returns
        -------
        weight : ndarray, shape (P, 2, B)
            Effective looks; the information on ln mu.
        """
        return self.bins.looks / (1.0 + _deviance(self.bins, mu) / self.tail)

    def curvature(self, x: FloatArray, mu: FloatArray) -> "NormalEquations":
        """Fisher information at x: always positive, also where the second derivative is not.

        Parameters
        ----------
        x : ndarray, shape (2, n_y, n_x)
            The state.
        mu : ndarray, shape (P, 2, B)
            What `predict` gave for it.

        Returns
        -------
        equations : NormalEquations
            To multiply and to precondition with.
        """
        rows = linearise(x[0], x[1], self.raster, self.beams, self.tables, self.bins, mu)
        return NormalEquations(self, rows, self.data_weight(mu))


@dataclass(frozen=True)
class NormalEquations:
    """The curvature of a posterior at one state, as products with cosine coefficients, in which the prior is diagonal.

    Parameters
    ----------
    posterior : Posterior
        Whose curvature.
    rows : Curvature
        Jacobian of ln mu.
    weight : ndarray, shape (P, 2, B)
        Information of each bin.
    """

    posterior: Posterior
    rows: Curvature
    weight: FloatArray

    def multiply(self, v: FloatArray) -> FloatArray:
        """Curvature times a vector.

        Parameters
        ----------
        v : ndarray, shape (2, n_y, n_x)
            Cosine coefficients of a direction.

        Returns
        -------
        product : ndarray, shape (2, n_y, n_x)
            Cosine coefficients of curvature times direction.
        """
        return to_cosine(self._multiply_data(from_cosine(v))) + self.posterior.prior.precision * v

    def precondition(self, v: FloatArray) -> FloatArray:
        """Roughly the inverse curvature times a vector.

        Parameters
        ----------
        v : ndarray, shape (2, n_y, n_x)
            Cosine coefficients of a gradient.

        Returns
        -------
        step : ndarray, shape (2, n_y, n_x)
            Cosine coefficients; exact where all cells are seen alike.
        """
        return v / self._diagonal

    def draw(self, rng: np.random.Generator) -> FloatArray:
        """A random vector whose covariance is the curvature.

        Parameters
        ----------
        rng : Generator
            Source of randomness.

        Returns
        -------
        draw : ndarray, shape (2, n_y, n_x)
            Cosine coefficients; solve the curvature for it to draw from the posterior.
        """
        raster, altimeter, prior = self.posterior.raster, self.posterior.altimeter, self.posterior.prior
        chunks = np.zeros((N_CHUNKS, 2, raster.n_cells))
        noise = rng.standard_normal(self.weight.shape) * np.sqrt(self.weight)
        rows = self.rows
        _pull(rows.cell, rows.by_height, rows.by_reflectivity, rows.n_cells, noise, chunks)
        data = chunks.sum(axis=0).reshape(2, *raster.shape)
        below = np.sqrt(altimeter.precision) * rng.standard_normal(len(altimeter.height))
        data[0] += (altimeter.weights.T @ below).reshape(raster.shape)
        return to_cosine(data) + np.sqrt(prior.precision) * rng.standard_normal(data.shape)

    def _multiply_data(self, v: FloatArray) -> FloatArray:
        """What bins and altimeter add to the curvature, times a direction of heights and log-reflectivities."""
        raster, altimeter, rows = self.posterior.raster, self.posterior.altimeter, self.rows
        chunks = np.zeros((N_CHUNKS, 2, raster.n_cells))
        _multiply(rows.cell, rows.by_height, rows.by_reflectivity, rows.n_cells, self.weight, v.reshape(2, -1), chunks)
        product = chunks.sum(axis=0).reshape(v.shape)
        below = altimeter.weights @ v[0].ravel()
        product[0] += (altimeter.weights.T @ (altimeter.precision * below)).reshape(raster.shape)
        return product

    @cached_property
    def _diagonal(self) -> FloatArray:
        """Precisions in the cosine basis: the prior's, and the data's as if every cell were seen alike."""
        raster, prior = self.posterior.raster, self.posterior.prior
        slope = _slope_information(self.rows.by_height, self.rows.n_cells, self.weight) / raster.n_cells
        k2_y, k2_x = wavenumbers(raster)
        across = (0.8 * k2_y + 0.2 * k2_x) * raster.spacing**2  # the frame's y runs across the track
        level = [self._constant_information(k) for k in range(2)]
        return np.stack([prior.height + 0.5 * slope * across + level[0], prior.reflectivity + level[1]])

    def _constant_information(self, unknown: int) -> float:
        """What the data say, a cell, about adding the same to all heights or to all log-reflectivities."""
        v = np.zeros((2, *self.posterior.raster.shape))
        v[unknown] = 1.0
        return float(self._multiply_data(v)[unknown].mean())


def _deviance(bins: Bins, mu: FloatArray) -> FloatArray:
    ratio = np.maximum(bins.intensity, 1e-12 * mu) / mu
    return np.asarray(2 * bins.looks * (ratio - 1 - np.log(ratio)))


@numba.njit(cache=True, parallel=True)
def _multiply(cell, by_height, by_reflectivity, n_cells, weight, v, chunks):  # type: ignore[no-untyped-def]
    n = cell.shape[0]
    for chunk in numba.prange(chunks.shape[0]):
        out = chunks[chunk]
        for ping in range(chunk * n // chunks.shape[0], (chunk + 1) * n // chunks.shape[0]):
            for side in range(2):
                for b in range(cell.shape[2]):
                    count = n_cells[ping, side, b]
                    if count == 0 or weight[ping, side, b] == 0.0:
                        continue
                    c, jz, jr = cell[ping, side, b], by_height[ping, side, b], by_reflectivity[ping, side, b]
                    change = 0.0
                    for k in range(count):
                        change += jz[k] * v[0, c[k]] + jr[k] * v[1, c[k]]
                    change *= weight[ping, side, b]
                    for k in range(count):
                        out[0, c[k]] += jz[k] * change
                        out[1, c[k]] += jr[k] * change


@numba.njit(cache=True, parallel=True)
def _pull(cell, by_height, by_reflectivity, n_cells, values, chunks):  # type: ignore[no-untyped-def]
    n = cell.shape[0]
    for chunk in numba.prange(chunks.shape[0]):
        out = chunks[chunk]
        for ping in range(chunk * n // chunks.shape[0], (chunk + 1) * n // chunks.shape[0]):
            for side in range(2):
                for b in range(cell.shape[2]):
                    c, value = cell[ping, side, b], values[ping, side, b]
                    for k in range(n_cells[ping, side, b]):
                        out[0, c[k]] += by_height[ping, side, b, k] * value
                        out[1, c[k]] += by_reflectivity[ping, side, b, k] * value


@numba.njit(cache=True)
def _slope_information(by_height, n_cells, weight):  # type: ignore[no-untyped-def]
    """Sum of squared derivatives by height, weighted."""
    total = 0.0
    for ping in range(weight.shape[0]):
        for side in range(2):
            for b in range(weight.shape[2]):
                for k in range(n_cells[ping, side, b]):
                    total += weight[ping, side, b] * by_height[ping, side, b, k] ** 2
    return total
