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


def descend(graph: gtsam.NonlinearFactorGraph, start: gtsam.Values, share: float) -> gtsam.Values:
    """Go down until the linear model says that next to nothing is left to gain.

    Parameters
    ----------
    graph : gtsam.NonlinearFactorGraph
        What is minimised: half the sum of squared normalised residuals.
    start : gtsam.Values
        Where to start.
    share : float
        The last step may gain up to this share of the error [1]; zero goes to the minimum.

    Returns
    -------
    values : gtsam.Values
        The minimum, or near it.

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
        is_settled = step.foretold <= max(_SETTLED, share * step.error)
        if step.error <= error:
            values, error = step.values, step.error
        elif not is_settled:
            break
        if is_settled:
            return values
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(_RELATIVE_TOLERANCE)
    return gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()


def descend_once(graph: gtsam.NonlinearFactorGraph, start: gtsam.Values) -> gtsam.Values:
    """Go one step down.

    Parameters
    ----------
    graph : gtsam.NonlinearFactorGraph
        What is minimised.
    start : gtsam.Values
        Where to start.

    Returns
    -------
    values : gtsam.Values
        After a step of Gauss and Newton, or a damped one if that went uphill.
    """
    error = graph.error(start)
    step = _step(graph, start, gtsam.Ordering.ColamdNonlinearFactorGraph(graph), error)
    if step is not None and step.error <= error:
        return step.values
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(1)
    return gtsam.LevenbergMarquardtOptimizer(graph, start, params).optimize()


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
