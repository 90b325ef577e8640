"""Gauss-Newton with preconditioned conjugate gradients: few evaluations, bounded steps, a cost that only falls."""

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.reconstruction.posterior import NormalEquations, Posterior
from frontend.reconstruction.priors import from_cosine, to_cosine


class SolverConfig(BaseModel):
    """When to stop."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    n_steps: int = Field(
        default=3, ge=1, description="Gauss-Newton steps [1] at each resolution, at most; more fit speckle."
    )
    n_products: int = Field(
        default=10, ge=1, description="Conjugate-gradient products a step [1], at most; the next step mends the rest."
    )
    tolerance: float = Field(
        default=0.05,
        gt=0,
        lt=1,
        description="Residual of a linear solve, as a share of its start [1]; the cost is not quadratic.",
    )
    improvement: float = Field(
        default=1e-3, gt=0, description="Stop when a step lowers the cost by less than this share [1]: noise."
    )
    step_height: float = Field(
        default=0.75, gt=0, description="Largest change of a height in one step [cells]; visibility changes."
    )


@dataclass(frozen=True)
class Solution:
    """Where the solver stopped.

    Parameters
    ----------
    x : ndarray, shape (2, n_y, n_x)
        Heights [m] and log-reflectivities.
    mu : ndarray, shape (P, 2, B)
        Expected intensities there.
    costs : tuple of float
        Cost at the start and after every accepted step; never rising.
    """

    x: FloatArray
    mu: FloatArray
    costs: tuple[float, ...]


def minimise(posterior: Posterior, x: FloatArray, config: SolverConfig) -> Solution:
    """Make the cost of a posterior small.

    Parameters
    ----------
    posterior : Posterior
        The cost.
    x : ndarray, shape (2, n_y, n_x)
        Where to start.
    config : SolverConfig
        When to stop.

    Returns
    -------
    solution : Solution
        The best state seen; never worse than the start.
    """
    mu = posterior.predict(x)
    costs = [posterior.cost(x, mu)]
    for _ in range(config.n_steps):
        equations = posterior.curvature(x, mu)
        step = -from_cosine(solve(equations, to_cosine(posterior.gradient(x, mu)), config))
        step *= min(1.0, config.step_height * posterior.raster.spacing / max(float(np.abs(step[0]).max()), 1e-12))
        found = _backtrack(posterior, x, step, costs[-1])
        if found is None:
            break
        x, mu, cost = found
        costs.append(cost)
        if costs[-2] - cost < config.improvement * abs(costs[-2]):
            break
    return Solution(x, mu, tuple(costs))


def solve(equations: NormalEquations, right: FloatArray, config: SolverConfig) -> FloatArray:
    """Solve the normal equations by preconditioned conjugate gradients.

    Parameters
    ----------
    equations : NormalEquations
        Curvature and preconditioner.
    right : ndarray, shape (2, n_y, n_x)
        Cosine coefficients of the right-hand side.
    config : SolverConfig
        When to stop.

    Returns
    -------
    x : ndarray, shape (2, n_y, n_x)
        Cosine coefficients of an approximate solution; a descent direction wherever it stops.
    """
    x, residual = np.zeros_like(right), right.copy()
    z = equations.precondition(residual)
    direction, energy = z.copy(), float((residual * z).sum())
    start = energy
    for _ in range(config.n_products if start > 0 else 0):
        product = equations.multiply(direction)
        length = energy / float((direction * product).sum())
        x += length * direction
        residual -= length * product
        z = equations.precondition(residual)
        energy, before = float((residual * z).sum()), energy
        if energy <= config.tolerance**2 * start:
            break
        direction = z + (energy / before) * direction
    return x


def _backtrack(
    posterior: Posterior, x: FloatArray, step: FloatArray, cost: float
) -> tuple[FloatArray, FloatArray, float] | None:
    """The longest of a few shortened steps that lowers the cost; visibility may make the full one too long."""
    for _ in range(5):
        trial = x + step
        mu = posterior.predict(trial)
        after = posterior.cost(trial, mu)
        if np.isfinite(after) and after < cost:
            return trial, mu, after
        step = step * 0.4
    return None
