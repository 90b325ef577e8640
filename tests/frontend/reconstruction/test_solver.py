"""Gauss-Newton and conjugate gradients: quadratic problems are solved, others never get worse."""

import time
from dataclasses import replace

import numpy as np
import pytest

from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.solver import SolverConfig, minimise, solve
from frontend.reconstruction.unknowns import Unknowns, from_cosine, to_cosine
from tests.frontend.reconstruction.small_window import make_direction, make_posterior
from tests.frontend.reconstruction.test_posterior import without_echoes

THOROUGH = SolverConfig(n_steps=8, n_products=300, tolerance=1e-9, improvement=1e-12, step_height=100.0)


def quadratic() -> Posterior:
    """Altimeter and belief alone, objects as good as forbidden."""
    posterior = without_echoes(make_posterior()[0])
    return replace(posterior, prior=replace(posterior.prior, object_height=1e-6))


def exact_heights(posterior: Posterior) -> np.ndarray:
    """Minimiser of altimeter and background, from dense normal equations."""
    n = posterior.raster.n_cells
    identity = np.eye(n).reshape(n, *posterior.raster.shape)
    precision = from_cosine(posterior.prior.background * to_cosine(identity)).reshape(n, n)
    weights, altimeter = posterior.measured.weights.toarray(), posterior.measured
    miss = altimeter.height - weights @ posterior.expected.ravel()
    normal = precision + weights.T @ (altimeter.precision[:, None] * weights)
    step = np.linalg.solve(normal, weights.T @ (altimeter.precision * miss))
    return np.asarray(posterior.expected + step.reshape(posterior.raster.shape))


def test_a_quadratic_cost_is_solved() -> None:
    posterior = quadratic()
    solution = minimise(posterior, posterior.origin(), THOROUGH)
    np.testing.assert_allclose(posterior.height(solution.x), exact_heights(posterior), atol=1e-5)
    for part in (solution.x.log_reflectivity, solution.x.beam, solution.x.gain):
        np.testing.assert_allclose(part, 0.0, atol=1e-8)


def test_conjugate_gradients_solve_the_normal_equations() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    truth = make_direction(posterior, np.random.default_rng(1))
    found = solve(equations, equations.multiply(truth), THOROUGH)
    for a, b in zip(found.from_coordinates(), truth.from_coordinates(), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-4 * np.abs(b).max())


def test_wherever_conjugate_gradients_stop_the_step_goes_downhill() -> None:
    posterior, x = make_posterior()
    mu = posterior.predict(x)
    equations, gradient = posterior.curvature(x, mu), posterior.gradient(x, mu).to_coordinates()
    for n_products in (1, 2, 5, 20):
        assert solve(equations, gradient, SolverConfig(n_products=n_products)).dot(gradient) > 0


def test_nothing_to_solve_is_solved_by_nothing() -> None:
    posterior, x = make_posterior()
    found = solve(posterior.curvature(x, posterior.predict(x)), x.times(0.0), SolverConfig())
    assert not any(part.any() for part in found)


def replace_steps(n_steps: int) -> SolverConfig:
    return SolverConfig(n_steps=n_steps, improvement=1e-9)


def test_the_cost_never_rises_and_is_that_of_the_state_given_back() -> None:
    posterior, _ = make_posterior(relief=0.6)
    start = posterior.origin()
    solution = minimise(posterior, start, replace_steps(20))
    assert len(solution.costs) > 3
    assert (np.diff(solution.costs) < 0).all()
    assert solution.costs[0] == posterior.cost(start, posterior.predict(start))
    np.testing.assert_array_equal(solution.mu, posterior.predict(solution.x))
    assert solution.costs[-1] == posterior.cost(solution.x, solution.mu)


def test_a_solution_is_more_probable_than_the_truth() -> None:
    posterior, x = make_posterior()
    solution = minimise(posterior, posterior.origin(), replace_steps(20))
    assert solution.costs[-1] < posterior.cost(x, posterior.predict(x))


def test_echoes_bring_the_surface_nearer_to_the_truth() -> None:
    posterior, x = make_posterior(looks=50.0, relief=0.3)
    solution = minimise(posterior, posterior.origin(), replace_steps(20))
    y = posterior.raster.origin[1] + posterior.raster.spacing * np.arange(posterior.raster.n_y)
    side = (np.abs(y) > 10) & (np.abs(y) < 28)  # under the track slopes hardly show, far out lines end
    found, truth = (posterior.height(u)[side][:, 8:22] for u in (solution.x, x))
    # six lines 3 m apart, waves of 10 m: every second cell is interpolated
    assert np.corrcoef(found.ravel(), truth.ravel())[0, 1] > 0.6
    assert np.std(found - truth) < 0.8 * np.std(truth)


def test_steps_are_bounded_in_cells() -> None:
    posterior = quadratic()
    away = replace(posterior, measured=replace(posterior.measured, height=posterior.measured.height + 50.0))
    solution = minimise(away, away.origin(), SolverConfig(n_steps=1, n_products=100, step_height=0.75))
    assert np.abs(solution.x.background + solution.x.objects).max() == pytest.approx(0.75)


def test_the_number_of_steps_is_kept() -> None:
    posterior, _ = make_posterior()
    assert len(minimise(posterior, posterior.origin(), replace_steps(2)).costs) <= 3


def test_after_the_deadline_what_is_known_is_given_back() -> None:
    posterior, x = make_posterior()
    solution = minimise(posterior, x, SolverConfig(), until=time.monotonic())
    assert len(solution.costs) == 1
    assert solution.x is x


def test_a_step_that_the_echoes_kept_aside_contradict_is_not_taken() -> None:
    posterior, _ = make_posterior(relief=0.4)
    start = posterior.origin()
    flat = posterior.predict(start)  # aside is a flat floor, the rest is not
    lines = np.arange(6)[:, None, None] % 2 == 0
    looks, echoes = posterior.bins.looks, np.where(lines, posterior.bins.intensity, flat)
    bins = replace(posterior.bins, intensity=echoes, looks=np.where(lines, looks, 0.0))
    torn = replace(posterior, bins=bins, held_out=np.where(lines, 0.0, 100 * looks))
    assert len(minimise(torn, start, SolverConfig()).costs) == 1
    assert len(minimise(replace(torn, held_out=0 * looks), start, SolverConfig()).costs) > 1


def test_a_step_is_taken_though_one_loud_line_kept_aside_contradicts() -> None:
    posterior, _ = make_posterior(relief=0.4)
    start = posterior.origin()
    odd = np.arange(6)[:, None, None] == 1
    echoes = np.where(odd, posterior.predict(start), posterior.bins.intensity)
    seen = np.arange(6)[:, None, None] % 2 == 0
    looks = posterior.bins.looks
    aside = np.where(seen, 0.0, np.where(odd, 100.0, 1.0) * looks)
    bins = replace(posterior.bins, intensity=echoes, looks=np.where(seen, looks, 0.0))
    torn = replace(posterior, bins=bins, held_out=aside)
    solution = minimise(torn, start, SolverConfig(n_steps=1))
    assert len(solution.costs) == 2
    assert torn.held_out_costs(solution.mu).sum() > torn.held_out_costs(torn.predict(start)).sum()


def test_the_start_is_not_changed() -> None:
    posterior, x = make_posterior()
    before = Unknowns(*(part.copy() for part in x))
    minimise(posterior, x, SolverConfig())
    for a, b in zip(x, before, strict=True):
        np.testing.assert_array_equal(a, b)
