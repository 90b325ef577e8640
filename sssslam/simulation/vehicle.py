"""The true motion of the vehicle: along a path at some height, swayed by waves."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from frontend.arrays import FloatArray
from frontend.frames import rotation_world_body
from frontend.heightfield import Heightfield
from frontend.trajectory import Trajectory
from sssslam.simulation.waves import Waves, WavesConfig, make_waves

_KNOT = 0.25  # seconds between the knots of the motion's splines


class VehicleConfig(BaseModel):
    """How the vehicle follows its path."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    speed: float = Field(default=2.0, gt=0, description="Mean speed over ground [m/s].")
    speed_variation: float = Field(
        default=0.0, ge=0, le=0.5, description="Standard deviation of the speed over its mean."
    )
    turn_rate_deg: float = Field(default=4.5, gt=0, description="Yaw rate in turns [deg/s]; AUVs reach about 5.")
    keeping: Literal["altitude", "depth"] = Field(
        default="altitude", description="Height kept over the floor, or below the surface."
    )
    altitude: float = Field(default=12.0, gt=0, description="Height over the floor kept when keeping altitude [m].")
    depth: float = Field(default=38.0, ge=0, description="Depth kept when keeping depth [m].")
    follow_length: float = Field(
        default=12.0, gt=0, description="Terrain shorter than this is not followed [m]; inertia."
    )
    trim_deg: float = Field(default=0.0, description="Constant pitch, nose down [deg].")
    bank: float = Field(default=0.3, ge=0, description="Roll into a turn over yaw rate [s].")
    current: tuple[float, float] = Field(
        default=(0.0, 0.0), description="East and north velocity of the water [m/s]: crabbing."
    )
    waves: WavesConfig = WavesConfig()

    @property
    def turn_radius(self) -> float:
        """Radius of a turn [m]."""
        return float(self.speed / np.radians(self.turn_rate_deg))


@dataclass(frozen=True)
class Motion:
    """The true motion as a function of time [s] since the start."""

    position: CubicSpline
    waves: Waves
    config: VehicleConfig
    duration: float

    def trajectory(self, time: FloatArray) -> Trajectory:
        """True body poses.

        Parameters
        ----------
        time : ndarray, shape (N,)
            Seconds since the start, within the duration.

        Returns
        -------
        trajectory : Trajectory
            The poses; their times are the ones given.
        """
        x, y, z = self.position(time).T
        velocity, acceleration = self.position(time, 1), self.position(time, 2)
        roll, pitch, yaw, heave = self.waves.at(time).T
        course, climb, turn_rate = _course(velocity, acceleration)
        return Trajectory(
            np.array(time, dtype=np.float64),
            x,
            y,
            z + heave,
            roll - self.config.bank * turn_rate,
            pitch - climb + np.radians(self.config.trim_deg),
            yaw + course + crab_angle(velocity, self.config.current),
        )

    def velocity(self, time: FloatArray) -> FloatArray:
        """True velocity in the world frame [m/s], shape (N, 3)."""
        half = 0.5e-3
        heave = self.waves.at(time + half)[:, 3] - self.waves.at(time - half)[:, 3]
        return np.asarray(self.position(time, 1) + np.stack([0 * heave, 0 * heave, heave / (2 * half)], axis=-1))

    def angular_rate(self, time: FloatArray) -> FloatArray:
        """True angular rate in the world frame [rad/s], shape (N, 3)."""
        half = 0.5e-3
        before, after = (self._rotation(time + shift) for shift in (-half, half))
        skew = (after - before) @ np.swapaxes(0.5 * (after + before), -1, -2) / (2 * half)
        return np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)

    def _rotation(self, time: FloatArray) -> FloatArray:
        trajectory = self.trajectory(time)
        return rotation_world_body(trajectory.roll, trajectory.pitch, trajectory.yaw)


