"""How well heights, reflectivity and a beam pattern explain a ground-range image; with the exact adjoint."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.reconstruction.ground_image import GroundImage
from frontend.reconstruction.unknowns import from_cosine, to_cosine

Part = Literal["reflectivity", "beam", "height"]


class DescentConfig(BaseModel):
    """What is believed, and how far to go."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    n_iterations: int = Field(default=40, ge=0, description="Iterations [1] at each resolution, at most.")
    tolerance: float = Field(
        default=1e-3, ge=0, description="Share [1] of the cost that an iteration must take off to go on."
    )
    largest_step: float = Field(
        default=0.2, gt=0, description="Height that an iteration may change, over the pixel's size [1]; no divergence."
    )
    deadline: float = Field(
        default=3600.0,
        gt=0,
        description="Time for a window [s], then the result as it stands; not repeatable.",
    )
    beam_step: float = Field(
        default=0.07, gt=0, description="Knots of the beam pattern's correction [rad]; four degrees hide speckle."
    )
    beam_sigma: float = Field(
        default=0.1, gt=0, description="Natural log by which a window's beam pattern may differ from the dive's [1]."
    )
    altimeter_sigma: float = Field(default=0.3, gt=0, description="Altitude against the first column's heights [m].")
    roughness: float = Field(
        default=0.1, gt=0, description="C of the relief spectrum C k^-4 [1]; 0.03 is 0.8 m rms below 100 m wavelength."
    )
    longest: float = Field(
        default=40.0,
        gt=0,
        description="Wavelength beyond which relief grows no more [m]; echoes tell little of longer.",
    )
    reflectivity: float = Field(
        default=0.1, gt=0, description="Standard deviation of log-reflectivity [1]; sediments differ little."
    )
    reflectivity_length: float = Field(
        default=8.0, gt=0, description="Correlation length of reflectivity [m]; sediments change slowly."
    )


@dataclass(frozen=True)
class Estimate:
    """What an image is explained by.

    Parameters
    ----------
    height : ndarray, shape (2, n_y, n_x)
        Heights of the floor in the submap frame [m].
    reflectivity : ndarray, shape (2, n_y, n_x)
        Natural logarithm of the reflectivity.
    beam : ndarray, shape (2, K)
        Natural logarithm of the beam pattern over the dive's, at knots over the angle from nadir.
    """

    height: FloatArray
    reflectivity: FloatArray
    beam: FloatArray


