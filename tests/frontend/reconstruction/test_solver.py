"""Gauss-Newton and conjugate gradients: quadratic problems are solved, others never get worse."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.priors import from_cosine, to_cosine
from frontend.reconstruction.solver import SolverConfig, minimise, solve
from tests.frontend.reconstruction.small_window import make_posterior
from tests.frontend.reconstruction.test_posterior import without_echoes

THOROUGH = SolverConfig(n_steps=8, n_products=300, tolerance=1e-9, improvement=1e-12, step_height=100.0)


def exact_heights(posterior: Posterior) -> np.ndarray:
    """Minimiser of altimeter and prior, from dense normal equations."""
    n = posterior.raster.n_cells
    identity = np.eye(n).reshape(n, *posterior.raster.shape)
    precision = from_cosine(posterior.prior.height * to_cosine(identity)).reshape(n, n)
    weights, altimeter = posterior.altimeter.weights.toarray(), posterior.altimeter
    miss = altimeter.height - weights @ posterior.expected[0].ravel()
    normal = precision + weights.T @ (altimeter.precision[:, None] * weights)
    step = np.linalg.solve(normal, weights.T @ (altimeter.precision * miss))
    return np.asarray(posterior.expected[0] + step.reshape(posterior.raster.shape))


def test_a_quadratic_cost_is_solved() -> None:
    posterior, x = make_posterior()
    posterior = without_echoes(posterior)
    solution = minimise(posterior, x, THOROUGH)
    np.testing.assert_allclose(solution.x[0], exact_heights(posterior), atol=1e-6)
    np.testing.assert_allclose(solution.x[1], 0.0, atol=1e-8)


def test_conjugate_gradients_solve_the_normal_equations() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    truth = np.random.default_rng(1).standard_normal(x.shape) / np.sqrt(posterior.prior.precision)
    found = solve(equations, equations.multiply(truth), THOROUGH)
    np.testing.assert_allclose(from_cosine(found), from_cosine(truth), atol=1e-5)


def test_wherever_conjugate_gradients_stop_the_step_goes_downhill() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    gradient = to_cosine(posterior.gradient(x, posterior.predict(x)))
    for n_products in (1, 2, 5, 20):
        step = solve(equations, gradient, SolverConfig(n_products=n_products))
        assert (step * gradient).sum() > 0


def test_nothing_to_solve_is_solved_by_nothing() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    np.testing.assert_array_equal(solve(equations, np.zeros_like(x), SolverConfig()), 0.0)


def test_the_cost_never_rises_and_is_that_of_the_state_given_back() -> None:
    posterior, x = make_posterior(relief=0.6)
    solution = minimise(posterior, posterior.expected, replace_steps(20))
    assert len(solution.costs) > 3
    assert (np.diff(solution.costs) < 0).all()
    assert solution.costs[0] == posterior.cost(posterior.expected, posterior.predict(posterior.expected))
    np.testing.assert_array_equal(solution.mu, posterior.predict(solution.x))
    assert solution.costs[-1] == posterior.cost(solution.x, solution.mu)
    # the truth is not better by more than what noise adds: one half a degree of freedom, 720 bins
    assert solution.costs[-1] < posterior.cost(x, posterior.predict(x))


def replace_steps(n_steps: int) -> SolverConfig:
    return SolverConfig(n_steps=n_steps, improvement=1e-9)


def test_echoes_bring_the_surface_nearer_to_the_truth() -> None:
    posterior, x = make_posterior(looks=50.0, relief=0.3)
    solution = minimise(posterior, posterior.expected, replace_steps(20))
    y = posterior.raster.origin[1] + posterior.raster.spacing * np.arange(posterior.raster.n_y)
    side = (np.abs(y) > 10) & (np.abs(y) < 28)  # under the track slopes hardly show, far out lines end
    found, truth = (part[0][side][:, 8:22] for part in (solution.x, x))
    # six lines 3 m apart, waves of 10 m: every second cell is interpolated
    assert np.corrcoef(found.ravel(), truth.ravel())[0, 1] > 0.6
    assert np.std(found - truth) < 0.8 * np.std(truth)


def test_steps_are_bounded_in_cells() -> None:
    posterior, _ = make_posterior()
    away = replace(without_echoes(posterior), expected=posterior.expected + np.array([50.0, 0.0])[:, None, None])
    solution = minimise(away, posterior.expected, SolverConfig(n_steps=1, n_products=100, step_height=0.75))
    assert np.abs(solution.x[0] - posterior.expected[0]).max() == pytest.approx(0.75)


def test_the_number_of_steps_is_kept() -> None:
    posterior, _ = make_posterior()
    assert len(minimise(posterior, posterior.expected, replace_steps(2)).costs) <= 3


def test_the_best_state_is_not_left() -> None:
    posterior, _ = make_posterior()
    posterior = without_echoes(posterior)
    exact = np.stack([exact_heights(posterior), np.zeros(posterior.raster.shape)])
    solution = minimise(posterior, exact, SolverConfig())
    np.testing.assert_allclose(solution.x, exact, atol=1e-9)


def test_the_start_is_not_changed() -> None:
    posterior, x = make_posterior()
    before = x.copy()
    minimise(posterior, x, SolverConfig())
    np.testing.assert_array_equal(x, before)
