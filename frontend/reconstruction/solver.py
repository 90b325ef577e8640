"""Gauss-Newton with preconditioned conjugate gradients: few evaluations, bounded steps, a cost that only falls."""

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.reconstruction.normal_equations import NormalEquations
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.unknowns import Unknowns

_SHORTER = 0.4


class SolverConfig(BaseModel):
    """When to stop."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    n_steps: int = Field(default=3, ge=1, description="Gauss-Newton steps [1] at each resolution, at most.")
    n_products: int = Field(
        default=12, ge=1, description="Conjugate-gradient products a step [1], at most; the next step mends the rest."
    )
    tolerance: float = Field(
        default=0.05,
        gt=0,
        lt=1,
        description="Residual of a linear solve, as a share of its start [1]; the cost is not quadratic.",
    )
    doubt: float = Field(
        default=2.0,
        gt=0,
        description="Standard deviations [1] by which lines kept aside must contradict a step for it to be given up.",
    )
    improvement: float = Field(
        default=1e-3, gt=0, description="Stop when a step lowers the cost by less than this share [1]: noise."
    )
    step_height: float = Field(
        default=0.75, gt=0, description="Largest change of a height in one step [cells]; visibility changes."
    )
    deadline: float = Field(
        default=3600.0, gt=0, description="Time a window may take [s]; what is known by then is given back."
    )


@dataclass(frozen=True)
class Solution:
    """Where the solver stopped.

    Parameters
    ----------
    x : Unknowns
        As rasters.
    mu : ndarray, shape (P, 2, B)
        Expected intensities there.
    costs : tuple of float
        Cost at the start and after every accepted step; never rising.
    """

    x: Unknowns
    mu: FloatArray
    costs: tuple[float, ...]


class State(NamedTuple):
    """A point, what is expected there, and its cost."""

    x: Unknowns
    mu: FloatArray
    cost: float


def minimise(posterior: Posterior, x: Unknowns, config: SolverConfig, until: float = np.inf) -> Solution:
    """Make the cost of a posterior small, as long as the lines kept aside do not speak against it.

    Parameters
    ----------
    posterior : Posterior
        The cost.
    x : Unknowns
        Where to start.
    config : SolverConfig
        When to stop.
    until : float
        Time of the monotonic clock at which to stop after the step under way [s].

    Returns
    -------
    solution : Solution
        The best state seen; never worse than the start.
    """
    mu = posterior.predict(x)
    costs, aside = [posterior.cost(x, mu)], posterior.held_out_costs(mu)
    for _ in range(config.n_steps):
        if time.monotonic() >= until:
            break
        found = _backtrack(posterior, State(x, mu, costs[-1]), _step(posterior, x, mu, config))
        if found is None or _speak_against(after := posterior.held_out_costs(found.mu), aside, config.doubt):
            break
        (x, mu, cost), aside = found, after
        costs.append(cost)
        if costs[-2] - cost < config.improvement * abs(costs[-2]):
            break
    return Solution(x, mu, tuple(costs))


def _speak_against(after: FloatArray, before: FloatArray, doubt: float) -> bool:
    """Whether lines kept aside have become dearer by more than chance would make them, line by line."""
    dearer = after - before
    return bool(dearer.sum() > doubt * np.sqrt((dearer**2).sum()))


def _step(posterior: Posterior, x: Unknowns, mu: FloatArray, config: SolverConfig) -> Unknowns:
    """A Gauss-Newton step, shortened where it would change heights by too much."""
    gradient = posterior.gradient(x, mu).to_coordinates()
    step = solve(posterior.curvature(x, mu), gradient, config).from_coordinates()
    highest = float(np.abs(step.background + step.objects).max())
    return step.times(-min(1.0, config.step_height * posterior.raster.spacing / max(highest, 1e-12)))


def solve(equations: NormalEquations, right: Unknowns, config: SolverConfig) -> Unknowns:
    """Solve the normal equations by preconditioned conjugate gradients.

    Parameters
    ----------
    equations : NormalEquations
        Curvature and preconditioner.
    right : Unknowns
        The right-hand side, as coordinates.
    config : SolverConfig
        When to stop.

    Returns
    -------
    x : Unknowns
        An approximate solution, as coordinates; a descent direction wherever it stops.
    """
    residual = right.flat()
    x = np.zeros_like(residual)
    direction = z = equations.precondition_flat(residual)
    start = energy = float(np.einsum("i,i", residual, z))  # not by BLAS, whose sums depend on its threads
    for _ in range(config.n_products if start > 0 else 0):
        product = equations.multiply_flat(direction)
        length = energy / float(np.einsum("i,i", direction, product))
        x += length * direction
        residual -= length * product
        z = equations.precondition_flat(residual)
        energy, before = float(np.einsum("i,i", residual, z)), energy
        if energy <= config.tolerance**2 * start:
            break
        direction = z + (energy / before) * direction
    return right.filled(x)


def _backtrack(posterior: Posterior, now: State, step: Unknowns) -> State | None:
    """The longest of a few shortened steps that lowers the cost; visibility may make the full one too long."""
    for _ in range(5):
        x = now.x.plus(step)
        mu = posterior.predict(x)
        cost = posterior.cost(x, mu)
        if np.isfinite(cost) and cost < now.cost:
            return State(x, mu, cost)
        step = step.times(_SHORTER)
    return None
