"""What the vehicle's sensors report, each on its own clock."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from frontend.arrays import FloatArray
from frontend.frames import rotation_world_body, wrap_angle
from frontend.georeference import Georeference
from frontend.heightfield import Heightfield
from sssslam.simulation.altimeter import beam_ranges, measured_altitude
from sssslam.simulation.directional_gyro import integrated_heading
from sssslam.simulation.drift import Drift, DriftConfig
from sssslam.simulation.vehicle import Motion

Series = dict[str, FloatArray]
_GRAVITY = 9.80665
_EARTH_RATE = 7.292115e-5


class SensorsConfig(BaseModel):
    """Rates of the sensors, and when the bottom is lost."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    imu_rate: float = Field(default=20.0, ge=0, description="Inertial samples a second [1/s]; 0: none on board.")
    compass_rate: float = Field(
        default=10.0, ge=0, description="Attitude and heading samples a second [1/s]; 0: no compass, gyro alone."
    )
    dvl_rate: float = Field(
        default=5.0, ge=0, description="Velocity samples a second [1/s]; 0: no DVL, speed log alone."
    )
    depth_rate: float = Field(default=4.0, gt=0, description="Depth samples a second [1/s].")
    altimeter_rate: float = Field(default=5.0, gt=0, description="Altitude samples a second [1/s].")
    gnss_rate: float = Field(default=1.0, gt=0, description="Fixes a second at the surface [1/s].")
    gnss_noise: float = Field(default=1.0, ge=0, description="White noise of a fix on each axis [m].")
    gnss_depth: float = Field(default=0.5, ge=0, description="Deeper than this there is no fix [m].")
    dvl_range_max: float = Field(default=90.0, gt=0, description="Longest beam with a bottom [m]; a 600 kHz DVL.")
    dropouts: float = Field(default=0.0, ge=0, description="Losses of bottom lock an hour [1/h].")
    dropout_length: float = Field(default=20.0, gt=0, description="Mean length of a loss [s].")

    @model_validator(mode="after")
    def _heading_from_somewhere(self) -> Self:
        if self.compass_rate == 0 and self.imu_rate == 0:
            raise ValueError("a compass_rate and an imu_rate of 0 given, one of them wanted: nothing tells the heading")
        return self


@dataclass(frozen=True)
class Platform:
    """What the sensors measure: the true motion over the floor, and the errors of this dive's equipment."""

    motion: Motion
    floor: Heightfield
    drift: Drift
    errors: DriftConfig
    georeference: Georeference | None


def sense(platform: Platform, config: SensorsConfig, rng: np.random.Generator) -> dict[str, Series]:
    """Simulate every sensor over the whole dive.

    Parameters
    ----------
    platform : Platform
        True motion and errors.
    config : SensorsConfig
        Rates.
    rng : Generator
        White noise; each sensor has its own child.

    Returns
    -------
    sensors : dict of str to dict of str to ndarray
        Series by sensor, each with its ``time`` in seconds since the start; NaN where a sensor had no answer.
    """
    rngs = dict(zip(("imu", "compass", "dvl", "depth", "altimeter", "gnss"), rng.spawn(6), strict=True))
    sensors = {
        "depth": _depth(platform, config, rngs["depth"]),
        "altimeter": _altimeter(platform, config, rngs["altimeter"]),
        "gnss": _gnss(platform, config, rngs["gnss"]),
    }
    if config.imu_rate > 0:
        sensors["imu"] = _imu(platform, config, rngs["imu"])
    if config.compass_rate > 0:
        sensors["compass"] = _compass(platform, config, rngs["compass"])
    else:
        sensors["directional_gyro"] = _directional_gyro(platform, sensors["imu"], rngs["compass"])
    if config.dvl_rate > 0:
        sensors["dvl"] = _dvl(platform, config, rngs["dvl"])
    else:
        sensors["speed_log"] = _speed_log(platform, rngs["dvl"])
    return {name: sensors[name] for name in sorted(sensors) if sensors[name]["time"].size}


def _clock(platform: Platform, rate: float, phase: float) -> FloatArray:
    """Times of a sensor; its phase keeps it from ticking with the others, its last tick lies past the end."""
    n = int(np.ceil(platform.motion.duration * rate - phase)) + 2
    return np.asarray((np.arange(n) + phase) / rate, dtype=np.float64)


def _compass(platform: Platform, config: SensorsConfig, rng: np.random.Generator) -> Series:
    time = _clock(platform, config.compass_rate, 0.0)
    true = platform.motion.trajectory(time)
    noise = np.radians(platform.errors.attitude_noise_deg) * rng.standard_normal((time.size, 2))
    yaw = wrap_angle(true.yaw + platform.drift.heading_error(time, true.yaw))
    return {"time": time, "roll": true.roll + noise[:, 0], "pitch": true.pitch + noise[:, 1], "yaw": yaw}


def _directional_gyro(platform: Platform, imu: Series, rng: np.random.Generator) -> Series:
    """Attitude by inclinometers, heading by the gyro alone; aligned as well as a compass knows the heading."""
    true = platform.motion.trajectory(imu["time"])
    noise = np.radians(platform.errors.attitude_noise_deg) * rng.standard_normal((imu["time"].size, 2))
    level = np.stack([true.roll, true.pitch], axis=-1) + noise
    aligned, earth_rate = float(true.yaw[0]) + platform.drift.heading_bias, _earth_rate(platform.georeference)[2]
    yaw = integrated_heading(imu, level, aligned, float(earth_rate))
    return {"time": imu["time"], "roll": level[:, 0], "pitch": level[:, 1], "yaw": yaw}


