"""Descent from the coarse image to the fine one, part by part, by bounded steps that lower the cost."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import map_coordinates

from frontend.reconstruction.image_cost import Estimate, ImageCost, Part

_N_HALVINGS = 10  # of a step, before it is given up


def descend(cost: ImageCost, start: Estimate, is_over: Callable[[], bool]) -> tuple[Estimate, list[float]]:
    """Lower the cost part by part, as in expectation maximisation.

    Parameters
    ----------
    cost : ImageCost
        What is to be lowered.
    start : Estimate
        Where to start.
    is_over : callable
        Says that time is up.

    Returns
    -------
    estimate : Estimate
        The best so far, whenever it stops.
    costs : list of float
        The cost before the first iteration and after each; none is higher than the one before.
    """
    config, estimate, costs = cost.config, start, [cost(start)]
    steps: dict[Part, float] = {"reflectivity": 1.0, "beam": 1.0, "height": 0.5}
    for _ in range(config.n_iterations):
        value = costs[-1]
        for part in steps:
            if is_over():
                return estimate, costs
            estimate, value, steps[part] = _advance(cost, (estimate, value), part, steps[part])
        costs.append(value)
        if costs[-2] - value <= config.tolerance * abs(costs[-2]):
            break
    return estimate, costs


def stop_watch(deadline: float) -> Callable[[], bool]:
    """Start a clock.

    Parameters
    ----------
    deadline : float
        Time from now [s].

    Returns
    -------
    is_over : callable
        Says whether that time has passed.
    """
    end = time.monotonic() + deadline
    return lambda: time.monotonic() >= end


def upsampled(estimate: Estimate, cost: ImageCost) -> Estimate:
    """An estimate at twice the resolution.

    Parameters
    ----------
    estimate : Estimate
        At the coarse resolution.
    cost : ImageCost
        Of the fine image.

    Returns
    -------
    fine : Estimate
        Interpolated between the middles of the coarse pixels.
    """
    n_y, n_x = cost.image.level.shape[1:]
    places = np.meshgrid(0.5 * np.arange(n_y) - 0.25, 0.5 * np.arange(n_x) - 0.25, indexing="ij")
    maps = (estimate.height, estimate.reflectivity)
    height, reflectivity = (np.stack([map_coordinates(s, places, order=1, mode="nearest") for s in m]) for m in maps)
    return Estimate(height, reflectivity, estimate.beam)


def _advance(cost: ImageCost, now: tuple[Estimate, float], part: Part, step: float) -> tuple[Estimate, float, float]:
    """One bounded step that lowers the cost, or none; and the step to try next."""
    estimate, value = now
    direction = cost.direction(estimate, part)
    bound = cost.config.largest_step * cost.image.spacing[1] if part == "height" else 1.0
    step = min(step, bound / max(float(np.abs(direction).max()), 1e-12))
    for _ in range(_N_HALVINGS):
        trial = replace(estimate, **{part: getattr(estimate, part) + step * direction})
        lower = cost(trial)
        if lower < value:
            return trial, lower, min(1.5 * step, 2.0)
        step *= 0.5
    return estimate, value, step
