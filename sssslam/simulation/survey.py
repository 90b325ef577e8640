"""Where the vehicle is sent: surveys of straight legs, joined by turns of bounded curvature."""

from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator
from typing_extensions import override

from frontend.arrays import FloatArray
from sssslam.simulation.dubins import dubins_path

STEP = 0.25  # metres between the points of a path
Leg = tuple[float, float, float, float]


class Pattern(BaseModel):
    """A survey pattern."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def path(self, turn_radius: float) -> FloatArray:
        """Points along the survey.

        Parameters
        ----------
        turn_radius : float
            Smallest radius of a turn [m].

        Returns
        -------
        path : ndarray, shape (K, 2)
            The horizontal path over the ground [m].
        """
        raise NotImplementedError


class Legs(Pattern):
    """Straight legs, flown one after the other."""

    pattern: Literal["legs"] = "legs"
    legs: tuple[Leg, ...] = Field(
        default=((-60.0, 0.0, 60.0, 0.0),), min_length=1, description="x, y of start and of end [m]."
    )

    @override
    def path(self, turn_radius: float) -> FloatArray:
        """The legs and the turns between them."""
        return join_legs(np.array(self.legs), turn_radius)


class Lawnmower(Pattern):
    """Parallel legs in alternating direction, then tie lines across them."""

    pattern: Literal["lawnmower"] = "lawnmower"
    centre: tuple[float, float] = Field(default=(0.0, 0.0), description="Middle of the surveyed area [m].")
    heading_deg: float = Field(default=90.0, description="Heading of the first leg, clockwise from north [deg].")
    length: float = Field(default=220.0, gt=0, description="Length of a leg [m].")
    spacing: float = Field(
        default=40.0, gt=0, description="Distance between legs [m]; below the slant range: swaths overlap."
    )
    n_legs: int = Field(default=4, ge=1, description="Number of parallel legs.")
    n_ties: int = Field(default=2, ge=0, description="Number of legs across the others.")

    @override
    def path(self, turn_radius: float) -> FloatArray:
        """The legs, the ties, and the turns between them."""
        width = self.spacing * (self.n_legs - 1)
        legs = _parallel(self.n_legs, self.length, self.spacing)
        ties = _parallel(self.n_ties, width + 2 * self.spacing, self.length / (self.n_ties + 1))
        legs = _turned(np.concatenate([legs, _turned(ties, -0.5 * np.pi)]), 0.5 * np.pi - np.radians(self.heading_deg))
        return join_legs(legs + np.tile(self.centre, 2), turn_radius)


class Star(Pattern):
    """Straight legs through one place, each from another direction."""

    pattern: Literal["star"] = "star"
    centre: tuple[float, float] = Field(default=(0.0, 0.0), description="Where the legs cross [m].")
    length: float = Field(default=200.0, gt=0, description="Length of a leg [m].")
    n_legs: int = Field(default=4, ge=2, description="Number of legs; headings 180/n degrees apart.")

    @override
    def path(self, turn_radius: float) -> FloatArray:
        """The legs and the turns between them; every second leg is flown backwards, which keeps the turns short."""
        yaw = np.pi * np.arange(self.n_legs) / self.n_legs + np.pi * (np.arange(self.n_legs) % 2)
        half = 0.5 * self.length * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
        return join_legs(np.concatenate([-half, half], axis=-1) + np.tile(self.centre, 2), turn_radius)


class Polyline(Pattern):
    """A way through given points, corners cut by turns."""

    pattern: Literal["polyline"] = "polyline"
    points: tuple[tuple[float, float], ...] = Field(min_length=2, description="x, y of the points [m].")

    @field_validator("points")
    @classmethod
    def _apart(cls, points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        nearest = float(np.hypot(*np.diff(np.array(points), axis=0).T).min())
        if nearest < STEP:
            raise ValueError(f"points at least {STEP} m apart wanted, got two {nearest:.3g} m apart")
        return points

    @override
    def path(self, turn_radius: float) -> FloatArray:
        """Straight stretches and turns that leave and rejoin them as early as the radius allows."""
        points = np.array(self.points)
        yaw = np.arctan2(*np.diff(points, axis=0).T[::-1])
        cut = turn_radius * np.abs(np.tan(0.5 * np.clip(np.diff(yaw, prepend=yaw[0], append=yaw[-1]), -3.0, 3.0)))
        return join_legs(_shortened(points, cut), turn_radius)


def join_legs(legs: FloatArray, turn_radius: float) -> FloatArray:
    """Join straight legs by the shortest turns of a given radius.

    Parameters
    ----------
    legs : ndarray, shape (K, 4)
        x, y of the start and of the end of each leg [m].
    turn_radius : float
        Radius of the turns [m].

    Returns
    -------
    path : ndarray, shape (P, 2)
        Points along legs and turns, no two alike [m].
    """
    yaw = np.arctan2(legs[:, 3] - legs[:, 1], legs[:, 2] - legs[:, 0])
    pieces = [_line(legs[0])]
    for k in range(1, len(legs)):
        start, end = (legs[k - 1, 2], legs[k - 1, 3], yaw[k - 1]), (legs[k, 0], legs[k, 1], yaw[k])
        pieces += [dubins_path(start, end, turn_radius, STEP), _line(legs[k])]
    return without_repeats(np.concatenate(pieces))


def without_repeats(path: FloatArray) -> FloatArray:
    """Drop points that repeat the one before.

    Parameters
    ----------
    path : ndarray, shape (P, 2)
        Points [m].

    Returns
    -------
    path : ndarray, shape (Q, 2)
        Points, each at least a micrometre from the last [m].
    """
    moved = np.hypot(*np.diff(path, axis=0).T) > 1e-6
    return np.asarray(path[np.concatenate([[True], moved])])


def _line(leg: FloatArray) -> FloatArray:
    n = max(2, int(np.ceil(np.hypot(leg[2] - leg[0], leg[3] - leg[1]) / STEP)) + 1)
    return np.linspace(leg[:2], leg[2:], n)


def _parallel(n: int, length: float, spacing: float) -> FloatArray:
    across = spacing * (np.arange(n) - 0.5 * (n - 1))
    along = np.where(np.arange(n) % 2 == 0, 0.5, -0.5) * length
    return np.stack([-along, across, along, across], axis=-1)


def _turned(legs: FloatArray, angle: float) -> FloatArray:
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.concatenate([legs[:, :2] @ rotation.T, legs[:, 2:] @ rotation.T], axis=-1)


def _shortened(points: FloatArray, cut: FloatArray) -> FloatArray:
    """Stretches between points, their ends drawn in by the cuts, but never by more than half."""
    step = np.diff(points, axis=0)
    length = np.hypot(*step.T)
    from_start, from_end = (np.minimum(c / length, 0.49)[:, None] for c in (cut[:-1], cut[1:]))
    return np.concatenate([points[:-1] + from_start * step, points[1:] - from_end * step], axis=-1)
