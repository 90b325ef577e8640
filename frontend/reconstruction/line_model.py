"""What the lines of a window should have shown: beam pattern, reflectivity and Lambert's law, with the exact adjoint.

Unknown are the relief and the log-reflectivity of N cells and the log beam pattern at K knots over angle and track, in
one vector. Slopes are linear in the relief: across on the line itself, along from the planes through other lines.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from frontend.arrays import FloatArray
from frontend.reconstruction.line_image import NORMAL_INCIDENCE, LineImage
from frontend.reconstruction.line_operators import fill_shadow, slope_on_line
from frontend.reconstruction.lines import LineFrames
from frontend.reconstruction.neighbours import Neighbours

_SOFTNESS = 0.02  # cosine of incidence over which a patch goes from lit to turned away


@dataclass(frozen=True)
class LineModel:
    """The forward model of one registration; all that depends on neighbours and places is frozen in it.

    Parameters
    ----------
    horizontal, vertical : ndarray, shape (N,)
        Of each cell from its transducer, positive to port and down to the flat floor [m].
    scale : ndarray, shape (N,)
        What the modelled amplitude is divided by, as the measured one was.
    across : csr_array, shape (N, N)
        Relief to slope across the track, to port.
    neighbours : Neighbours
        Relief to slope along the track.
    fill : csr_array, shape (N, N)
        Log-reflectivity to itself, in shadow to that of the nearest lit cells on the line.
    beam : csr_array, shape (N, K)
        Knots of the log beam pattern to cells.
    exponent : float
        Of the cosine of incidence, for amplitudes.
    """

    horizontal: FloatArray
    vertical: FloatArray
    scale: FloatArray
    across: csr_array
    neighbours: Neighbours
    fill: csr_array
    beam: csr_array
    exponent: float

    @property
    def n_cells(self) -> int:
        """Number of cells N."""
        return int(self.horizontal.size)

    @property
    def size(self) -> int:
        """Length of the vector of unknowns, 2 N + K."""
        return 2 * self.n_cells + int(self.beam.shape[1])

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Take the unknowns apart.

        Parameters
        ----------
        x : ndarray, shape (2 N + K,)
            Unknowns.

        Returns
        -------
        relief, log_reflectivity, log_beam : ndarray, shapes (N,), (N,), (K,)
            Relief [m], logarithms of amplitude factors.
        """
        n = self.n_cells
        return x[:n], x[n : 2 * n], x[2 * n :]

    def linearise(self, x: FloatArray) -> "LinearModel":
        """Amplitudes and their derivatives.

        Parameters
        ----------
        x : ndarray, shape (2 N + K,)
            Unknowns.

        Returns
        -------
        linear : LinearModel
            The model about x.

        Notes
        -----
        ``exp(reflectivity + beam) * cos(incidence)**n / sqrt(s)`` over the scale, with ``cos(incidence) = (p u + v - w)
        / (sqrt(u**2 + (v - w)**2) sqrt(1 + p**2 + q**2))`` for relief w, slopes p across and q along, and u, v the
        horizontal and vertical distance. A cosine below zero fades to zero within 0.02, with a derivative. ``1 / s`` is
        the ground that a sample covers, s the sine of incidence in the beam plane: the energy of a sample grows with
        it, the amplitude with its root.
        """
        relief, log_reflectivity, log_beam = self.split(x)
        p = self.across @ relief
        q = self.neighbours.along @ relief + self.neighbours.along_0
        cosine, of_cosine = _cosine(self.horizontal, self.vertical - relief, p, q)
        sine, of_sine = _sine(self.horizontal, self.vertical - relief, p)
        soft, ground = np.hypot(cosine, _SOFTNESS), np.hypot(sine, NORMAL_INCIDENCE)
        gain = np.exp(self.fill @ log_reflectivity + self.beam @ log_beam)
        amplitude = gain * (0.5 * (cosine + soft)) ** self.exponent / np.sqrt(ground) / self.scale
        by_cosine, by_sine = self.exponent * amplitude / soft, -0.5 * amplitude * sine / ground**2
        return LinearModel(
            self,
            amplitude,
            by_cosine * of_cosine[0] + by_sine * of_sine[0],
            by_cosine * of_cosine[1] + by_sine * of_sine[1],
            by_cosine * of_cosine[2],
        )


class LinearModel(NamedTuple):
    """A line model about one state: amplitudes (N,) and their derivatives by relief, slope across and slope along."""

    model: LineModel
    amplitude: FloatArray
    by_relief: FloatArray
    by_across: FloatArray
    by_along: FloatArray

    def push(self, x: FloatArray) -> FloatArray:
        """Change of the amplitudes that goes with a change of the unknowns.

        Parameters
        ----------
        x : ndarray, shape (2 N + K,)
            Change of the unknowns.

        Returns
        -------
        change : ndarray, shape (N,)
            Change of the amplitudes, to first order.
        """
        model = self.model
        relief, log_reflectivity, log_beam = model.split(x)
        shape = self.by_relief * relief + self.by_across * (model.across @ relief)
        shape = shape + self.by_along * (model.neighbours.along @ relief)
        return np.asarray(shape + self.amplitude * (model.fill @ log_reflectivity + model.beam @ log_beam))

    def pull(self, weight: FloatArray) -> FloatArray:
        """Adjoint of `push`.

        Parameters
        ----------
        weight : ndarray, shape (N,)
            Derivative of some cost by the amplitudes.

        Returns
        -------
        gradient : ndarray, shape (2 N + K,)
            Derivative of that cost by the unknowns; exact for frozen neighbours.
        """
        model = self.model
        relief = self.by_relief * weight + model.across.T @ (self.by_across * weight)
        relief = relief + model.neighbours.along.T @ (self.by_along * weight)
        bright = self.amplitude * weight
        return np.concatenate([relief, model.fill.T @ bright, model.beam.T @ bright])


def make_model(
    frames: LineFrames, image: LineImage, neighbours: Neighbours, beam: csr_array, exponent: float
) -> LineModel:
    """Collect the forward model of one registration.

    Parameters
    ----------
    frames : LineFrames
        The lines.
    image : LineImage
        What they saw; its shadow and scale are used.
    neighbours : Neighbours
        Planes through other lines.
    beam : csr_array, shape (N, K)
        Knots of the log beam pattern to cells.
    exponent : float
        Of the cosine of incidence, for intensities.

    Returns
    -------
    model : LineModel
        The model.
    """
    return LineModel(
        frames.horizontal.ravel(),
        frames.vertical.ravel(),
        image.scale.ravel(),
        slope_on_line(*frames.shape, frames.spacing),
        neighbours,
        fill_shadow((image.weight > 0) & ~image.is_shadow),
        beam,
        0.5 * exponent,
    )


def _cosine(
    u: FloatArray, down: FloatArray, p: FloatArray, q: FloatArray
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
    """Cosine of incidence, and its derivatives by relief and by the slopes across and along."""
    far, steep = u**2 + down**2, 1 + p**2 + q**2
    length = np.sqrt(far * steep)
    cosine = (p * u + down) / length
    return cosine, (cosine * down / far - 1 / length, u / length - cosine * p / steep, -cosine * q / steep)


def _sine(u: FloatArray, down: FloatArray, p: FloatArray) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
    """Sine of incidence in the beam plane, below zero for layover, and its derivatives by relief and slope across."""
    outwards, far, steep = np.sign(u), u**2 + down**2, 1 + p**2
    length = np.sqrt(far * steep)
    sine = outwards * (u - down * p) / length
    return sine, (outwards * p / length + sine * down / far, -outwards * down / length - sine * p / steep)
