"""Where the vehicle is sent: surveys along curves, and along a track from a file."""

import csv
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator
from scipy.ndimage import gaussian_filter1d
from typing_extensions import override

from frontend.arrays import FloatArray
from sssslam.simulation.survey import STEP, Lawnmower, Legs, Pattern, Polyline, Star, without_repeats


class Spiral(Pattern):
    """An Archimedean spiral outward from a first circle."""

    pattern: Literal["spiral"] = "spiral"
    centre: tuple[float, float] = Field(default=(0.0, 0.0), description="Middle of the spiral [m].")
    radius: float = Field(
        default=30.0, gt=0, description="Radius of the first turn [m]; at least the vehicle's turn radius."
    )
    spacing: float = Field(default=30.0, gt=0, description="Distance between turns [m].")
    n_turns: float = Field(default=3.0, gt=0, description="Number of turns.")

    @override
    def path(self, turn_radius: float) -> FloatArray:
        """The spiral, counter-clockwise."""
        _check_radius(self.radius, turn_radius, "spiral")
        farthest = self.radius + self.spacing * self.n_turns
        angle = np.linspace(0.0, 2 * np.pi * self.n_turns, int(2 * np.pi * self.n_turns * farthest / STEP) + 2)
        radius = self.radius + self.spacing * angle / (2 * np.pi)
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1) + np.asarray(self.centre)


class FigureOfEight(Pattern):
    """Two circles that touch, flown again and again through the point where they do."""

    pattern: Literal["figure-of-eight"] = "figure-of-eight"
    centre: tuple[float, float] = Field(default=(0.0, 0.0), description="Where the lobes meet [m].")
    radius: float = Field(default=40.0, gt=0, description="Radius of a lobe [m]; at least the vehicle's turn radius.")
    n_rounds: int = Field(default=2, ge=1, description="How often the figure is flown.")

    @override
    def path(self, turn_radius: float) -> FloatArray:
        """One lobe counter-clockwise, the other clockwise."""
        _check_radius(self.radius, turn_radius, "figure of eight")
        angle = np.linspace(0.0, 2 * np.pi, int(2 * np.pi * self.radius / STEP) + 2)
        left = np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)
        once = np.concatenate([left, left * np.array([1.0, -1.0])])
        return without_repeats(self.radius * np.tile(once, (self.n_rounds, 1)) + np.asarray(self.centre))


class TrackFile(Pattern):
    """The track of a real vehicle, its middle laid on the world's origin."""

    pattern: Literal["track"] = "track"
    file: Path = Field(description="CSV with columns x or x_m and y or y_m [m]; relative to the scene's file.")
    scale: float = Field(default=1.0, gt=0, description="Stretch of the track.")
    smoothing: float = Field(
        default=5.0, gt=0, description="Corners shorter than this are rounded [m]; positions are sparse."
    )

    @field_validator("file")
    @classmethod
    def _beside_the_scene(cls, file: Path, info: ValidationInfo) -> Path:
        return Path((info.context or {}).get("folder", ".")) / file

    @override
    def path(self, turn_radius: float) -> FloatArray:
        """The track, resampled evenly and smoothed; a hovering vehicle may turn on the spot."""
        points = without_repeats(self.scale * read_track(self.file))
        points = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        even = np.linspace(0.0, along[-1], max(2, int(along[-1] / STEP) + 1))
        sampled = [np.interp(even, along, axis) for axis in points.T]
        smooth = [gaussian_filter1d(axis, self.smoothing / STEP, mode="nearest") for axis in sampled]
        return without_repeats(np.stack(smooth, axis=-1))


Survey = Annotated[
    Legs | Lawnmower | Star | Polyline | Spiral | FigureOfEight | TrackFile, Field(discriminator="pattern")
]


def read_track(path: Path) -> FloatArray:
    """Read the horizontal positions of a track.

    Parameters
    ----------
    path : Path
        CSV with a header that names x (or x_m) and y (or y_m).

    Returns
    -------
    points : ndarray, shape (K, 2)
        East and north [m].
    """
    if not path.is_file():
        raise ValueError(f"track file {path} given, there is no such file")
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: not a CSV text file") from error
    columns = [next((name for name in (axis, f"{axis}_m") if rows and name in rows[0]), "") for axis in "xy"]
    if not all(columns) or len(rows) < 2:
        raise ValueError(f"{path}: a header with x and y (or x_m and y_m) and two rows at least wanted")
    return np.array([[_number(row[name], path, k) for name in columns] for k, row in enumerate(rows)])


def _number(text: str | None, path: Path, row: int) -> float:
    try:
        number = float(text or "")
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        raise ValueError(f"{path}: row {row + 2}: a number wanted, got {text!r}")
    return number


def _check_radius(radius: float, turn_radius: float, name: str) -> None:
    if radius < turn_radius:
        raise ValueError(f"{name} of radius {radius} m given, the vehicle turns no tighter than {turn_radius:.1f} m")