@dataclass(frozen=True)
class ImageCost:
    """How badly an estimate explains an image, and how unlikely it is by itself.

    Parameters
    ----------
    image : GroundImage
        What was seen.
    is_shadow : ndarray of bool, shape (2, n_y, n_x)
        Where darkness says nothing of reflectivity, which is taken from around.
    config : DescentConfig
        The prior.
    filled : ndarray, broadcasts to (2, n_y, n_x)
        Natural logarithm of the reflectivity that is assumed in shadow: that of a coarser image, from its surroundings.

    Notes
    -----
    The model is ``I = R Phi cos(theta)^n`` over that of a flat floor, ``cos(theta) = (D + x Z_x) / (B C)``, with D the
    depth below the sonar, x the ground range, ``B^2 = x^2 + D^2`` and ``C^2 = 1 + Z_x^2 + Z_y^2``; slopes are backward
    differences, that of the first column towards the height below the sonar. Pixels in shadow keep their place in the
    cost but have no say in the reflectivity, so that the floor there comes out tangent to the beam.
    """

    image: GroundImage
    is_shadow: BoolArray
    config: DescentConfig
    filled: FloatArray = field(default_factory=lambda: np.zeros(()))

    @cached_property
    def start(self) -> Estimate:
        """Flat across the track at the height below the sonar; even reflectivity; the dive's beam pattern."""
        shape = self.image.level.shape
        height = np.broadcast_to(self.image.nadir_height[:, None], shape).copy()
        n_knots = int(np.ceil(0.5 * np.pi / self.config.beam_step)) + 1
        return Estimate(height, np.zeros(shape), np.zeros((2, n_knots)))

    @cached_property
    def weight(self) -> FloatArray:
        """Shape (2, n_y, n_x): one over the relative variance of a pixel."""
        return self.image.weight

    @cached_property
    def precision(self) -> tuple[FloatArray, FloatArray]:
        """Shapes (n_y, n_x): the prior's diagonal precisions of heights and reflectivity in the cosine basis."""
        area, prior = self.image.spacing[0] * self.image.spacing[1], self.config
        k2 = self._wavenumbers[0] + self._wavenumbers[1]
        length2 = prior.reflectivity_length**2
        height = area * (k2 + (2 * np.pi / prior.longest) ** 2) ** 2 / prior.roughness
        return height, area * (1 + k2 * length2) ** 2 / (prior.reflectivity**2 * 4 * np.pi * length2)

    @cached_property
    def _wavenumbers(self) -> tuple[FloatArray, FloatArray]:
        sizes = zip(self.image.level.shape[1:], self.image.spacing, strict=True)
        k2 = [(2 - 2 * np.cos(np.pi * np.arange(n) / n)) / step**2 for n, step in sizes]
        return k2[0][:, None], k2[1][None, :]

    @cached_property
    def _pull(self) -> float:
        """The part of the heights' precision that pulls towards the start, not towards smoothness."""
        return float(self.precision[0][0, 0])

    @cached_property
    def _flat_cosine(self) -> FloatArray:
        depth = (self.image.sensor_height - self.image.nadir_height)[:, None]
        return np.asarray(depth / np.hypot(self.image.ground_range, depth))

    @cached_property
    def knots(self) -> tuple[IntArray, FloatArray]:
        """Shapes (n_y, n_x): the knot of the beam pattern inside each pixel's angle, and the share of the next one."""
        place = np.arccos(self._flat_cosine) / self.config.beam_step
        knot = np.minimum(place.astype(np.int64), self.start.beam.shape[1] - 2)
        return knot, place - knot

    def cosine(self, height: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Cosine of incidence and its derivatives by height, across-track and along-track slope.

        Parameters
        ----------
        height : ndarray, shape (2, n_y, n_x)
            Heights [m].

        Returns
        -------
        cosine, by_height, by_across, by_along : ndarray, shape (2, n_y, n_x)
            All zero where a facet looks away from the sonar.
        """
        x, depth = self.image.ground_range, self.image.sensor_height[:, None] - height
        across, along = self.slopes(height)
        b2, c2 = x**2 + depth**2, 1 + across**2 + along**2
        scale = 1 / np.sqrt(b2 * c2)
        cosine = (depth + x * across) * scale
        lit = cosine > 0
        parts = (cosine, -scale + cosine * depth / b2, x * scale - cosine * across / c2, -cosine * along / c2)
        return tuple(np.where(lit, part, 0.0) for part in parts)  # type: ignore[return-value]

    def slopes(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Backward differences across and along the track.

        Parameters
        ----------
        height : ndarray, shape (2, n_y, n_x)
            Heights [m].

        Returns
        -------
        across, along : ndarray, shape (2, n_y, n_x)
            Slopes [1]; the first row has none along the track.
        """
        dy, dx = self.image.spacing
        across, along = np.empty_like(height), np.zeros_like(height)
        across[:, :, 1:] = np.diff(height, axis=2) / dx
        across[:, :, 0] = (height[:, :, 0] - self.image.nadir_height) / (0.5 * dx)
        along[:, 1:] = np.diff(height, axis=1) / dy
        return across, along

    def predict(self, estimate: Estimate) -> FloatArray:
        """The image that an estimate would give.

        Parameters
        ----------
        estimate : Estimate
            Heights, reflectivity, beam pattern.

        Returns
        -------
        level : ndarray, shape (2, n_y, n_x)
            Echo over that of a flat floor [1].
        """
        cosine = self.cosine(estimate.height)[0] / self._flat_cosine
        return np.asarray(self._brightness(estimate) * cosine**self.image.exponent)

    def __call__(self, estimate: Estimate) -> float:
        """The cost: squared errors of the image over their variance, and the priors."""
        error = self.image.level - self.predict(estimate)
        height, reflectivity = (to_cosine(part) for part in (estimate.height, estimate.reflectivity))
        away, nadir = estimate.height - self.start.height, estimate.height[:, :, 0] - self.image.nadir_height
        cost = np.sum(self.weight * error**2)
        cost += np.sum((self.precision[0] - self._pull) * height**2) + self._pull * np.sum(away**2)
        cost += np.sum(self.precision[1] * reflectivity**2)
        cost += np.sum((estimate.beam / self.config.beam_sigma) ** 2)
        return float(0.5 * (cost + np.sum((nadir / self._nadir_sigma) ** 2)))

    def gradient(self, estimate: Estimate) -> Estimate:
        """Derivatives of the cost by everything, neighbour terms of the differences included.

        Parameters
        ----------
        estimate : Estimate
            Where.

        Returns
        -------
        gradient : Estimate
            One derivative for each number of the estimate.
        """
        brightness, n = self._brightness(estimate), self.image.exponent
        cosine, by_height, by_across, by_along = self.cosine(estimate.height)
        relative = cosine / self._flat_cosine
        level = brightness * relative**n
        misfit = self.weight * (level - self.image.level)
        slope = misfit * brightness * n * relative ** (n - 1) / self._flat_cosine
        height = slope * by_height + self._pull_back(slope * by_across, slope * by_along)
        height += from_cosine((self.precision[0] - self._pull) * to_cosine(estimate.height))
        height += self._pull * (estimate.height - self.start.height)
        height[:, :, 0] += (estimate.height[:, :, 0] - self.image.nadir_height) / self._nadir_sigma**2
        reflectivity = np.where(self.is_shadow, 0.0, misfit * level)
        reflectivity += from_cosine(self.precision[1] * to_cosine(estimate.reflectivity))
        beam = self._at_knots(misfit * level) + estimate.beam / self.config.beam_sigma**2
        return Estimate(height, reflectivity, beam)

    def direction(self, estimate: Estimate, part: Part) -> FloatArray:
        """The way down for one part of an estimate, the others held.

        Parameters
        ----------
        estimate : Estimate
            Where.
        part : str
            Which part: reflectivity, beam or height.

        Returns
        -------
        direction : ndarray, shape of the part
            Minus the gradient over the mean curvature at each wavenumber.
        """
        gradient, level = getattr(self.gradient(estimate), part), self.predict(estimate)
        bright = self.weight * level**2
        if part == "beam":
            return np.asarray(-gradient / (self._at_knots(bright) + self.config.beam_sigma**-2))
        if part == "reflectivity":
            return -from_cosine(to_cosine(gradient) / (self.precision[1] + bright.mean()))
        cosine, _, by_across, _ = self.cosine(estimate.height)
        known = np.maximum(cosine, 0.05 * self._flat_cosine)
        steep = np.mean(bright * (self.image.exponent * by_across / known) ** 2)
        return -from_cosine(to_cosine(gradient) / (self.precision[0] + steep * self._wavenumbers[1]))

    @cached_property
    def _nadir_sigma(self) -> float:
        """Of a row: the altimeter's errors repeat over a few metres."""
        return float(self.config.altimeter_sigma * np.sqrt(max(4.0 / self.image.spacing[0], 1.0)))

    def _brightness(self, estimate: Estimate) -> FloatArray:
        knot, share = self.knots
        beam = (1 - share) * estimate.beam[:, knot] + share * estimate.beam[:, knot + 1]
        return np.asarray(np.exp(np.where(self.is_shadow, self.filled, estimate.reflectivity) + beam))

    def _at_knots(self, values: FloatArray) -> FloatArray:
        """Shape (2, K): the adjoint of interpolation between knots."""
        knot, share = (part.ravel() for part in self.knots)
        n = self.start.beam.shape[1]
        flat = values.reshape(2, -1)
        sums = [np.bincount(knot, s * (1 - share), n) + np.bincount(knot + 1, s * share, n) for s in flat]
        return np.stack(sums)

    def _pull_back(self, across: FloatArray, along: FloatArray) -> FloatArray:
        """The adjoint of `slopes`."""
        dy, dx = self.image.spacing
        result = across / dx
        result[:, :, :-1] -= across[:, :, 1:] / dx
        result[:, :, 0] += across[:, :, 0] / dx  # half a pixel from nadir
        result[:, 1:] += along[:, 1:] / dy
        result[:, :-1] -= along[:, 1:] / dy
        return result
