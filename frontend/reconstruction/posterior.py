"""The cost that a window's unknowns are judged by, its exact gradient, and where its curvature comes from."""

from dataclasses import dataclass, replace

import numpy as np

from frontend.arrays import FloatArray
from frontend.radiometry import Tables
from frontend.reconstruction.forward import Beams, Bins, Raster, linearise, pull_back, render
from frontend.reconstruction.measured_heights import MeasuredHeights
from frontend.reconstruction.normal_equations import NormalEquations
from frontend.reconstruction.priors import Prior
from frontend.reconstruction.unknowns import Unknowns, nothing


@dataclass(frozen=True)
class Posterior:
    """Gamma likelihood of multilooked bins with a robust tail, measured heights and prior, at one resolution.

    Parameters
    ----------
    raster, beams, tables, bins
        The forward model's arguments.
    prior : Prior
        Belief about the unknowns.
    expected : ndarray, shape (n_y, n_x)
        Surface that the background is added to: smooth, through the altimeter's heights [m].
    measured : MeasuredHeights
        Heights below the track, and those that shadows tell.
    tail : float
        Deviance at which a bin counts half; larger outliers count less.
    held_out : ndarray, shape (P, 2, B)
        Looks of the bins that are kept aside; they say when to stop.
    standing : ndarray, shape (n_y, n_x)
        Heights that objects are likely to have [m]: how freely a step may change them, not what is believed of them.
    """

    raster: Raster
    beams: Beams
    tables: Tables
    bins: Bins
    prior: Prior
    expected: FloatArray
    measured: MeasuredHeights
    tail: float
    held_out: FloatArray
    standing: FloatArray

    def origin(self) -> Unknowns:
        """Where the prior is highest.

        Returns
        -------
        x : Unknowns
            All zero.
        """
        return nothing(self.raster.shape, self.tables.log_beam.shape[1], len(self.beams.sensor))

    def height(self, x: Unknowns) -> FloatArray:
        """The seafloor.

        Parameters
        ----------
        x : Unknowns
            As rasters.

        Returns
        -------
        z : ndarray, shape (n_y, n_x)
            Heights in the submap frame [m].
        """
        return self.expected + x.background + x.objects

    def predict(self, x: Unknowns) -> FloatArray:
        """Expected intensity of every bin.

        Parameters
        ----------
        x : Unknowns
            As rasters.

        Returns
        -------
        mu : ndarray, shape (P, 2, B)
            Expected intensities.
        """
        echo = render(self.height(x), x.log_reflectivity, self.raster, self.beams, self._tables(x), self.bins)
        return self.bins.floor + np.exp(x.gain)[:, :, None] * (echo - self.bins.floor)

    def cost(self, x: Unknowns, mu: FloatArray) -> float:
        """Negative log-posterior, up to a constant.

        Parameters
        ----------
        x : Unknowns
            As rasters.
        mu : ndarray, shape (P, 2, B)
            What `predict` gave for it.

        Returns
        -------
        cost : float
            To be made small.
        """
        miss = self.measured.miss(self.height(x))
        echoes = self._robust(self.bins.looks, mu).sum()
        return float(echoes + 0.5 * (self.measured.precision * miss**2).sum() + self.prior.cost(x))

    def held_out_costs(self, mu: FloatArray) -> FloatArray:
        """What the lines that are kept aside say.

        Parameters
        ----------
        mu : ndarray, shape (P, 2, B)
            Expected intensities.

        Returns
        -------
        costs : ndarray, shape (P, 2)
            The share of the cost that each line and side would have, had it been looked at; zero for all others.
        """
        return self._robust(self.held_out, mu).sum(axis=2)

    def gradient(self, x: Unknowns, mu: FloatArray) -> Unknowns:
        """Exact gradient of the cost for the samples seen at x.

        Parameters
        ----------
        x : Unknowns
            As rasters.
        mu : ndarray, shape (P, 2, B)
            What `predict` gave for it.

        Returns
        -------
        gradient : Unknowns
            Derivative of the cost by each unknown, as rasters.
        """
        by_mu = self.data_weight(mu) * (1.0 - self.bins.intensity / mu) / mu
        weight = np.exp(x.gain)[:, :, None] * by_mu
        z = self.height(x)
        by_height, by_reflectivity, by_beam = pull_back(
            z, x.log_reflectivity, self.raster, self.beams, self._tables(x), self.bins, weight
        )
        by_height += (self.measured.weights.T @ (self.measured.precision * self.measured.miss(z))).reshape(z.shape)
        by_gain = (by_mu * (mu - self.bins.floor)).sum(axis=2)
        echoes = Unknowns(by_height, by_height, by_reflectivity, by_beam, by_gain)
        return echoes.plus(self.prior.gradient(x))

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
        return self.bins.looks / (1.0 + _deviance(self.bins.intensity, self.bins.looks, mu) / self.tail)

    def curvature(self, x: Unknowns, mu: FloatArray) -> NormalEquations:
        """Fisher information at x: always positive, also where the second derivative is not.

        Parameters
        ----------
        x : Unknowns
            As rasters.
        mu : ndarray, shape (P, 2, B)
            What `predict` gave for it.

        Returns
        -------
        equations : NormalEquations
            To multiply and to precondition with.
        """
        quiet = mu * np.exp(-x.gain)[:, :, None]  # rows are energies over mu, gains included
        rows = linearise(self.height(x), x.log_reflectivity, self.raster, self.beams, self._tables(x), self.bins, quiet)
        below = (self.measured.weights, self.measured.precision)
        precision = self.prior.object_precision(np.maximum(np.abs(x.objects), self.standing))
        return NormalEquations(self.raster, self.prior, rows, self.data_weight(mu), below, precision)

    def _tables(self, x: Unknowns) -> Tables:
        return replace(self.tables, log_beam=self.tables.log_beam + x.beam)

    def _robust(self, looks: FloatArray, mu: FloatArray) -> FloatArray:
        return np.asarray(0.5 * self.tail * np.log1p(_deviance(self.bins.intensity, looks, mu) / self.tail))


def _deviance(intensity: FloatArray, looks: FloatArray, mu: FloatArray) -> FloatArray:
    ratio = np.maximum(intensity, 1e-12 * mu) / mu
    return np.asarray(2 * looks * (ratio - 1 - np.log(ratio)))
