"""Curvature by differences of gradients and by Monte Carlo, and its preconditioner."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.arrays import FloatArray
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


def dense_jacobian(equations: module.NormalEquations) -> FloatArray:
    """Shape (P * 2 * B, 3 * n_cells + 2 * K + 2 * P): derivatives of ln mu by the entries of a flat direction."""
    rows, n, n_knots = equations.rows, equations.raster.n_cells, len(equations.prior.beam)
    jacobian = np.zeros((*rows.share.shape, 3 * n + 2 * n_knots + 2 * len(rows.share)))
    for ping, side, b in np.ndindex(rows.share.shape):
        row, share, knot = jacobian[ping, side, b], rows.share[ping, side, b], rows.knot[ping, side, b]
        used = slice(rows.n_cells[ping, side, b])
        cells = rows.cell[ping, side, b, used]
        row[cells], row[n + cells] = rows.by_height[ping, side, b, used], rows.by_reflectivity[ping, side, b, used]
        row[2 * n + cells] = row[cells]
        k = min(int(knot), n_knots - 2)
        row[3 * n + side * n_knots + np.array([k, k + 1])] = share * np.array([k + 1 - knot, knot - k])
        row[3 * n + 2 * n_knots + 2 * ping + side] = share
    return jacobian.reshape(-1, jacobian.shape[-1])


def test_products_are_those_of_the_matrices() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    weight = np.where(np.arange(60) % 7 == 0, 0.0, equations.weight)  # some bins say nothing
    equations = replace(equations, weight=weight)
    v = make_direction(posterior, np.random.default_rng(8))
    jacobian, direction = dense_jacobian(equations), v.from_coordinates()
    data = v.filled(jacobian.T @ (weight.ravel() * (jacobian @ direction.flat())))
    below, precision = equations.below
    height = below.T @ (precision * (below @ (direction.background + direction.objects).ravel()))
    for raster in (data.background, data.objects):
        raster += height.reshape(raster.shape)
    expected = data.to_coordinates().plus(equations.prior.multiply(v, equations.object_precision))
    for part, wanted in zip(equations.multiply(v), expected, strict=True):
        np.testing.assert_allclose(part, wanted, atol=1e-12 * np.abs(wanted).max())  # sums in another order


def test_draws_pull_back_what_the_matrix_pulls_back() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    values = np.random.default_rng(9).standard_normal(equations.weight.shape)
    found = equations._pull(values, np.zeros(posterior.raster.n_cells))
    expected = found.filled(dense_jacobian(equations).T @ values.ravel())
    for part, wanted in zip(found, expected, strict=True):
        np.testing.assert_allclose(part, wanted, atol=1e-12 * np.abs(wanted).max())  # sums in another order


def test_information_of_a_level_is_what_raising_all_cells_finds() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    n, information = posterior.raster.n_cells, equations._smooth_information
    without = replace(equations, prior=replace(equations.prior, background=0.0 * equations.prior.background))
    level = np.zeros(dense_jacobian(equations).shape[1])
    level[0] = np.sqrt(n)  # the coefficient of a metre everywhere
    found = without.multiply_flat(level)[0] / np.sqrt(n)
    assert information[0][0, 0] - equations.prior.background[0, 0] == pytest.approx(found, rel=1e-6)
