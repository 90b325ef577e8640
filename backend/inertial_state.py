"""The state of the inertial filter: what it holds, and how an error is added to it.

The nominal state is an attitude and a vector; the filter's error state has the same numbering, with a small turn along
the world's axes in place of the attitude, and that turn turns velocity and position too: ``R_true = Exp(turn) R``,
``v_true = Exp(turn) v + error``, ``p_true = Exp(turn) p + error``, all else ``true = nominal + error``. So what no
sensor but the compass can tell, a turn of the whole track about the vertical at its start, is the same one error state
however the estimate changes, and the filter learns nothing of it by mistake (the right-invariant error of Barrau and
Bonnabel, IEEE Transactions on Automatic Control 62(4), 2017, :doi:`10.1109/TAC.2016.2594085`).
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from backend.arrays import FloatArray
from backend.drift_model import DeadReckoningConfig
from backend.poses import cross_matrix

TURN, VELOCITY, POSITION = slice(0, 3), slice(3, 6), slice(6, 9)  # rad, m/s, m from the start
GYRO_BIAS, FORCE_BIAS = slice(9, 12), slice(12, 15)  # rad/s, m/s2, along the body's axes
SCALE, MISALIGNMENT = 15, 16  # of the velocity over ground or through the water: 1, rad
HEADING, DEVIATION, CURRENT = 17, slice(18, 20), slice(20, 22)  # error of the compass [rad]; of the water [m/s]
N_STATES, N_MOVING = 22, 15
GRAVITY = 9.80665
_GRAVITY_SD = 0.03  # from the equator to the poles, m/s2
_UNKNOWN_YAW = 10.0  # rad: the first compass sample, with its own errors, says it all
_LEAST = 1e-8  # of a sigma, so that no covariance is singular
_GAUGE = 1e-3  # m: the start is where the track has it
_FIRST_SPEED_SD = 0.5  # m/s


class State(NamedTuple):
    """A nominal state.

    Parameters
    ----------
    attitude : ndarray, shape (3, 3)
        Rotation from the body to the world.
    vector : ndarray, shape (22,)
        All else by the numbering of the error state; the first three are zero.
    """

    attitude: FloatArray
    vector: FloatArray

    def plus(self, error: FloatArray) -> "State":
        """The state that differs by an error.

        Parameters
        ----------
        error : ndarray, shape (22,)
            The error.

        Returns
        -------
        state : State
            The sum.
        """
        turn, vector = Rotation.from_rotvec(error[TURN]).as_matrix(), self.vector + error
        vector[TURN] = 0.0
        vector[VELOCITY] = turn @ self.vector[VELOCITY] + error[VELOCITY]
        vector[POSITION] = turn @ self.vector[POSITION] + error[POSITION]
        return State(turn @ self.attitude, vector)

    def minus(self, other: "State") -> FloatArray:
        """The error by which this state differs from another.

        Parameters
        ----------
        other : State
            The other.

        Returns
        -------
        error : ndarray, shape (22,)
            So that ``other.plus(error)`` is this one.
        """
        turn, error = self.attitude @ other.attitude.T, self.vector - other.vector
        error[TURN] = Rotation.from_matrix(turn).as_rotvec()
        error[VELOCITY] = self.vector[VELOCITY] - turn @ other.vector[VELOCITY]
        error[POSITION] = self.vector[POSITION] - turn @ other.vector[POSITION]
        return error

    @property
    def track_sensitivity(self) -> FloatArray:
        """Shape (4, 22): how yaw, x, y and z depend on the error state."""
        sensitivity = np.zeros((4, N_STATES))
        sensitivity[0, TURN.stop - 1] = 1.0
        sensitivity[1:, POSITION] = np.eye(3)
        sensitivity[1:, TURN] = -cross_matrix(self.vector[POSITION])
        return sensitivity


def prior_covariance(config: DeadReckoningConfig, has_compass: bool, has_imu: bool, start_sd: float) -> FloatArray:
    """What is known of the errors before the first answer.

    Parameters
    ----------
    config : DeadReckoningConfig
        Errors of the sensors.
    has_compass : bool
        Whether the heading is measured all along, or only known at the start.
    has_imu : bool
        Whether rates and forces come from a biased unit.
    start_sd : float
        Standard deviation of the first position on each axis [m].

    Returns
    -------
    covariance : ndarray, shape (22, 22)
        Of the error state; diagonal.
    """
    errors, sds = config.sensors, np.zeros(N_STATES)
    sds[TURN] = 2.0 * config.tilt_sd, 2.0 * config.tilt_sd, _UNKNOWN_YAW if has_compass else config.heading_bias_sd
    sds[VELOCITY], sds[POSITION] = _FIRST_SPEED_SD, (max(start_sd, _GAUGE),) * 2 + (config.depth_sd,)
    if has_imu:
        sds[GYRO_BIAS], sds[FORCE_BIAS] = errors.gyro_bias_sd, errors.accelerometer_bias_sd
        sds[FORCE_BIAS.stop - 1] = np.hypot(errors.accelerometer_bias_sd, _GRAVITY_SD)
    sds[SCALE], sds[MISALIGNMENT] = config.velocity_scale_sd, config.velocity_misalignment_sd
    if has_compass:
        sds[HEADING], sds[DEVIATION] = config.heading_bias_sd, config.heading_deviation_sd
    sds[CURRENT] = errors.current_sd
    return np.diag(np.maximum(sds, _LEAST) ** 2)
