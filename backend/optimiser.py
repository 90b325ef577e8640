"""GTSAM's optimisers: Levenberg-Marquardt, graduated non-convexity, marginal covariances."""

from collections.abc import Sequence

import gtsam
import numpy as np

from backend.arrays import FloatArray
from backend.factors import graph_of, pose_values, poses_of

_RELATIVE_TOLERANCE = 1e-9  # GTSAM's own 1e-5 stops before the minimum on long chains


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
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph_of(factors), pose_values(T_start), _lm_params())
    return poses_of(optimizer.optimize())


def truncated_weights(
    known: Sequence[gtsam.NonlinearFactor],
    doubtful: Sequence[gtsam.NonlinearFactor],
    T_start: FloatArray,
    inlier_probability: float,
) -> FloatArray:
    """Weigh doubtful factors by graduated non-convexity with a truncated least-squares loss.

    Parameters
    ----------
    known : sequence of gtsam.NonlinearFactor
        Factors that are right.
    doubtful : sequence of gtsam.NonlinearFactor, length D
        Factors that may be wrong.
    T_start : ndarray, shape (S, 4, 4)
        Poses to start from.
    inlier_probability : float
        Share of right factors whose residual stays below the truncation.

    Returns
    -------
    weights : ndarray, shape (D,)
        One where a factor fits, zero where it does not.

    References
    ----------
    .. [1] Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020.
       :doi:`10.1109/LRA.2020.2965893`
    """
    if not doubtful:
        return np.zeros(0)
    params = gtsam.GncLMParams(_lm_params())
    params.setLossType(gtsam.GncLossType.TLS)
    params.setScheduler(gtsam.GncScheduler.SuperLinear)  # half the time of the linear schedule, the same verdicts
    params.setKnownInliers(list(range(len(known))))
    optimizer = gtsam.GncLMOptimizer(graph_of([*known, *doubtful]), pose_values(T_start), params)
    optimizer.setInlierCostThresholdsAtProbability(inlier_probability)
    optimizer.optimize()
    return np.asarray(optimizer.getWeights(), dtype=np.float64)[len(known) :]


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


def _lm_params() -> gtsam.LevenbergMarquardtParams:
    """Settings of Levenberg-Marquardt."""
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(_RELATIVE_TOLERANCE)
    return params
