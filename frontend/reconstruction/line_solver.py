"""Gauss-Newton over lines: bounded steps, a cost that only falls, a meaningful state whenever it is stopped."""

from dataclasses import dataclass
from time import monotonic

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array, diags_array

from frontend.arrays import FloatArray
from frontend.reconstruction.line_image import LineImage
from frontend.reconstruction.line_model import LinearModel, LineModel
from frontend.reconstruction.line_prior import LinePrior, upper_bands


class LineSolverConfig(BaseModel):
    """When to stop."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    n_steps: int = Field(default=4, ge=1, description="Gauss-Newton steps [1] a registration, at most.")
    n_products: int = Field(default=15, ge=1, description="Conjugate-gradient products a step [1], at most.")
    tolerance: float = Field(
        default=0.05, gt=0, lt=1, description="Residual of a linear solve, as a share of its start [1]."
    )
    improvement: float = Field(
        default=1e-3, gt=0, description="Stop when a step lowers the cost by less than this share [1]: noise."
    )
    step_height: float = Field(
        default=0.75, gt=0, description="Largest change of a relief in one step [cells]; the slopes are not linear."
    )
    time_limit: float = Field(
        default=3600.0, gt=0, description="Wall time a window [s] after which the state reached is the result."
    )


@dataclass(frozen=True)
class LineProblem:
    """A cost: half the squared residuals of the image and of the belief.

    Parameters
    ----------
    model : LineModel
        Unknowns to amplitudes.
    image : LineImage
        Measured amplitudes and their weights.
    prior : LinePrior
        The belief.
    spacing : float
        Size of a cell [m]; steps are bounded in it.
    """

    model: LineModel
    image: LineImage
    prior: LinePrior
    spacing: float

    def cost(self, x: FloatArray, linear: LinearModel) -> float:
        """Half the squared residuals.

        Parameters
        ----------
        x : ndarray, shape (2 N + K,)
            Unknowns.
        linear : LinearModel
            The model there.

        Returns
        -------
        cost : float
            Negative logarithm of the posterior, but for a constant.
        """
        seen = self.image.weight.ravel() * (linear.amplitude - self.image.amplitude.ravel()) ** 2
        return 0.5 * float(seen.sum() + ((self.prior.matrix @ x + self.prior.offset) ** 2).sum())

    def gradient(self, x: FloatArray, linear: LinearModel) -> FloatArray:
        """Derivative of the cost.

        Parameters
        ----------
        x : ndarray, shape (2 N + K,)
            Unknowns.
        linear : LinearModel
            The model there.

        Returns
        -------
        gradient : ndarray, shape (2 N + K,)
            Exact for frozen neighbours.
        """
        residual = self.image.weight.ravel() * (linear.amplitude - self.image.amplitude.ravel())
        return np.asarray(linear.pull(residual) + self.prior.matrix.T @ (self.prior.matrix @ x + self.prior.offset))

    def multiply(self, x: FloatArray, linear: LinearModel) -> FloatArray:
        """Gauss-Newton curvature times a vector.

        Parameters
        ----------
        x : ndarray, shape (2 N + K,)
            The vector.
        linear : LinearModel
            The model about the point of linearisation.

        Returns
        -------
        product : ndarray, shape (2 N + K,)
            Symmetric, positive definite.
        """
        seen = linear.pull(self.image.weight.ravel() * linear.push(x))
        return np.asarray(seen + self.prior.matrix.T @ (self.prior.matrix @ x))


class Preconditioner:
    """Every line solved by itself: its relief, and its reflectivity, with what it shares with others held fixed.

    Parameters
    ----------
    problem : LineProblem
        The cost.
    linear : LinearModel
        The model about the point of linearisation.
    """

    def __init__(self, problem: LineProblem, linear: LinearModel) -> None:
        weight = problem.image.weight.ravel()
        by_slope = diags_array(np.sqrt(weight) * linear.by_across) @ problem.model.across
        by_slope = csr_array(by_slope + diags_array(np.sqrt(weight) * linear.by_relief))
        bright = weight * linear.amplitude**2
        relief = problem.prior.banded[0] + upper_bands(csr_array(by_slope.T @ by_slope))
        reflectivity = problem.prior.banded[1].copy()
        lit = ~problem.image.is_shadow.ravel()
        reflectivity[2] += np.where(lit, bright, 0.0)
        self._factors = [cholesky_banded(bands) for bands in (relief, reflectivity)]
        self._beam = np.asarray(problem.prior.beam + problem.model.beam.power(2).T @ bright)

    def apply(self, x: FloatArray) -> FloatArray:
        """Solve approximately.

        Parameters
        ----------
        x : ndarray, shape (2 N + K,)
            Right-hand side.

        Returns
        -------
        solved : ndarray, shape (2 N + K,)
            Approximate inverse of the curvature times x.
        """
        n = self._factors[0].shape[1]
        parts = [cho_solve_banded((f, False), x[k * n : (k + 1) * n]) for k, f in enumerate(self._factors)]
        return np.concatenate([*parts, x[2 * n :] / self._beam])


@dataclass(frozen=True)
class LineSolution:
    """Where the solver stopped.

    Parameters
    ----------
    x : ndarray, shape (2 N + K,)
        Unknowns.
    linear : LinearModel
        The model there.
    costs : tuple of float
        Cost at the start and after every accepted step; never rising.
    """

    x: FloatArray
    linear: LinearModel
    costs: tuple[float, ...]


def minimise_lines(problem: LineProblem, x: FloatArray, config: LineSolverConfig, deadline: float) -> LineSolution:
    """Make a cost small.

    Parameters
    ----------
    problem : LineProblem
        The cost.
    x : ndarray, shape (2 N + K,)
        Where to start.
    config : LineSolverConfig
        When to stop.
    deadline : float
        Reading of the monotonic clock after which no further step is begun [s]; infinite for none.

    Returns
    -------
    solution : LineSolution
        The best state seen; never worse than the start.
    """
    linear = problem.model.linearise(x)
    costs = [problem.cost(x, linear)]
    for _ in range(config.n_steps):
        if monotonic() > deadline:
            break
        step = -solve_lines(problem, linear, problem.gradient(x, linear), config)
        largest = float(np.abs(step[: problem.model.n_cells]).max())
        step *= min(1.0, config.step_height * problem.spacing / max(largest, 1e-12))
        found = _backtrack(problem, x, step, costs[-1])
        if found is None:
            break
        x, linear, cost = found
        costs.append(cost)
        if costs[-2] - cost < config.improvement * abs(costs[-2]):
            break
    return LineSolution(x, linear, tuple(costs))


def solve_lines(problem: LineProblem, linear: LinearModel, right: FloatArray, config: LineSolverConfig) -> FloatArray:
    """Solve the normal equations by preconditioned conjugate gradients.

    Parameters
    ----------
    problem : LineProblem
        The cost.
    linear : LinearModel
        The model about the point of linearisation.
    right : ndarray, shape (2 N + K,)
        Right-hand side.
    config : LineSolverConfig
        When to stop.

    Returns
    -------
    x : ndarray, shape (2 N + K,)
        An approximate solution; a descent direction wherever it stops.
    """
    preconditioner = Preconditioner(problem, linear)
    x, residual = np.zeros_like(right), right.copy()
    z = preconditioner.apply(residual)
    direction, energy = z.copy(), float((residual * z).sum())
    start = energy
    for _ in range(config.n_products if start > 0 else 0):
        product = problem.multiply(direction, linear)
        length = energy / float((direction * product).sum())
        x += length * direction
        residual -= length * product
        z = preconditioner.apply(residual)
        energy, before = float((residual * z).sum()), energy
        if energy <= config.tolerance**2 * start:
            break
        direction = z + (energy / before) * direction
    return x


def draw_lines(
    problem: LineProblem, linear: LinearModel, config: LineSolverConfig, rng: np.random.Generator
) -> FloatArray:
    """Draw a deviation from the posterior, to first order.

    Parameters
    ----------
    problem : LineProblem
        The cost.
    linear : LinearModel
        The model about its minimum.
    config : LineSolverConfig
        Of the linear solve.
    rng : Generator
        Randomness.

    Returns
    -------
    x : ndarray, shape (2 N + K,)
        A draw of zero mean whose covariance is the inverse of the curvature, as well as it is solved.
    """
    weight = np.sqrt(problem.image.weight.ravel())
    right = linear.pull(weight * rng.standard_normal(weight.size))
    right = right + problem.prior.matrix.T @ rng.standard_normal(problem.prior.offset.size)
    return solve_lines(problem, linear, right, config.model_copy(update={"n_products": 4 * config.n_products}))


def _backtrack(
    problem: LineProblem, x: FloatArray, step: FloatArray, cost: float
) -> tuple[FloatArray, LinearModel, float] | None:
    """The longest of a few shortened steps that lowers the cost."""
    for _ in range(5):
        trial = x + step
        linear = problem.model.linearise(trial)
        after = problem.cost(trial, linear)
        if np.isfinite(after) and after < cost:
            return trial, linear, after
        step = step * 0.4
    return None
