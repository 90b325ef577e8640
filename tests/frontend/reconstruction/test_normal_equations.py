"""Curvature by differences of gradients and by Monte Carlo, and its preconditioner."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.reconstruction import normal_equations as module
from tests.frontend.reconstruction.small_window import make_direction, make_posterior, only
from tests.frontend.reconstruction.test_posterior import PARTS, without_echoes


@pytest.mark.parametrize("part", PARTS)
def test_curvature_is_the_second_derivative_where_echoes_are_as_expected(part: str) -> None:
    posterior, x = make_posterior()
    x = replace(x, objects=np.zeros_like(x.objects))  # where the belief in objects is a Gaussian
    posterior = replace(posterior, bins=replace(posterior.bins, intensity=posterior.predict(x)))
    equations = posterior.curvature(x, posterior.predict(x))
    direction = only(part, make_direction(posterior, np.random.default_rng(4)))
    h = 1e-5
    up, down = (
        posterior.gradient(y, posterior.predict(y)).to_coordinates()
        for y in (x.plus(direction.from_coordinates(), sign * h) for sign in (1.0, -1.0))
    )
    second, product = up.plus(down, -1.0).times(0.5 / h), equations.multiply(direction)
    # rows in single precision; a bin's mean knot stands for its samples'; kinks of the sharing
    assert product.dot(direction) == pytest.approx(second.dot(direction), rel=0.02)


def test_curvature_is_symmetric_and_positive() -> None:
    posterior, x = make_posterior()
    equations, rng = posterior.curvature(x, posterior.predict(x)), np.random.default_rng(5)
    for _ in range(10):
        v, w = make_direction(posterior, rng), make_direction(posterior, rng)
        assert v.dot(equations.multiply(w)) == pytest.approx(w.dot(equations.multiply(v)), rel=1e-6)
        assert v.dot(equations.multiply(v)) > 0
        assert v.dot(equations.precondition(v)) > 0


def test_draws_have_the_curvature_as_covariance() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    rng, n = np.random.default_rng(6), 400
    directions = [make_direction(posterior, rng) for _ in range(4)]
    draws = [equations.draw(rng) for _ in range(n)]
    for direction in directions:
        found = np.mean([draw.dot(direction) ** 2 for draw in draws])
        # four sigmas of a variance of n draws
        assert found == pytest.approx(direction.dot(equations.multiply(direction)), rel=4 * np.sqrt(2 / n))


def test_the_preconditioner_is_the_inverse_without_echoes_and_altimeter() -> None:
    posterior, x = make_posterior()
    altimeter = replace(posterior.measured, precision=np.zeros(4))
    posterior = replace(without_echoes(posterior), measured=altimeter)
    equations = posterior.curvature(x, posterior.predict(x))
    v = make_direction(posterior, np.random.default_rng(7))
    for found, expected in zip(equations.precondition(equations.multiply(v)), v, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_information_on_the_beam_lies_at_the_angles_that_were_seen() -> None:
    posterior, x = make_posterior()
    information = posterior.curvature(x, posterior.predict(x)).beam_information
    angle = posterior.tables.angle_first + posterior.tables.angle_step * np.arange(61)
    assert (information[:, (angle > 0.6) & (angle < 1.0)] > 0).all()
    assert (information[:, angle < -0.3] == 0).all()


def test_compiled_products_do_what_their_python_says() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    v = make_direction(posterior, np.random.default_rng(8)).from_coordinates()
    rasters, shape = ((v.background + v.objects).ravel(), v.log_reflectivity.ravel()), equations.weight.shape
    results = []
    for kernels in (
        (module._push, module._pull),
        tuple(getattr(k, "py_func", k) for k in (module._push, module._pull)),
    ):
        change, out = np.empty(shape), (np.zeros((2, posterior.raster.n_cells)), np.zeros((2, 61)), np.zeros(shape[:2]))
        kernels[0](equations._entries, rasters, v.beam, v.gain, change)
        kernels[1](equations._entries, change, *out)
        results.append((change, *out))
    for fast, plain in zip(*results, strict=True):
        np.testing.assert_allclose(fast, plain, rtol=1e-5, atol=1e-7 * np.abs(plain).max())  # single precision
