"""A dive in closed form and what its sensors would say: an independent judge of the inertial filter."""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from backend.arrays import FloatArray
from backend.drift_model import DeadReckoningConfig
from backend.sensor_errors import SensorErrorsConfig

START = (30.0, -20.0)
GRAVITY = 9.80665


def path(time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position, velocity and acceleration along an eight with a little heave, at 1 to 3 m/s."""
    w, size = 2.0 * np.pi / 120.0, np.array([30.0, 18.0])
    phase = np.stack([w * time, 2.0 * w * time], axis=-1)
    rate = np.array([w, 2.0 * w])
    level = size * np.sin(phase), size * rate * np.cos(phase), -size * rate**2 * np.sin(phase)
    heave = [a * f(0.8 * time) for a, f in ((0.1, np.sin), (0.08, np.cos), (-0.064, np.sin))]
    position, velocity, acceleration = (np.column_stack([xy, z]) for xy, z in zip(level, heave, strict=True))
    return position + np.array([*START, -15.0]), velocity, acceleration


def attitude(time: FloatArray) -> Rotation:
    """Along the path, nose 3 degrees down, rolling and pitching."""
    velocity = path(time)[1]
    yaw = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    pitch, roll = 0.05 + 0.02 * np.sin(0.9 * time), 0.03 * np.sin(0.7 * time + 1.0)
    return Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=-1))


def yaw_of(rotation: FloatArray) -> FloatArray:
    return np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])


@dataclass(frozen=True)
class Rates:
    """Answers a second of each sensor; those of rate 0 are not on board."""

    imu: float = 20.0
    compass: float = 5.0
    dvl: float = 5.0
    depth: float = 4.0
    gnss: float = 0.0
    duration: float = 120.0
    earth: FloatArray = field(default_factory=lambda: np.zeros(3))


def make_sensors(
    config: DeadReckoningConfig, rng: np.random.Generator | None, rates: Rates | None = None
) -> dict[str, dict[str, FloatArray]]:
    """What the sensors answer, with errors drawn as the configuration says; without a generator, without errors."""
    rates = rates or Rates()
    draw = (lambda *shape: rng.standard_normal(shape)) if rng else (lambda *shape: np.zeros(shape))
    sensors = {
        "compass": _compass(config, draw, rates),
        "dvl": _dvl(config, draw, rates),
        "imu": _imu(config, draw, rates),
    }
    time = clock(rates.depth, rates)
    noise = config.sensors.depth_noise * draw(time.size)
    sensors["depth"] = {"time": time, "depth": -path(time)[0][:, 2] + noise}
    time = clock(rates.gnss, rates)
    x, y, _ = path(time)[0].T + config.sensors.gnss_sd * draw(3, time.size)
    sensors["gnss"] = {"time": time, "position_x": x, "position_y": y}
    return {name: series for name, series in sensors.items() if series["time"].size}


def clock(rate: float, rates: Rates) -> FloatArray:
    return np.arange(0.0, rates.duration + 1e-9, 1.0 / rate) if rate > 0 else np.zeros(0)


def _compass(config, draw, rates):
    time = clock(rates.compass, rates)
    yaw, pitch, roll = attitude(time).as_euler("ZYX").T if time.size else np.zeros((3, 0))
    steps = config.heading_walk * np.sqrt(1.0 / max(rates.compass, 1e-9)) * draw(time.size)
    error = config.heading_bias_sd * draw(1) + np.cumsum(steps) + config.sensors.compass_noise * draw(time.size)
    error = error + config.heading_deviation_sd * (draw(1) * np.cos(yaw) + draw(1) * np.sin(yaw))
    tilt = config.tilt_sd * draw(2, time.size)
    return {"time": time, "roll": roll + tilt[0], "pitch": pitch + tilt[1], "yaw": yaw + error}


def _dvl(config, draw, rates):
    time = clock(rates.dvl, rates)
    velocity = attitude(time).inv().apply(path(time)[1]) if time.size else np.zeros((0, 3))
    turn = Rotation.from_rotvec(config.velocity_misalignment_sd * np.array([0.0, 0.0, 1.0]) * draw(1))
    noise = config.velocity_noise * np.sqrt(rates.dvl) * draw(time.size, 3)
    measured = (1.0 + config.velocity_scale_sd * draw(1)) * turn.apply(velocity.reshape(-1, 3)) + noise
    return {"time": time, **{f"velocity_{axis}": measured[:, k] for k, axis in enumerate("xyz")}}


def _imu(config, draw, rates):
    time, half = clock(rates.imu, rates), 1e-3
    if not time.size:
        return {"time": time}
    turned = attitude(time)
    rate = (attitude(time - half).inv() * attitude(time + half)).as_rotvec() / (2.0 * half)
    rate = rate + turned.inv().apply(rates.earth)
    force = turned.inv().apply(path(time)[2] + [0.0, 0.0, GRAVITY])
    errors, noise = config.sensors, np.sqrt(rates.imu) * draw(time.size, 6)
    rate = rate + errors.gyro_bias_sd * draw(3) + errors.gyro_noise * noise[:, :3]
    force = force + errors.accelerometer_bias_sd * draw(3) + errors.accelerometer_noise * noise[:, 3:]
    columns = {f"angular_rate_{axis}": rate[:, k] for k, axis in enumerate("xyz")}
    return {"time": time, **columns, **{f"specific_force_{axis}": force[:, k] for k, axis in enumerate("xyz")}}


def grade(name: str) -> DeadReckoningConfig:
    """Errors of three grades of equipment."""
    k = ("navigation", "tactical", "mems").index(name)
    degree = np.pi / 180.0
    sensors = SensorErrorsConfig(
        gyro_bias_sd=(0.01, 1.0, 10.0)[k] * degree / 3600.0,
        gyro_noise=(0.002, 0.1, 0.34)[k] * degree / 60.0,
        accelerometer_bias_sd=(3e-4, 3e-3, 0.05)[k],
        accelerometer_noise=(1e-4, 5e-4, 2e-3)[k],
        compass_noise=(2e-4, 1e-3, 3e-3)[k],
        depth_noise=0.02,
        epoch=1.0,
    )
    return DeadReckoningConfig(
        heading_bias_sd=(0.035, 0.15, 2.0)[k] * degree,
        heading_walk=(0.002, 0.1, 6.0)[k] * degree / 60.0,
        heading_deviation_sd=(0.0, 0.1, 1.5)[k] * degree,
        velocity_scale_sd=(0.0015, 0.0035, 0.0075)[k],
        velocity_misalignment_sd=(0.05, 0.1, 0.5)[k] * degree,
        velocity_noise=(0.003, 0.005, 0.025)[k],
        depth_sd=0.02,
        tilt_sd=(0.01, 0.05, 0.3)[k] * degree,
        sensors=sensors,
    )
