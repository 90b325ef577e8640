"""Measurement models: what each sensor should answer in a state, and how its answer depends on the errors.

The answers of one epoch are compared each at its own time, and enter the filter as their mean at the epoch's end.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from backend.arrays import FloatArray
from backend.drift_model import DeadReckoningConfig
from backend.inertial_state import (
    CURRENT,
    DEVIATION,
    FORCE_BIAS,
    GRAVITY,
    HEADING,
    MISALIGNMENT,
    N_STATES,
    POSITION,
    SCALE,
    TURN,
    VELOCITY,
)
from backend.poses import cross_matrix


class Residual(NamedTuple):
    """How the answers differ from what was expected.

    Parameters
    ----------
    difference : ndarray, shape (K,)
        Mean of measured minus expected.
    sensitivity : ndarray, shape (K, 22)
        How it depends on the error state.
    covariance : ndarray, shape (K, K)
        Of its noise.
    """

    difference: FloatArray
    sensitivity: FloatArray
    covariance: FloatArray


class View(NamedTuple):
    """The nominal motion at the M times at which a sensor answered within an epoch.

    Parameters
    ----------
    attitude : ndarray, shape (M, 3, 3)
        Rotation from the body to the world.
    velocity, position : ndarray, shape (M, 3)
        In the world [m/s, m].
    lag : ndarray, shape (M,)
        Time until the end of the epoch [s].
    vector : ndarray, shape (22,)
        The nominal state at the end.
    rate : float
        Answers of the sensor a second [1/s].
    """

    attitude: FloatArray
    velocity: FloatArray
    position: FloatArray
    lag: FloatArray
    vector: FloatArray
    rate: float


def _compass(view: View, values: FloatArray, config: DeadReckoningConfig) -> Residual:
    """Heading with bias, walk and deviation."""
    forward, H = view.attitude[:, :, 0], np.zeros((1, N_STATES))
    yaw = np.arctan2(forward[:, 1], forward[:, 0])
    turned = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    expected = yaw + view.vector[HEADING] + turned @ view.vector[DEVIATION]
    difference = (values[:, 0] - expected + np.pi) % (2.0 * np.pi) - np.pi
    # a turn about a level axis moves the heading of a pitched body
    level = -forward[:, 2:] * forward[:, :2] / np.sum(forward[:, :2] ** 2, axis=1, keepdims=True)
    H[0, :2], H[0, 2], H[0, HEADING], H[0, DEVIATION] = level.mean(axis=0), 1.0, 1.0, turned.mean(axis=0)
    return Residual(difference.mean(keepdims=True), H, np.eye(1) * config.sensors.compass_noise**2 / len(values))


def _tilt(view: View, values: FloatArray, config: DeadReckoningConfig) -> Residual:
    """Roll and pitch as the direction of up in the body, seen in the world."""
    (sin_roll, sin_pitch), (cos_roll, cos_pitch) = np.sin(values.T), np.cos(values.T)
    up_body = np.stack([-sin_pitch, cos_pitch * sin_roll, cos_pitch * cos_roll], axis=-1)
    up = (view.attitude @ up_body[:, :, None])[:, :, 0].mean(axis=0)
    H = np.zeros((2, N_STATES))
    H[:, :2] = np.eye(2)
    return Residual(np.array([up[1], -up[0]]), H, np.eye(2) * config.tilt_sd**2 / len(values))


def _dvl(view: View, values: FloatArray, config: DeadReckoningConfig) -> Residual:
    """Velocity over ground along the body's axes, scaled and turned."""
    turned, body = _through_log(view, view.velocity)
    scale = 1.0 + view.vector[SCALE]
    H = _velocity_sensitivity(view, scale * turned @ np.swapaxes(view.attitude, 1, 2))
    H[:, SCALE] = body.mean(axis=0)
    H[:, MISALIGNMENT] = scale * np.array([-body[:, 1].mean(), body[:, 0].mean(), 0.0])
    noise = config.velocity_noise**2 * view.rate / len(values)
    return Residual((values - scale * body).mean(axis=0), H, np.eye(3) * noise)


def _speed_log(view: View, values: FloatArray, config: DeadReckoningConfig) -> Residual:
    """Speed ahead through the water, which itself moves; sideways the vehicle slips little."""
    through = view.velocity - np.append(view.vector[CURRENT], 0.0)
    turned, body = _through_log(view, through)
    scale = 1.0 + view.vector[SCALE]
    to_log = (scale * turned @ np.swapaxes(view.attitude, 1, 2))[:, :2]
    H = _velocity_sensitivity(view, to_log)
    H[:, TURN] -= to_log.mean(axis=0) @ cross_matrix(np.append(view.vector[CURRENT], 0.0))
    H[:, CURRENT] = -to_log[:, :, :2].mean(axis=0)
    H[:, SCALE] = body[:, :2].mean(axis=0)
    H[:, MISALIGNMENT] = scale * np.array([-body[:, 1].mean(), body[:, 0].mean()])
    difference = np.pad(values, ((0, 0), (0, 1))) - scale * body[:, :2]
    noise = np.array([config.sensors.speed_noise**2 / len(values), config.sensors.slip_sd**2])
    return Residual(difference.mean(axis=0), H, np.diag(noise))


def _depth(view: View, values: FloatArray, config: DeadReckoningConfig) -> Residual:
    """Depth below the start."""
    H = -_position_sensitivity(view)[2:]
    difference = (values[:, 0] + view.position[:, 2]).mean(keepdims=True)
    return Residual(difference, H, np.eye(1) * config.sensors.depth_noise**2 / len(values))


def _gnss(view: View, values: FloatArray, config: DeadReckoningConfig) -> Residual:
    """Horizontal position from the start."""
    difference = (values - view.position[:, :2]).mean(axis=0)
    return Residual(difference, _position_sensitivity(view)[:2], np.eye(2) * config.sensors.gnss_sd**2 / len(values))


def _through_log(view: View, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How a velocity log is turned in the body, and the velocity along its axes."""
    cos, sin = np.cos(view.vector[MISALIGNMENT]), np.sin(view.vector[MISALIGNMENT])
    turned = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return turned, np.einsum("ab,mcb,mc->ma", turned, view.attitude, velocity)


def _velocity_sensitivity(view: View, to_log: FloatArray) -> FloatArray:
    """How a measured velocity depends on the errors at the end of the epoch, and on what they did until then."""
    H = np.zeros((to_log.shape[1], N_STATES))
    lagging = view.lag[:, None, None] * to_log
    H[:, VELOCITY] = to_log.mean(axis=0)
    H[:, TURN] = lagging.mean(axis=0) @ cross_matrix(np.array([0.0, 0.0, GRAVITY]))
    H[:, FORCE_BIAS] = (lagging @ view.attitude).mean(axis=0)
    return H


def _position_sensitivity(view: View) -> FloatArray:
    """How a position depends on the errors at the end of the epoch, shape (3, 22)."""
    H = np.zeros((3, N_STATES))
    H[:, TURN] = -cross_matrix(view.position.mean(axis=0))
    H[:, VELOCITY], H[:, POSITION] = -view.lag.mean() * np.eye(3), np.eye(3)
    return H


Model = Callable[[View, FloatArray, DeadReckoningConfig], Residual]
MODELS: dict[str, Model] = {
    "compass": _compass,
    "tilt": _tilt,
    "dvl": _dvl,
    "speed_log": _speed_log,
    "depth": _depth,
    "gnss": _gnss,
}
GATED = frozenset({"dvl", "speed_log", "gnss"})
