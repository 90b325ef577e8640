"""Descent to the least squares of a graph: Gauss's and Newton's steps, and damped ones where those go uphill."""

from dataclasses import dataclass

import gtsam

_MAX_STEPS = 20  # of Gauss and Newton; whatever takes longer is left to Levenberg and Marquardt
_SETTLED = 1e-4  # error left to gain before the last step [1]; that step leaves a hundredth of a sigma at most
_RELATIVE_TOLERANCE = 1e-9  # GTSAM's own 1e-5 stops before the minimum on long chains


@dataclass(frozen=True)
class _Step:
    """Where a step leads, the error there and what the linear model had foretold to gain."""

    values: gtsam.Values
    error: float
    foretold: float


def descend(graph: gtsam.NonlinearFactorGraph, start: gtsam.Values) -> gtsam.Values:
    """Go down until the linear model says that next to nothing is left to gain.

    Parameters
    ----------
    graph : gtsam.NonlinearFactorGraph
        What is minimised: half the sum of squared normalised residuals.
    start : gtsam.Values
        Where to start.

    Returns
    -------
    values : gtsam.Values
        The minimum.

    Notes
    -----
    Undamped steps converge as fast as those of Levenberg and Marquardt and take two thirds of their time, for no graph
    is built anew for the damping, and as each foretells its gain none is made only to see that nothing is left.
    """
    ordering, values, error = gtsam.Ordering.ColamdNonlinearFactorGraph(graph), start, graph.error(start)
    for _ in range(_MAX_STEPS):
        step = _step(graph, values, ordering, error)
        if step is None:
            break
        is_settled = step.foretold <= _SETTLED
        if step.error <= error:
            values, error = step.values, step.error
        elif not is_settled:
            break
        if is_settled:
            return values
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(_RELATIVE_TOLERANCE)
    return gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()


def _step(
    graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, ordering: gtsam.Ordering, error: float
) -> _Step | None:
    """A step of Gauss and Newton; none where the graph is too flat to solve without damping."""
    linear = graph.linearize(values)
    try:
        delta = linear.optimize(ordering)
    except RuntimeError:
        return None
    reached = values.retract(delta)
    return _Step(reached, graph.error(reached), error - linear.error(delta))
