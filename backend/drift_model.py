"""The drift model: errors of heading and velocity sensors, and how a Kalman filter carries them along a track."""

from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from backend.arrays import FloatArray
from backend.poses import sandwich
from backend.sensor_errors import SensorErrorsConfig


class DeadReckoningConfig(BaseModel):
    """Errors of the vehicle's sensors; defaults for a MEMS compass with a Doppler log, as nobody says better."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    source: Literal["recorded", "sensors"] = Field(
        default="recorded",
        description="Track to correct: the recorded one, by a navigator that knows its sensors, or a new one from the "
        "raw sensors; its covariance is that of the errors below.",
    )
    heading_bias_sd: float = Field(
        default=0.02,
        ge=0,
        description="Constant heading error [rad]; 1 deg, a swung compass. It turns the whole track: gauge.",
    )
    heading_walk: float = Field(
        default=2.0e-3,
        gt=0,
        description="Heading random walk [rad/sqrt(s)]; 7 deg/sqrt(h), a MEMS gyro; tactical 0.1 to 0.5.",
    )
    heading_deviation_sd: float = Field(
        default=0.02,
        ge=0,
        description="Heading error with the cosine and with the sine of the heading [rad]; 1.1 deg, iron on board.",
    )
    velocity_scale_sd: float = Field(
        default=0.01,
        ge=0,
        description="Relative error of the speed [1]; 0.1 to 1 % for Doppler logs, mostly from sound speed.",
    )
    velocity_misalignment_sd: float = Field(
        default=0.01,
        ge=0,
        description="Turn of the velocity against the heading sensor [rad]; 0.6 deg, usual mounting.",
    )
    velocity_noise: float = Field(
        default=0.02, gt=0, description="White velocity noise [m/s/sqrt(Hz)]; 2 cm/s at 1 Hz, a 600 kHz Doppler log."
    )
    depth_sd: float = Field(
        default=0.1,
        gt=0,
        description="Error of a measured depth [m]; repeatability of a pressure sensor, and waves.",
    )
    tilt_sd: float = Field(
        default=0.005, gt=0, description="Error of measured roll and pitch [rad]; 0.3 deg, a MEMS attitude sensor."
    )
    unary_slack: float = Field(
        default=10.0,
        ge=1,
        description="Depth and tilt of odometry are this much looser than measured [1]; each anchor holds its own.",
    )
    sensors: SensorErrorsConfig = SensorErrorsConfig()


def quarter_turn(vectors: FloatArray) -> FloatArray:
    """Turn horizontal vectors by 90 degrees: how a point moves when the world turns by one radian about the origin.

    Parameters
    ----------
    vectors : ndarray, shape (..., 2)
        Horizontal vectors.

    Returns
    -------
    turned : ndarray, shape (..., 2)
        The same, counter-clockwise.
    """
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def deviation(T_world_body: FloatArray) -> FloatArray:
    """What a deviating heading deviates with.

    Parameters
    ----------
    T_world_body : ndarray, shape (N, 4, 4)
        Body poses.

    Returns
    -------
    deviation : ndarray, shape (N, 2)
        Cosine and sine of the yaw.
    """
    yaw = np.arctan2(T_world_body[:, 1, 0], T_world_body[:, 0, 0])
    return np.stack([np.cos(yaw), np.sin(yaw)], axis=1)


def constant_sds(config: DeadReckoningConfig) -> FloatArray:
    """Standard deviations of what is constant over a dive but for the heading bias.

    Parameters
    ----------
    config : DeadReckoningConfig
        Errors of the sensors.

    Returns
    -------
    sds : ndarray, shape (4,)
        Scale, misalignment [rad] and the two deviations of the heading [rad].
    """
    return np.array(
        [
            config.velocity_scale_sd,
            config.velocity_misalignment_sd,
            config.heading_deviation_sd,
            config.heading_deviation_sd,
        ]
    )


def propagate(time: FloatArray, T_world_body: FloatArray, config: DeadReckoningConfig) -> FloatArray:
    """Carry the errors along a track by the prediction steps of a Kalman filter.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Time of the pings [s].
    T_world_body : ndarray, shape (N, 4, 4)
        Body poses.
    config : DeadReckoningConfig
        Errors of the sensors.

    Returns
    -------
    covariances : ndarray, shape (N, 4, 4)
        Of x, y, z and yaw in the world when the position of the first ping is known [m, m, m, rad].
    """
    from filterpy.kalman import predict  # half a second to import

    # state: errors of x, y and yaw, then scale, misalignment and the two deviations of the heading
    state, P = np.zeros(7), np.diag(np.concatenate([[0.0, 0.0, config.heading_bias_sd], constant_sds(config)]) ** 2)
    states = [P]
    step, turned = np.diff(T_world_body[:, :2, 3], axis=0), deviation(T_world_body)
    noises = _process_noises(step, np.diff(time), config)
    for F, Q in zip(_transitions(step, 0.5 * (turned[1:] + turned[:-1])), noises, strict=True):
        state, P = predict(state, P, F=F, Q=Q)
        states.append(P)
    return _as_x_y_z_yaw(np.stack(states), turned, config)


def _transitions(step: FloatArray, turned: FloatArray) -> FloatArray:
    """How errors of heading and velocity become errors of position over each step."""
    F, sideways = np.tile(np.eye(7), (len(step), 1, 1)), quarter_turn(step)
    F[:, :2, 2], F[:, :2, 3], F[:, :2, 4] = sideways, step, sideways
    F[:, :2, 5:] = np.einsum("ka,kb->kab", sideways, turned)
    return F


def _process_noises(step: FloatArray, dt: FloatArray, config: DeadReckoningConfig) -> FloatArray:
    """Noise of each step: velocity noise, and a heading that walks while the vehicle moves."""
    Q, sideways = np.zeros((len(step), 7, 7)), quarter_turn(step)
    walk = config.heading_walk**2 * dt
    Q[:, :2, :2] = config.velocity_noise**2 * dt[:, None, None] * np.eye(2)
    Q[:, :2, :2] += np.einsum("k,ka,kb->kab", walk / 3.0, sideways, sideways)
    Q[:, :2, 2] = Q[:, 2, :2] = walk[:, None] * sideways / 2.0
    Q[:, 2, 2] = walk
    return Q


def _as_x_y_z_yaw(P: FloatArray, turned: FloatArray, config: DeadReckoningConfig) -> FloatArray:
    """Pick x, y and the whole heading error from the states; depth is measured."""
    pick = np.zeros((len(P), 4, 7))
    pick[:, 0, 0] = pick[:, 1, 1] = pick[:, 3, 2] = 1.0
    pick[:, 3, 5:] = turned
    covariance = sandwich(pick, P)
    covariance[:, 2, 2] = config.depth_sd**2
    return covariance
