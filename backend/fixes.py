"""Fixes that a graph must not take: those that lie farther off than dead reckoning and the other fixes can be wrong.

About dead reckoning the planar motions of the world by which it drifts are sums of independent steps, so what fixes say
of it is jointly Gaussian, as with loop closures. Each fix is foretold by all others; the worst goes first, for a wrong
one drags what is foretold of its neighbours. How much worse than modelled dead reckoning is nobody knows yet: it may be
as bad as it is ever believed to be. What is left out is wildly wrong.
"""

import numpy as np
from scipy.special import chdtri

from backend.arrays import FloatArray, IntArray
from backend.problem import Problem

FIX_BEYOND_DRIFT = "it lies farther from dead reckoning and the other fixes than they can be wrong"


def harmful_fixes(problem: Problem, scale: float, probability: float) -> dict[int, str]:
    """Find fixes that the graph should not take.

    Parameters
    ----------
    problem : Problem
        The graph.
    scale : float
        Dead reckoning is at most this much worse than said.
    probability : float
        Share of true fixes that lie as near as is allowed to where the others foretell them [1].

    Returns
    -------
    reasons : dict of int to str
        Why, by the fix's position.
    """
    kept, limit = np.arange(len(problem.fixes)), float(chdtri(2, 1.0 - probability))
    offset, covariance = _foretold(problem, scale)
    while kept.size:
        distances = _left_out_distances(offset[kept], covariance[kept][:, kept])
        worst = int(np.argmax(distances))
        if distances[worst] <= limit:
            break
        kept = np.delete(kept, worst)
    return {int(fix): FIX_BEYOND_DRIFT for fix in np.setdiff1d(np.arange(len(problem.fixes)), kept)}


def _foretold(problem: Problem, scale: float) -> tuple[FloatArray, FloatArray]:
    """How far fixes lie from dead reckoning, (F, 2), and the covariance of that, (F, F, 2, 2)."""
    anchor: IntArray = np.array([fix.anchor for fix in problem.fixes], dtype=np.int64)
    seen = np.array([[fix.east, fix.north] for fix in problem.fixes]).reshape(-1, 2)
    T, sigmas = problem.T_world_anchor_dr, problem.first_pose_sigmas
    swing = _swing(T[anchor, :2, 3] - T[:, :2, 3].mean(axis=0))
    drift = problem.compared(T, slice(0)).drift[np.minimum(anchor[:, None], anchor)]
    covariance = scale**2 * swing[:, None] @ drift @ swing.swapaxes(1, 2)[None]
    first = _swing(T[anchor, :2, 3] - T[0, :2, 3])  # the whole track turns and shifts with its first pose
    covariance += (first * sigmas[2:5] ** 2)[:, None] @ first.swapaxes(1, 2)[None]
    each = np.arange(len(anchor))
    covariance[each, each] += np.array([fix.sigma**2 * np.eye(2) for fix in problem.fixes]).reshape(-1, 2, 2)
    return seen - T[anchor, :2, 3], covariance


def _swing(arm: FloatArray) -> FloatArray:
    """How yaw, x and y of a motion of the world move what lies at an arm from its centre, (F, 2, 3)."""
    swing = np.zeros((len(arm), 2, 3))
    swing[:, 0, 0], swing[:, 1, 0] = -arm[:, 1], arm[:, 0]
    swing[:, 0, 1] = swing[:, 1, 2] = 1.0
    return swing


def _left_out_distances(offset: FloatArray, covariance: FloatArray) -> FloatArray:
    """Squared Mahalanobis distance of each from where all others foretell it."""
    n = len(offset)
    information = np.linalg.inv(covariance.transpose(0, 2, 1, 3).reshape(2 * n, 2 * n))
    pull = (information @ offset.ravel()).reshape(n, 2)
    each = np.arange(n)
    own = information.reshape(n, 2, n, 2)[each, :, each]
    return np.asarray(np.einsum("ai,ai->a", pull, np.linalg.solve(own, pull[..., None])[..., 0]))