def _depth(platform: Platform, config: SensorsConfig, rng: np.random.Generator) -> Series:
    time = _clock(platform, config.depth_rate, 0.0)
    noise = platform.errors.depth_noise * rng.standard_normal(time.size)
    return {"time": time, "depth": -platform.motion.trajectory(time).z + platform.drift.depth_bias + noise}


def _altimeter(platform: Platform, config: SensorsConfig, rng: np.random.Generator) -> Series:
    time = _clock(platform, config.altimeter_rate, 0.0)
    ranges = beam_ranges(platform.motion.trajectory(time), platform.floor)
    return {"time": time, "altitude": measured_altitude(ranges, platform.errors.altimeter_noise, rng)}


def _dvl(platform: Platform, config: SensorsConfig, rng: np.random.Generator) -> Series:
    """Velocity over ground in the body frame, mean over the time since the last sample, and the beams' ranges."""
    time = _clock(platform, config.dvl_rate, 0.4)
    velocity = _mean_body_velocity(platform.motion, time)
    noise = platform.errors.velocity_noise * np.sqrt(config.dvl_rate) * rng.standard_normal((time.size, 3))
    ranges = beam_ranges(platform.motion.trajectory(time), platform.floor)
    ranges = np.where(ranges > config.dvl_range_max, np.nan, ranges)
    ranges[_dropped(time, config, rng)] = np.nan
    turn = rotation_world_body(0.0, 0.0, platform.drift.misalignment)
    measured = (1.0 + platform.drift.velocity_scale) * velocity @ turn.T + noise
    measured[np.isfinite(ranges).sum(axis=1) < 3] = np.nan
    columns = {f"velocity_{axis}": measured[:, k] for k, axis in enumerate("xyz")}
    return {"time": time, **columns, **{f"range_{k + 1}": ranges[:, k] for k in range(4)}}


def _speed_log(platform: Platform, rng: np.random.Generator) -> Series:
    """Speed through the water as a propeller's revolutions tell it."""
    time = _clock(platform, 1.0, 0.4)
    velocity = platform.motion.velocity(time)
    through = np.hypot(*(velocity[:, :2] - np.asarray(platform.motion.config.current)).T)
    noise = platform.errors.velocity_noise * rng.standard_normal(time.size)
    return {"time": time, "speed": (1.0 + platform.drift.velocity_scale) * through + noise}


def _imu(platform: Platform, config: SensorsConfig, rng: np.random.Generator) -> Series:
    """Angular rate and specific force in the body frame, biased and noisy; the Earth turns where its place is known."""
    time, errors = _clock(platform, config.imu_rate, 0.0), platform.errors
    true, half = platform.motion.trajectory(time), 0.5e-3
    body = np.swapaxes(rotation_world_body(true.roll, true.pitch, true.yaw), -1, -2)
    acceleration = (platform.motion.velocity(time + half) - platform.motion.velocity(time - half)) / (2 * half)
    gyro = np.radians(errors.gyro_bias_deg / 3600) * rng.standard_normal(3)
    force = errors.accelerometer_bias * rng.standard_normal(3)
    noise = rng.standard_normal((time.size, 6)) * np.sqrt(config.imu_rate)
    rate = platform.motion.angular_rate(time) + _earth_rate(platform.georeference)
    rates = (body @ rate[..., None])[..., 0] + gyro + np.radians(errors.gyro_noise_deg / 60) * noise[:, :3]
    lifted = acceleration + np.array([0.0, 0.0, _GRAVITY])
    forces = (body @ lifted[..., None])[..., 0] + force + errors.accelerometer_noise * noise[:, 3:]
    columns = {f"angular_rate_{axis}": rates[:, k] for k, axis in enumerate("xyz")}
    return {"time": time, **columns, **{f"specific_force_{axis}": forces[:, k] for k, axis in enumerate("xyz")}}


def _gnss(platform: Platform, config: SensorsConfig, rng: np.random.Generator) -> Series:
    """Fixes at the surface; on the map's grid, and in degrees where the scene has a place on the Earth."""
    time = _clock(platform, config.gnss_rate, 0.7)
    noise = config.gnss_noise * rng.standard_normal((time.size, 2))
    true = platform.motion.trajectory(time)
    up = true.z > -config.gnss_depth
    x, y = (true.x + noise[:, 0])[up], (true.y + noise[:, 1])[up]
    series = {"time": time[up], "position_x": x, "position_y": y}
    if platform.georeference is not None:
        series["latitude"], series["longitude"] = platform.georeference.to_geographic(x, y)
    return series


def _mean_body_velocity(motion: Motion, time: FloatArray) -> FloatArray:
    before = np.concatenate([[0.0], time[:-1]])
    step = motion.trajectory(time).positions - motion.trajectory(before).positions
    middle = motion.trajectory(0.5 * (before + time))
    body = np.swapaxes(rotation_world_body(middle.roll, middle.pitch, middle.yaw), -1, -2)
    return np.asarray((body @ (step / (time - before)[:, None])[..., None])[..., 0])


def _dropped(time: FloatArray, config: SensorsConfig, rng: np.random.Generator) -> FloatArray:
    """Where the bottom is lost by chance: losses at random times of random length."""
    start = rng.uniform(time[0], time[-1], rng.poisson(config.dropouts * (time[-1] - time[0]) / 3600))
    end = start + rng.exponential(config.dropout_length, start.size)
    return np.asarray(((time[:, None] >= start) & (time[:, None] < end)).any(axis=1))


def _earth_rate(georeference: Georeference | None) -> FloatArray:
    if georeference is None:
        return np.zeros(3)
    latitude = np.radians(georeference.latitude)
    return np.array([0.0, _EARTH_RATE * np.cos(latitude), _EARTH_RATE * np.sin(latitude)])
