"""Do no harm: which loop closures should be withdrawn after the graph is solved, and why."""

from collections.abc import Callable, Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.special import chdtri

from backend.arrays import FloatArray
from backend.innovations import Innovations
from backend.optimiser import residual_distances
from backend.poses import invert
from backend.problem import Estimate, Problem
from backend.solution import Withdrawal
from backend.triangular import factorise

__all__ = ["DoNoHarmConfig", "MapAgreement", "harmful_closures", "residual_distances"]

MapAgreement = Callable[[int, int, FloatArray], float]

_MAX_COMPARED = 300  # closures whose correction is held against dead reckoning together; more tell the same
_SHARE_AT_ONCE = 4  # of the closures whose maps disagree, one in so many goes at a time


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
    min_agreement: float = Field(
        default=2.0,
        description="Least agreement of two maps where the graph lays them [standard deviations above chance]; it must "
        "also be no less than where dead reckoning laid them.",
    )


def harmful_closures(
    estimate: Estimate, problem: Problem, agreement: MapAgreement | None, config: DoNoHarmConfig | None = None
) -> dict[int, str]:
    """Find closures that hold the graph and should not.

    Parameters
    ----------
    estimate : Estimate
        The solved graph.
    problem : Problem
        What it was solved for.
    agreement : callable or None
        How well the maps of two anchors agree at a relative pose of their bodies, in standard deviations above chance;
        NaN where they do not overlap. None where nobody knows.
    config : DoNoHarmConfig, optional
        What is allowed.

    Returns
    -------
    reasons : dict of int to str
        Why, by the closure's position, without a comma: the one with the worst residual, as the others may be better
        off without it; or all of them where together they correct more than dead reckoning can be wrong; or those whose
        maps disagree, the worst of them.
    """
    config = config or DoNoHarmConfig()
    if not estimate.n_holding:
        return {}
    distances = residual_distances(estimate.T_world_anchor, problem.chosen(estimate.holding))
    worst = int(np.argmax(distances))
    if distances[worst] > chdtri(6, 1.0 - config.residual_probability):
        return {int(estimate.holding[worst]): str(Withdrawal.RESIDUAL)}
    compared = problem.compared(estimate.T_world_anchor, estimate.holding)
    if _correction(compared, estimate.odometry_scale) > config.max_correction:
        return {int(closure): str(Withdrawal.BEYOND_DRIFT) for closure in estimate.holding}
    return {} if agreement is None else _disagreeing(estimate, problem, agreement, config)


def _disagreeing(
    estimate: Estimate, problem: Problem, agreement: MapAgreement, config: DoNoHarmConfig
) -> dict[int, str]:
    """Those whose maps agree worst: too little, or less than at the dead-reckoned poses."""
    ends = [(closure.target, closure.source) for closure in problem.chosen(estimate.holding)]
    after = _agreements(estimate.T_world_anchor, ends, agreement)
    before = _agreements(problem.T_world_anchor_dr, ends, agreement)
    lacking = np.fmax(config.min_agreement, before) - after
    bad = np.flatnonzero(lacking > 0.0)
    # only the worst: the others may be better off without them
    worst = bad[np.argsort(-lacking[bad], kind="stable")][: 1 + len(bad) // _SHARE_AT_ONCE]
    return {int(estimate.holding[k]): str(Withdrawal.MAPS_DISAGREE) for k in worst}


def _agreements(T_world_anchor: FloatArray, ends: Sequence[tuple[int, int]], agreement: MapAgreement) -> FloatArray:
    """How well maps agree where poses lay them."""
    relative = [invert(T_world_anchor[target]) @ T_world_anchor[source] for target, source in ends]
    return np.array([agreement(*pair, T) for pair, T in zip(ends, relative, strict=True)])


def _correction(closures: Innovations, scale: float) -> float:
    """Root mean square of what closures say against dead reckoning, over what it may be wrong by."""
    few = closures[np.linspace(0, len(closures) - 1, min(_MAX_COMPARED, len(closures))).astype(np.int64)]
    _, whitened = factorise(few.joint_covariance(scale), few.residuals.reshape(1, -1))
    return float(np.sqrt((whitened**2).mean()))