def make_motion(config: VehicleConfig, path: FloatArray, floor: Heightfield, rng: np.random.Generator) -> Motion:
    """Drive the vehicle along a path.

    Parameters
    ----------
    config : VehicleConfig
        Speed, height and attitude.
    path : ndarray, shape (K, 2)
        Horizontal path over the ground [m].
    floor : Heightfield
        The seafloor below it.
    rng : Generator
        Phases of the waves and changes of speed.

    Returns
    -------
    motion : Motion
        The true motion.
    """
    waves, distance = make_waves(config.waves, rng), _distance_run(config, path, rng)
    x, y = _smooth_path(path, distance)
    time = _KNOT * np.arange(x.size)
    z = _height(config, floor, (x, y))
    return Motion(CubicSpline(time, np.stack([x, y, z], axis=-1)), waves, config, float(time[-1]))


def crab_angle(velocity: FloatArray, current: tuple[float, float]) -> FloatArray:
    """Angle from course to heading of a vehicle that a current sets sideways.

    Parameters
    ----------
    velocity : ndarray, shape (N, 3)
        Velocity over ground in the world frame [m/s].
    current : tuple of float
        East and north velocity of the water [m/s].

    Returns
    -------
    angle : ndarray, shape (N,)
        To add to the course [rad].
    """
    through = velocity[:, :2] - np.asarray(current)
    cross = velocity[:, 0] * through[:, 1] - velocity[:, 1] * through[:, 0]
    return np.asarray(np.arctan2(cross, (velocity[:, :2] * through).sum(axis=-1)))


def _course(velocity: FloatArray, acceleration: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    turn_rate = (velocity[:, 0] * acceleration[:, 1] - velocity[:, 1] * acceleration[:, 0]) / speed**2
    return np.arctan2(velocity[:, 1], velocity[:, 0]), np.arctan2(velocity[:, 2], speed), turn_rate


def _distance_run(config: VehicleConfig, path: FloatArray, rng: np.random.Generator) -> FloatArray:
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    n = max(4, int(np.ceil(1.5 * length / (config.speed * _KNOT))) + 1)
    change = gaussian_filter1d(rng.standard_normal(n), 20.0 / _KNOT, mode="wrap")
    change = config.speed_variation * (change - change.mean()) / max(float(change.std()), 1e-12)
    run = np.concatenate([[0.0], np.cumsum(config.speed * _KNOT * np.clip(1.0 + change, 0.3, 1.7))])
    kept = run[run <= length + 1e-9]
    if kept.size < 4:
        raise ValueError(f"a path of {length:.2f} m at {config.speed} m/s given, at least {3 * _KNOT} s of it wanted")
    return kept


def _smooth_path(path: FloatArray, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions at distances along the path, its curvature steps rounded as inertia would."""
    step = 0.1
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    fine = np.arange(0.0, along[-1] + step, step)
    smooth = [_filter_straight(np.interp(fine, along, axis), 2.5 / step) for axis in path.T]
    return np.interp(distance, fine, smooth[0]), np.interp(distance, fine, smooth[1])


def _filter_straight(values: FloatArray, sigma: float) -> FloatArray:
    """Gaussian filter that continues both ends by point reflection, so that a straight line stays one."""
    pad = min(values.size - 1, int(5 * sigma))
    padded = np.pad(values, pad, mode="reflect", reflect_type="odd")
    return np.asarray(gaussian_filter1d(padded, sigma, mode="nearest")[pad : pad + values.size])


def _height(config: VehicleConfig, floor: Heightfield, xy: tuple[FloatArray, FloatArray]) -> FloatArray:
    ground = floor.sample(*xy)
    outside = np.flatnonzero(np.isnan(ground))
    if outside.size:
        k = outside[0]
        raise ValueError(
            f"the path leaves the terrain at x {xy[0][k]:.1f} m, y {xy[1][k]:.1f} m: a larger terrain is wanted"
        )
    step = config.speed * _KNOT
    z = _filter_straight(ground, 0.5 * config.follow_length / step) + config.altitude
    if config.keeping == "depth":
        z = np.full(ground.shape, -config.depth)
    if np.min(z - ground) < 1.0:
        raise ValueError(f"the vehicle comes within {np.min(z - ground):.1f} m of the floor, 1 m wanted: fly higher")
    return z
