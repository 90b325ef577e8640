"""Solving graphs of GTSAM, of whatever factors: least squares and marginal covariances."""

from collections.abc import Sequence

import gtsam
import numpy as np

from backend.arrays import FloatArray, IntArray
from backend.descent import descend
from backend.factors import graph_of, pose_values, poses_of
from backend.poses import RelativePose, invert, logarithm, tangent_covariance


def optimise(factors: Sequence[gtsam.NonlinearFactor], T_start: FloatArray) -> FloatArray:
    """Minimise the squared residuals of all factors.

    Parameters
    ----------
    factors : sequence of gtsam.NonlinearFactor
        The graph.
    T_start : ndarray, shape (S, 4, 4)
        Poses to start from.

    Returns
    -------
    T : ndarray, shape (S, 4, 4)
        The poses of the minimum.
    """
    return poses_of(descend(graph_of(factors), pose_values(T_start)))


def residual_distances(T_world_anchor: FloatArray, relative_poses: Sequence[RelativePose]) -> FloatArray:
    """Residuals of relative poses against their own covariances.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (S, 4, 4)
        Poses of the anchors.
    relative_poses : sequence of RelativePose, length C
        What was measured between them.

    Returns
    -------
    distances : ndarray, shape (C,)
        Squared Mahalanobis distances of six dimensions.
    """
    target: IntArray = np.array([relative.target for relative in relative_poses], dtype=np.int64)
    source: IntArray = np.array([relative.source for relative in relative_poses], dtype=np.int64)
    measured = np.array([relative.T_target_source for relative in relative_poses]).reshape(-1, 4, 4)
    covariance = np.array([relative.covariance for relative in relative_poses]).reshape(-1, 6, 6)
    found = invert(T_world_anchor[target]) @ T_world_anchor[source]
    residual = logarithm(invert(measured) @ found)
    weighed = np.linalg.solve(tangent_covariance(measured, covariance), residual[..., None])[..., 0]
    return np.asarray(np.einsum("ai,ai->a", residual, weighed))


def marginal_covariances(factors: Sequence[gtsam.NonlinearFactor], T: FloatArray) -> FloatArray:
    """Covariance of each pose by itself.

    Parameters
    ----------
    factors : sequence of gtsam.NonlinearFactor
        The graph.
    T : ndarray, shape (S, 4, 4)
        The poses of its minimum.

    Returns
    -------
    covariances : ndarray, shape (S, 6, 6)
        Along each body's own axes, rotation first [rad**2, rad m, m**2].
    """
    marginals = gtsam.Marginals(graph_of(factors), pose_values(T))
    return np.stack([marginals.marginalCovariance(pose) for pose in range(len(T))])


def half_squared_error(factors: Sequence[gtsam.NonlinearFactor], T: FloatArray) -> float:
    """Half the sum of squared normalised residuals.

    Parameters
    ----------
    factors : sequence of gtsam.NonlinearFactor
        The graph.
    T : ndarray, shape (S, 4, 4)
        Poses.

    Returns
    -------
    error : float
        The error.
    """
    return float(graph_of(factors).error(pose_values(T)))
