"""Rigid transforms as stacks of 4 x 4 arrays, and their 6-vectors: rotation first, as in GTSAM's Pose3.

Two forms of a relative pose's covariance meet here. In *target axes*, the form of a measurement: an error turns
``T_target_source`` by ``Exp(dw)`` from the left and shifts its origin by ``dt``, both along the target's axes. In the
*tangent*, the form of GTSAM's factors: ``T_target_source @ Exp(xi)``, along the source's axes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from backend.arrays import FloatArray

_SMALL_ANGLE = 1e-4  # below, the series of (1 - angle/2 cot(angle/2)) / angle**2 is exact to rounding


def as_poses(poses: ArrayLike, name: str) -> FloatArray:
    """Check a stack of rigid transforms.

    Parameters
    ----------
    poses : array_like, shape (K, 4, 4)
        What was given.
    name : str
        What it is called in the error message.

    Returns
    -------
    poses : ndarray, shape (K, 4, 4)
        The same transforms, float64.

    Raises
    ------
    ValueError
        If the shape is wrong, a number is not finite or a rotation is none.
    """
    T = np.asarray(poses, dtype=np.float64)
    if T.ndim != 3 or T.shape[1:] != (4, 4):
        raise ValueError(f"{name} must be poses of shape (K, 4, 4), got shape {T.shape}")
    if not np.isfinite(T).all():
        raise ValueError(f"{name} must be finite: pose {int(np.argwhere(~np.isfinite(T))[0, 0])} is not")
    gram = np.swapaxes(T[:, :3, :3], 1, 2) @ T[:, :3, :3]
    is_rigid = (np.abs(gram - np.eye(3)) < 1e-6).all(axis=(1, 2)) & (np.linalg.det(T[:, :3, :3]) > 0)
    is_rigid &= (T[:, 3] == [0.0, 0.0, 0.0, 1.0]).all(axis=1)
    if not is_rigid.all():
        raise ValueError(f"{name} must be rigid transforms: pose {int(np.argmin(is_rigid))} is not")
    return T


def invert(T_target_source: FloatArray) -> FloatArray:
    """Inverse of rigid transforms.

    Parameters
    ----------
    T_target_source : ndarray, shape (..., 4, 4)
        Rigid transforms.

    Returns
    -------
    T_source_target : ndarray, shape (..., 4, 4)
        Their inverses.
    """
    inverse = np.zeros_like(T_target_source)
    rotation = np.swapaxes(T_target_source[..., :3, :3], -1, -2)
    inverse[..., :3, :3] = rotation
    inverse[..., :3, 3] = -(rotation @ T_target_source[..., :3, 3:])[..., 0]
    inverse[..., 3, 3] = 1.0
    return inverse


def cross_matrix(vectors: FloatArray) -> FloatArray:
    """Matrices of the cross product: ``cross_matrix(a) @ b`` is ``a x b``.

    Parameters
    ----------
    vectors : ndarray, shape (..., 3)
        The left factors.

    Returns
    -------
    matrices : ndarray, shape (..., 3, 3)
        Skew-symmetric matrices.
    """
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def logarithm(T_target_source: FloatArray) -> FloatArray:
    """Tangent vectors of rigid transforms, the inverse of the exponential map.

    Parameters
    ----------
    T_target_source : ndarray, shape (K, 4, 4)
        Rigid transforms.

    Returns
    -------
    xi : ndarray, shape (K, 6)
        Rotation vector [rad], then the translation part [m]; as ``Pose3.Logmap`` of GTSAM.
    """
    omega = Rotation.from_matrix(T_target_source[:, :3, :3]).as_rotvec().reshape(-1, 3)
    angle = np.linalg.norm(omega, axis=1)
    safe = np.where(angle < _SMALL_ANGLE, 1.0, angle)
    exact = (1.0 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2
    factor = np.where(angle < _SMALL_ANGLE, 1.0 / 12.0 + angle**2 / 720.0, exact)
    W = cross_matrix(omega)
    inverse_left_jacobian = np.eye(3) - 0.5 * W + factor[:, None, None] * (W @ W)
    return np.concatenate([omega, (inverse_left_jacobian @ T_target_source[:, :3, 3:])[..., 0]], axis=1)


def adjoint(T_target_source: FloatArray) -> FloatArray:
    """Matrices that take tangent vectors from the source frame to the target frame.

    Parameters
    ----------
    T_target_source : ndarray, shape (..., 4, 4)
        Rigid transforms.

    Returns
    -------
    Ad : ndarray, shape (..., 6, 6)
        ``T Exp(xi) T**-1 = Exp(Ad xi)``; rotation first.
    """
    rotation = T_target_source[..., :3, :3]
    Ad = np.zeros((*T_target_source.shape[:-2], 6, 6))
    Ad[..., :3, :3] = Ad[..., 3:, 3:] = rotation
    Ad[..., 3:, :3] = cross_matrix(T_target_source[..., :3, 3]) @ rotation
    return Ad


def sandwich(matrix: FloatArray, covariance: FloatArray) -> FloatArray:
    """Covariance after a linear map, exactly symmetric.

    Parameters
    ----------
    matrix : ndarray, shape (..., m, n)
        The map.
    covariance : ndarray, shape (..., n, n)
        Covariance before it.

    Returns
    -------
    mapped : ndarray, shape (..., m, m)
        ``matrix @ covariance @ matrix.T``.
    """
    mapped = matrix @ covariance @ np.swapaxes(matrix, -1, -2)
    return np.asarray(0.5 * (mapped + np.swapaxes(mapped, -1, -2)))


def tangent_covariance(T_target_source: FloatArray, covariance: FloatArray) -> FloatArray:
    """Turn covariances of relative poses from target axes to GTSAM's tangent.

    Parameters
    ----------
    T_target_source : ndarray, shape (..., 4, 4)
        The relative poses.
    covariance : ndarray, shape (..., 6, 6)
        Covariance along the target's axes, rotation first [rad**2, rad m, m**2].

    Returns
    -------
    tangent : ndarray, shape (..., 6, 6)
        Covariance along the source's axes, as ``BetweenFactorPose3`` wants it.
    """
    turn = np.zeros((*T_target_source.shape[:-2], 6, 6))
    turn[..., :3, :3] = turn[..., 3:, 3:] = np.swapaxes(T_target_source[..., :3, :3], -1, -2)
    return sandwich(turn, covariance)


@dataclass(frozen=True)
class RelativePose:
    """One pose seen from another, as odometry or a loop closure measures it.

    Parameters
    ----------
    target, source : int
        Numbers of the two anchors.
    T_target_source : ndarray, shape (4, 4)
        Takes points of the source's body frame to the target's.
    covariance : ndarray, shape (6, 6)
        Along the target's axes, rotation first [rad**2, rad m, m**2].
    """

    target: int
    source: int
    T_target_source: FloatArray
    covariance: FloatArray
