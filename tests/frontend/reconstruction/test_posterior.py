"""The cost by hand, its gradient by differences, its curvature by differences of gradients and by Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.arrays import FloatArray
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.priors import from_cosine, to_cosine
from tests.frontend.reconstruction.small_window import make_posterior


def at(posterior: Posterior, x: FloatArray) -> tuple[float, FloatArray]:
    """Cost and gradient at a state."""
    mu = posterior.predict(x)
    return posterior.cost(x, mu), posterior.gradient(x, mu)


def without_echoes(posterior: Posterior) -> Posterior:
    return replace(posterior, bins=replace(posterior.bins, looks=np.zeros_like(posterior.bins.looks)))


def without_belief(posterior: Posterior) -> Posterior:
    nothing = np.zeros(posterior.raster.shape)
    return replace(posterior, prior=replace(posterior.prior, height=nothing, reflectivity=nothing))


@pytest.mark.parametrize(
    "part", [lambda p: p, without_echoes, without_belief], ids=["all", "altimeter and prior", "echoes and altimeter"]
)
@pytest.mark.parametrize("unknown", [0, 1], ids=["height", "reflectivity"])
def test_gradient_equals_finite_differences(part, unknown: int) -> None:  # type: ignore[no-untyped-def]
    posterior, x = make_posterior()
    posterior = part(posterior)
    rng = np.random.default_rng(unknown)
    gradient = at(posterior, x)[1]
    for _ in range(5):
        direction = np.zeros_like(x)
        direction[unknown] = rng.standard_normal(x[unknown].shape)
        h = 1e-6
        up, down = (at(posterior, x + sign * h * direction)[0] for sign in (1, -1))
        # all samples stay in sight of this relief. A step of 1 um carries a few of 5000 samples over a bin's
        # middle, where the linear sharing has a kink
        assert (gradient * direction).sum() == pytest.approx((up - down) / (2 * h), rel=1e-3)


def test_cost_without_echoes_is_that_of_altimeter_and_prior_by_hand() -> None:
    posterior, _ = make_posterior()
    posterior = without_echoes(posterior)
    x = posterior.expected.copy()
    x[0] += 0.5  # half a metre above what is expected everywhere
    miss = -11.5 - posterior.altimeter.height
    altimeter = 0.5 * (posterior.altimeter.precision * miss**2).sum()
    belief = 0.5 * 0.5**2 * posterior.prior.height[0, 0] * posterior.raster.n_cells
    assert at(posterior, x)[0] == pytest.approx(altimeter + belief)


def test_echoes_cost_the_gamma_likelihood_against_the_best_they_could() -> None:
    posterior, x = make_posterior(looks=4.0, tail=1e12)
    mu = posterior.predict(x)
    quiet = without_echoes(posterior)
    likelihood = 4.0 * (np.log(mu) + posterior.bins.intensity / mu)
    best = 4.0 * (np.log(posterior.bins.intensity) + 1)
    expected = (likelihood - best).sum()
    # ten digits are lost in log1p of a deviance over a tail of 1e12
    assert posterior.cost(x, mu) - quiet.cost(x, mu) == pytest.approx(expected, rel=1e-3)


def test_a_bin_at_the_tails_deviance_counts_half() -> None:
    posterior, x = make_posterior(looks=4.0, tail=20.0)
    mu = posterior.predict(x)
    # where 2 L (t - 1 - ln t) = 20
    low, high = 1.0, 100.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if 8 * (middle - 1 - np.log(middle)) < 20 else (low, middle)
    outlier = replace(posterior, bins=replace(posterior.bins, intensity=low * mu))
    np.testing.assert_allclose(outlier.data_weight(mu), 2.0)
    np.testing.assert_allclose(replace(outlier, bins=replace(posterior.bins, intensity=mu)).data_weight(mu), 4.0)


def test_an_outlier_pulls_less_than_its_deviance() -> None:
    posterior, x = make_posterior(looks=4.0)
    mu = posterior.predict(x)
    intensity = mu.copy()
    intensity[2, 0, 40] *= 1e6
    cost = replace(posterior, bins=replace(posterior.bins, intensity=intensity)).cost(x, mu)
    clean = replace(posterior, bins=replace(posterior.bins, intensity=mu)).cost(x, mu)
    assert cost - clean < 20.0 / 2 * np.log(8e6 / 20)


def test_bins_without_looks_say_nothing() -> None:
    posterior, x = make_posterior()
    quiet = without_echoes(posterior)
    loud = replace(quiet, bins=replace(quiet.bins, intensity=quiet.bins.intensity * 1e3))
    assert at(quiet, x)[0] == at(loud, x)[0]
    np.testing.assert_array_equal(at(quiet, x)[1], at(loud, x)[1])


def test_silence_in_a_bin_has_a_finite_cost() -> None:
    posterior, x = make_posterior()
    silent = replace(posterior, bins=replace(posterior.bins, intensity=np.zeros_like(posterior.bins.intensity)))
    cost, gradient = at(silent, x)
    assert np.isfinite(cost)
    assert np.isfinite(gradient).all()


def test_curvature_is_the_second_derivative_where_echoes_are_as_expected() -> None:
    posterior, x = make_posterior()
    posterior = replace(posterior, bins=replace(posterior.bins, intensity=posterior.predict(x)))
    equations = posterior.curvature(x, posterior.predict(x))
    rng, h = np.random.default_rng(4), 1e-5
    for _ in range(3):
        direction = from_cosine(rng.standard_normal(x.shape) / np.sqrt(posterior.prior.precision))
        up, down = (at(posterior, x + sign * h * direction)[1] for sign in (1, -1))
        second = (up - down) / (2 * h)
        product = from_cosine(equations.multiply(to_cosine(direction)))
        # rows in single precision, kinks of the sharing
        np.testing.assert_allclose(product, second, atol=2e-3 * np.abs(second).max())


def test_curvature_is_symmetric_and_positive() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    rng = np.random.default_rng(5)
    for _ in range(10):
        v, w = rng.standard_normal((2, *x.shape))
        assert (v * equations.multiply(w)).sum() == pytest.approx((w * equations.multiply(v)).sum(), rel=1e-9)
        assert (v * equations.multiply(v)).sum() > 0
        assert (v * equations.precondition(v)).sum() > 0


def test_draws_have_the_curvature_as_covariance() -> None:
    posterior, x = make_posterior()
    equations = posterior.curvature(x, posterior.predict(x))
    rng, n = np.random.default_rng(6), 400
    directions = rng.standard_normal((6, *x.shape)) / np.sqrt(posterior.prior.precision)
    draws = np.stack([equations.draw(rng) for _ in range(n)])
    for direction in directions:
        expected = (direction * equations.multiply(direction)).sum()
        found = ((draws * direction).sum(axis=(1, 2, 3)) ** 2).mean()
        assert found == pytest.approx(expected, rel=4 * np.sqrt(2 / n))  # four sigmas of a variance of n draws


def test_the_preconditioner_is_the_inverse_without_echoes_and_altimeter() -> None:
    posterior, x = make_posterior()
    altimeter = replace(posterior.altimeter, precision=np.zeros(4))
    posterior = replace(without_echoes(posterior), altimeter=altimeter)
    equations = posterior.curvature(x, posterior.predict(x))
    v = np.random.default_rng(7).standard_normal(x.shape)
    np.testing.assert_allclose(equations.precondition(equations.multiply(v)), v, atol=1e-9)
