"""Frames: world ENU, body forward-port-up, and the only place that knows NED and forward-starboard-down.

``R_world_body = Rz(yaw) Ry(pitch) Rx(roll)``: yaw counter-clockwise from east, pitch positive nose down, roll positive
starboard down. ``T_target_source`` takes source points to the target frame; inner names cancel.
"""

import numpy as np
from numpy.typing import ArrayLike

from frontend.arrays import FloatArray


def wrap_angle(angle: ArrayLike) -> FloatArray:
    """Wrap angles to the half-open interval from -pi to pi.

    Parameters
    ----------
    angle : array_like
        Angles [rad].

    Returns
    -------
    wrapped : ndarray
        The same angles in [-pi, pi) [rad].

    Examples
    --------
    >>> float(wrap_angle(3 * np.pi / 2)) == -np.pi / 2
    True
    """
    return np.asarray((np.asarray(angle, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi)


def rotation_world_body(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> FloatArray:
    """Rotation matrices that take body vectors to the world.

    Parameters
    ----------
    roll, pitch, yaw : array_like, shape (...)
        Attitude [rad]: roll positive starboard down, pitch positive nose down, yaw counter-clockwise from east.

    Returns
    -------
    rotation : ndarray, shape (..., 3, 3)
        ``Rz(yaw) Ry(pitch) Rx(roll)``.
    """
    roll, pitch, yaw = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (roll, pitch, yaw)))
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    rotation = np.empty((*roll.shape, 3, 3))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            rotation[..., i, j] = entry
    return rotation


def attitude_from_rotation(rotation: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Roll, pitch and yaw of rotation matrices; the inverse of `rotation_world_body`.

    Parameters
    ----------
    rotation : array_like, shape (..., 3, 3)
        Rotation matrices that take body vectors to the world.

    Returns
    -------
    roll, pitch, yaw : ndarray, shape (...)
        Attitude [rad]; pitch in [-pi/2, pi/2].
    """
    r = np.asarray(rotation, dtype=np.float64)
    roll = np.arctan2(r[..., 2, 1], r[..., 2, 2])
    pitch = np.arcsin(np.clip(-r[..., 2, 0], -1.0, 1.0))
    yaw = np.arctan2(r[..., 1, 0], r[..., 0, 0])
    return roll, pitch, yaw


def pose(translation: ArrayLike, rotation: ArrayLike) -> FloatArray:
    """Homogeneous transforms from translations and rotations.

    Parameters
    ----------
    translation : array_like, shape (..., 3)
        Origin of the source frame in the target frame [m].
    rotation : array_like, shape (..., 3, 3)
        Rotation from source to target.

    Returns
    -------
    T_target_source : ndarray, shape (..., 4, 4)
        Transforms that take source points to the target frame.
    """
    translation, rotation = np.asarray(translation, dtype=np.float64), np.asarray(rotation, dtype=np.float64)
    T = np.zeros((*np.broadcast_shapes(translation.shape[:-1], rotation.shape[:-2]), 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = rotation, translation, 1.0
    return T


def planar_pose(x: float, y: float, yaw: float, z: float = 0.0) -> FloatArray:
    """Transform of a level frame: a turn about z and a shift.

    Parameters
    ----------
    x, y : float
        Origin of the source frame in the target frame [m].
    yaw : float
        Turn from target to source, counter-clockwise [rad].
    z : float
        Height of the source's origin [m].

    Returns
    -------
    T_target_source : ndarray, shape (4, 4)
        The transform.
    """
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, -sine, 0.0, x], [sine, cosine, 0.0, y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]])


def planar_parameters(T_target_source: ArrayLike) -> tuple[float, float, float]:
    """The x, y and yaw of one transform; the inverse of `planar_pose` for level frames.

    Parameters
    ----------
    T_target_source : array_like, shape (4, 4)
        The transform.

    Returns
    -------
    x, y, yaw : float
        Shift [m] and turn [rad].
    """
    T = np.asarray(T_target_source, dtype=np.float64)
    return float(T[0, 3]), float(T[1, 3]), float(np.arctan2(T[1, 0], T[0, 0]))


def invert(T_target_source: ArrayLike) -> FloatArray:
    """Inverse of rigid transforms.

    Parameters
    ----------
    T_target_source : array_like, shape (..., 4, 4)
        Rigid transforms.

    Returns
    -------
    T_source_target : ndarray, shape (..., 4, 4)
        Their inverses.
    """
    T = np.asarray(T_target_source, dtype=np.float64)
    rotation = np.swapaxes(T[..., :3, :3], -1, -2)
    return pose(-(rotation @ T[..., :3, 3:])[..., 0], rotation)


def transform(T_target_source: ArrayLike, points_source: ArrayLike) -> FloatArray:
    """Take points from the source frame to the target frame.

    Parameters
    ----------
    T_target_source : array_like, shape (4, 4)
        A rigid transform.
    points_source : array_like, shape (..., 3)
        Points in the source frame [m].

    Returns
    -------
    points_target : ndarray, shape (..., 3)
        The same points in the target frame [m].
    """
    T, points = np.asarray(T_target_source, dtype=np.float64), np.asarray(points_source, dtype=np.float64)
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def level(T_world_body: ArrayLike) -> FloatArray:
    """The level frame of a body: same origin, x along the heading, z up.

    Parameters
    ----------
    T_world_body : array_like, shape (..., 4, 4)
        Body poses.

    Returns
    -------
    T_world_level : ndarray, shape (..., 4, 4)
        Poses with the yaw of the body and neither roll nor pitch.
    """
    T = np.asarray(T_world_body, dtype=np.float64)
    yaw = np.arctan2(T[..., 1, 0], T[..., 0, 0])
    return pose(T[..., :3, 3], rotation_world_body(0.0, 0.0, yaw))


def yaw_from_heading(heading: ArrayLike) -> FloatArray:
    """Yaw (counter-clockwise from east) of a heading (clockwise from north).

    Parameters
    ----------
    heading : array_like
        Headings [rad].

    Returns
    -------
    yaw : ndarray
        Yaw in [-pi, pi) [rad].
    """
    return wrap_angle(np.pi / 2 - np.asarray(heading, dtype=np.float64))


def heading_from_yaw(yaw: ArrayLike) -> FloatArray:
    """Heading (clockwise from north) of a yaw (counter-clockwise from east).

    Parameters
    ----------
    yaw : array_like
        Yaw angles [rad].

    Returns
    -------
    heading : ndarray
        Headings in [0, 2 pi) [rad].
    """
    return np.asarray((np.pi / 2 - np.asarray(yaw, dtype=np.float64)) % (2 * np.pi))


def attitude_from_nautical(
    roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Attitude in our convention from NED / forward-starboard-down angles.

    Parameters
    ----------
    roll : array_like
        Roll, positive starboard down [rad].
    pitch : array_like
        Pitch, positive nose UP, as in XTF and NMEA [rad].
    heading : array_like
        Heading clockwise from north [rad].

    Returns
    -------
    roll, pitch, yaw : ndarray
        Roll positive starboard down, pitch positive nose DOWN, yaw counter-clockwise from east [rad].
    """
    return np.array(roll, dtype=np.float64), -np.asarray(pitch, dtype=np.float64), yaw_from_heading(heading)
