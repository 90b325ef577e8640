"""Solving graphs of GTSAM: least squares, graduated non-convexity, marginal covariances."""

from collections.abc import Sequence
from dataclasses import replace

import gtsam
import numpy as np
from scipy.special import chdtri

from backend.arrays import FloatArray, IntArray
from backend.descent import descend, descend_once
from backend.factors import between_factors, graph_of, pose_values, poses_of
from backend.poses import RelativePose, invert, logarithm, tangent_covariance

_DIMENSIONS = 6  # of a relative pose
_CONTROL_STEP = 2.0  # of the control parameter; Yang et al. have 1.4, which gives the same weights
_MAX_STEPS = 40  # of the control parameter; from squared residuals 1e6 times the limit to weights of zero and one
_LEAST_WEIGHT = 1e-6  # below, a measurement is as good as left out
_ROUGH_SHARE = 1e-3  # of the error that is left to gain; it moves no residual by a tenth of its sigma


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
    return poses_of(descend(graph_of(factors), pose_values(T_start), 0.0))


def improve(factors: Sequence[gtsam.NonlinearFactor], T_start: FloatArray) -> FloatArray:
    """Go most of the way to the minimum: enough to judge residuals by.

    Parameters
    ----------
    factors : sequence of gtsam.NonlinearFactor
        The graph.
    T_start : ndarray, shape (S, 4, 4)
        Poses to start from.

    Returns
    -------
    T : ndarray, shape (S, 4, 4)
        Poses near the minimum.
    """
    return poses_of(descend(graph_of(factors), pose_values(T_start), _ROUGH_SHARE))


def truncated_weights(
    known: Sequence[gtsam.NonlinearFactor],
    doubtful: Sequence[RelativePose],
    T_start: FloatArray,
    inlier_probability: float,
) -> tuple[FloatArray, FloatArray]:
    """Weigh doubtful relative poses by graduated non-convexity with a truncated least-squares loss.

    Parameters
    ----------
    known : sequence of gtsam.NonlinearFactor
        Factors that are right.
    doubtful : sequence of RelativePose, length D
        Measurements that may be wrong.
    T_start : ndarray, shape (S, 4, 4)
        Poses to start from.
    inlier_probability : float
        Share of right measurements whose residual stays below the truncation.

    Returns
    -------
    weights : ndarray, shape (D,)
        One where a measurement fits, zero where it does not.
    T : ndarray, shape (S, 4, 4)
        The poses at the end.

    Notes
    -----
    GTSAM has this too. Here each step starts at the poses of the one before and stops early, as only the weights
    matter: a tenth of the time where few measurements are wrong.

    References
    ----------
    .. [1] Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020.
       :doi:`10.1109/LRA.2020.2965893`
    """
    limit = float(chdtri(_DIMENSIONS, 1.0 - inlier_probability))
    T, weights = improve([*known, *between_factors(doubtful)], T_start), np.ones(len(doubtful))
    squared = residual_distances(T, doubtful)
    largest = float(squared.max(initial=0.0))
    if largest <= limit:
        return weights, T
    control, values = limit / (2.0 * largest - limit), pose_values(T)
    for _ in range(_MAX_STEPS):
        weights = _weights(squared, limit, control)
        values = _improved(known, doubtful, weights, values)
        T = poses_of(values)
        squared = residual_distances(T, doubtful)
        if ((weights == 0.0) | (weights == 1.0)).all() and np.array_equal(weights, _weights(squared, limit, control)):
            break
        control *= _CONTROL_STEP
    return weights, T


def _weights(squared: FloatArray, limit: float, control: float) -> FloatArray:
    """Weights of squared residuals, eq. 14 of Yang et al."""
    between = np.sqrt(limit * control * (control + 1.0) / np.maximum(squared, 1e-12)) - control
    ratio = (control + 1.0) / control
    return np.where(squared >= limit * ratio, 0.0, np.where(squared <= limit / ratio, 1.0, np.clip(between, 0.0, 1.0)))


def _improved(
    known: Sequence[gtsam.NonlinearFactor], doubtful: Sequence[RelativePose], weights: FloatArray, values: gtsam.Values
) -> gtsam.Values:
    """Poses after a step of weighted least squares; the next begins where it ends."""
    pairs = zip(doubtful, weights, strict=True)
    weighted = [replace(one, covariance=one.covariance / weight) for one, weight in pairs if weight > _LEAST_WEIGHT]
    return descend_once(graph_of([*known, *between_factors(weighted)]), values)


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
