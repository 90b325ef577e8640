"""Heading without a compass: the gyro's turn rate integrated from the heading it was aligned to."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import wrap_angle


def integrated_heading(imu: dict[str, FloatArray], level: FloatArray, start: float, earth_rate: float) -> FloatArray:
    """Integrate the turn rate about the vertical.

    Parameters
    ----------
    imu : dict of str to ndarray, shape (N,)
        ``time`` [s] and ``angular_rate_x``, ``_y``, ``_z`` in the body frame [rad/s].
    level : ndarray, shape (N, 2)
        Roll and pitch as measured at these times [rad].
    start : float
        Yaw the gyro was aligned to at the first sample [rad].
    earth_rate : float
        Vertical part of the Earth's rotation, which is taken off [rad/s]; the horizontal part turns no level gyro.

    Returns
    -------
    yaw : ndarray, shape (N,)
        Yaw [rad]. A bias g of the gyro makes it wrong by g t, and a straight run at speed v by v g t^2 / 2.
    """
    roll, pitch = level.T
    turned = imu["angular_rate_y"] * np.sin(roll) + imu["angular_rate_z"] * np.cos(roll)
    rate = turned / np.cos(pitch) - earth_rate
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(imu["time"])
    return wrap_angle(start + np.concatenate([[0.0], np.cumsum(steps)]))
