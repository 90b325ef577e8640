"""The solver of lines: monotone, bounded, interruptible, and against dense linear algebra."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.arrays import FloatArray
from frontend.reconstruction.line_model import make_model
from frontend.reconstruction.line_operators import beam_knots
from frontend.reconstruction.line_prior import LinePriorConfig, make_line_prior
from frontend.reconstruction.line_solver import (
    LineProblem,
    LineSolverConfig,
    Preconditioner,
    _backtrack,
    draw_lines,
    minimise_lines,
    solve_lines,
)
from frontend.reconstruction.lines import LineFrames
from frontend.reconstruction.neighbours import local_planes
from tests.frontend.reconstruction.small_lines import make_lines, make_window, rough

LONG = LineSolverConfig(n_steps=12, n_products=300, tolerance=1e-9, improvement=1e-12)


def make_problem(n: int = 12, spacing: float = 3.0, height: float = 0.3) -> tuple[LineFrames, LineProblem, FloatArray]:
    """A rough relief's echoes, some of them in shadow, and the state behind them."""
    frames, image = make_lines(make_window(n=n, pitch=0.1, turn=0.02), spacing)
    dark = np.zeros(frames.shape, dtype=bool)
    dark[2:4, 4:6] = True
    neighbours = local_planes(frames, rough(frames, height=height), 6)
    beam, n_angles = beam_knots(frames, image.angle, 0.3, 3.0)
    model = make_model(frames, replace(image, is_shadow=dark), neighbours, beam, 2.0)
    prior = make_line_prior(frames, dark, neighbours, (beam.shape[1], n_angles), LinePriorConfig())
    truth = np.concatenate([rough(frames, height=height).ravel(), np.zeros(model.size - model.n_cells)])
    amplitude = model.linearise(truth).amplitude.reshape(frames.shape)
    return frames, LineProblem(model, replace(image, amplitude=amplitude, is_shadow=dark), prior, spacing), truth


def dense(problem: LineProblem, x: FloatArray) -> FloatArray:
    linear = problem.model.linearise(x)
    return np.stack([problem.multiply(unit, linear) for unit in np.eye(problem.model.size)])


def test_the_gradient_of_the_cost_is_its_derivative() -> None:
    frames, problem, truth = make_problem()
    rng = np.random.default_rng(0)
    x = truth + 0.1 * rng.normal(size=truth.size)
    gradient = problem.gradient(x, problem.model.linearise(x))
    for k in rng.choice(x.size, 40):
        step = np.zeros(x.size)
        step[k] = 1e-5
        up, down = (problem.cost(x + s * step, problem.model.linearise(x + s * step)) for s in (1, -1))
        assert gradient[k] == pytest.approx((up - down) / 2e-5, abs=1e-6 * np.abs(gradient).max())
    assert frames.shape[0] >= 3


def test_the_cost_falls_with_every_step_to_a_minimum() -> None:
    _, problem, truth = make_problem()
    solution = minimise_lines(problem, np.zeros(truth.size), LONG, np.inf)
    assert (np.diff(solution.costs) < 0).all()
    assert len(solution.costs) > 2
    start = problem.gradient(np.zeros(truth.size), problem.model.linearise(np.zeros(truth.size)))
    end = problem.gradient(solution.x, solution.linear)
    assert np.linalg.norm(end) < 1e-3 * np.linalg.norm(start)


def test_a_step_uphill_is_refused_and_one_too_long_is_shortened() -> None:
    _, problem, truth = make_problem()
    x = np.zeros(truth.size)
    linear = problem.model.linearise(x)
    cost, downhill = problem.cost(x, linear), -problem.gradient(x, linear)
    assert _backtrack(problem, x, -1e-6 * downhill, cost) is None
    # along the gradient the cost is a parabola, to second order: twice the way to its bottom it is back where it began
    bottom = float(downhill @ downhill) / float(downhill @ problem.multiply(downhill, linear))
    found = _backtrack(problem, x, 3.5 * bottom * downhill, cost)
    assert found is not None
    assert found[2] < cost
    np.testing.assert_allclose(found[0], 0.4 * 3.5 * bottom * downhill)


def test_no_step_raises_a_cell_by_more_than_it_may() -> None:
    _, problem, truth = make_problem(height=3.0)
    config = LineSolverConfig(n_steps=1, step_height=0.1)
    solution = minimise_lines(problem, np.zeros(truth.size), config, np.inf)
    relief, _, _ = problem.model.split(solution.x)
    assert 0 < np.abs(relief).max() <= 0.1 * problem.spacing * (1 + 1e-9)


def test_past_the_deadline_the_start_is_the_answer() -> None:
    _, problem, truth = make_problem()
    solution = minimise_lines(problem, truth, LONG, deadline=-np.inf)
    np.testing.assert_array_equal(solution.x, truth)
    assert len(solution.costs) == 1


def test_linear_solves_agree_with_dense_algebra() -> None:
    _, problem, truth = make_problem(n=8, spacing=5.0)
    right = np.random.default_rng(1).normal(size=truth.size)
    found = solve_lines(problem, problem.model.linearise(truth), right, LONG)
    np.testing.assert_allclose(found, np.linalg.solve(dense(problem, truth), right), rtol=1e-4, atol=1e-6)


def test_the_preconditioner_is_symmetric_and_close() -> None:
    _, problem, truth = make_problem(n=8, spacing=5.0)
    curvature = dense(problem, truth)
    np.testing.assert_allclose(curvature, curvature.T, rtol=1e-6, atol=1e-9)
    apply = Preconditioner(problem, problem.model.linearise(truth)).apply
    inverse = np.stack([apply(unit) for unit in np.eye(truth.size)])
    np.testing.assert_allclose(inverse, inverse.T, rtol=1e-6, atol=1e-9)
    root = np.linalg.cholesky(inverse)
    eigenvalues = np.linalg.eigvalsh(root.T @ curvature @ root)
    plain = np.linalg.eigvalsh(curvature)
    assert eigenvalues[-1] / eigenvalues[0] < 0.1 * plain[-1] / plain[0]


def test_draws_have_the_spread_of_the_posterior() -> None:
    _, problem, truth = make_problem(n=8, spacing=5.0)
    linear, rng = problem.model.linearise(truth), np.random.default_rng(2)
    draws = np.stack([draw_lines(problem, linear, LONG, rng) for _ in range(400)])
    variance = np.diag(np.linalg.inv(dense(problem, truth)))
    # 400 draws: a variance is good to 7 %, three standard deviations of it over the cells
    np.testing.assert_allclose(draws.var(axis=0), variance, rtol=0.35)
    assert np.mean(draws.var(axis=0) / variance) == pytest.approx(1.0, abs=0.05)
