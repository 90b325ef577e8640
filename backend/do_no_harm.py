"""Do no harm: which loop closures should be withdrawn after the graph is solved, and why."""

from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.stats import chi2

from backend.arrays import FloatArray, IntArray
from backend.innovations import Innovations
from backend.poses import RelativePose, invert, logarithm, tangent_covariance
from backend.solution import PoseGraphSolution, Withdrawal


class DoNoHarmConfig(BaseModel):
    """When a loop closure is withdrawn although the optimiser kept it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    residual_probability: float = Field(
        default=0.9999,
        gt=0,
        lt=1,
        description="Share of true closures [1] whose residual is smaller than what is allowed; high: there are many.",
    )
    max_correction: float = Field(
        default=3.0,
        gt=0,
        description="Largest root mean square of what closures correct [standard deviations]; by chance it is 1.",
    )


def harmful_closures(
    solution: PoseGraphSolution,
    closures: Sequence[RelativePose],
    compared: Innovations,
    config: DoNoHarmConfig | None = None,
) -> dict[int, str]:
    """Find closures that hold the graph and should not.

    Parameters
    ----------
    solution : PoseGraphSolution
        The solved graph.
    closures : sequence of RelativePose, length C
        Its closures.
    compared : Innovations
        The same closures against dead reckoning and its covariance.
    config : DoNoHarmConfig, optional
        What is allowed.

    Returns
    -------
    reasons : dict of int to str
        Why, by the closure's position, without a comma: the one with the worst residual, as the others may be better
        off without it; or all of them where together they correct more than dead reckoning can be wrong.
    """
    config = config or DoNoHarmConfig()
    holding = np.flatnonzero(solution.is_inlier)
    if not holding.size:
        return {}
    distances = residual_distances(solution.T_world_anchor, [closures[int(closure)] for closure in holding])
    worst = int(np.argmax(distances))
    if distances[worst] > chi2.ppf(config.residual_probability, 6):
        return {int(holding[worst]): str(Withdrawal.RESIDUAL)}
    if _correction(compared[holding], solution.odometry_scale) > config.max_correction:
        return {int(closure): str(Withdrawal.BEYOND_DRIFT) for closure in holding}
    return {}


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


def _correction(closures: Innovations, scale: float) -> float:
    """Root mean square of what closures say against dead reckoning, over what it may be wrong by."""
    residuals = closures.residuals.ravel()
    return float(np.sqrt(residuals @ np.linalg.solve(closures.joint_covariance(scale), residuals) / residuals.size))
