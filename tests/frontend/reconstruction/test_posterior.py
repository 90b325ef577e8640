"""The cost by hand, and its gradient by differences."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.unknowns import Unknowns
from tests.frontend.reconstruction.small_window import make_direction, make_posterior, only

PARTS = ["background", "objects", "log_reflectivity", "beam", "gain"]


def at(posterior: Posterior, x: Unknowns) -> tuple[float, Unknowns]:
    """Cost and gradient at a state."""
    mu = posterior.predict(x)
    return posterior.cost(x, mu), posterior.gradient(x, mu)


def without_echoes(posterior: Posterior) -> Posterior:
    return replace(posterior, bins=replace(posterior.bins, looks=np.zeros_like(posterior.bins.looks)))


@pytest.mark.parametrize("echoes", [lambda p: p, without_echoes], ids=["all", "altimeter and prior"])
@pytest.mark.parametrize("part", PARTS)
def test_gradient_equals_finite_differences(echoes, part: str) -> None:  # type: ignore[no-untyped-def]
    posterior, x = make_posterior()
    posterior, rng = echoes(posterior), np.random.default_rng(3)
    gradient, missed = at(posterior, x)[1], []
    for _ in range(8):
        direction = only(part, make_direction(posterior, rng).from_coordinates()).times(1e-6)
        up, down = (at(posterior, x.plus(direction, sign))[0] for sign in (1.0, -1.0))
        missed.append(abs(gradient.dot(direction) / (0.5 * (up - down)) - 1))
    # the sharing of samples among bins has kinks, and now and then a sample comes in sight
    assert np.median(missed) < 1e-3


@pytest.mark.parametrize("part", ["log_reflectivity", "beam", "gain"])
def test_gradient_of_what_moves_no_sample_is_exact(part: str) -> None:
    posterior, x = make_posterior()
    gradient, rng = at(posterior, x)[1], np.random.default_rng(3)
    for _ in range(5):
        direction = only(part, make_direction(posterior, rng).from_coordinates()).times(1e-4)
        up, down = (at(posterior, x.plus(direction, sign))[0] for sign in (1.0, -1.0))
        assert gradient.dot(direction) == pytest.approx(0.5 * (up - down), rel=1e-6, abs=1e-9)


def test_cost_without_echoes_is_that_of_altimeter_and_prior_by_hand() -> None:
    posterior, _ = make_posterior()
    posterior = without_echoes(posterior)
    x = posterior.origin()
    x.background[:] = 0.5  # half a metre above what is expected everywhere
    x.objects[3, 4] = 0.1
    miss = -11.5 - posterior.measured.height
    altimeter = 0.5 * (posterior.measured.precision * miss**2).sum()
    background = 0.5 * 0.5**2 * posterior.prior.background[0, 0] * posterior.raster.n_cells
    objects = 0.5 * 0.5 * np.log(1 + (0.1 / 0.05) ** 2)
    assert at(posterior, x)[0] == pytest.approx(altimeter + background + objects)


def test_echoes_cost_the_gamma_likelihood_against_the_best_they_could() -> None:
    posterior, x = make_posterior(looks=4.0, tail=1e12)
    mu = posterior.predict(x)
    likelihood = 4.0 * (np.log(mu) + posterior.bins.intensity / mu)
    best = 4.0 * (np.log(posterior.bins.intensity) + 1)
    expected = (likelihood - best).sum()
    # ten digits are lost in log1p of a deviance over a tail of 1e12
    assert posterior.cost(x, mu) - without_echoes(posterior).cost(x, mu) == pytest.approx(expected, rel=1e-3)


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
    for a, b in zip(at(quiet, x)[1], at(loud, x)[1], strict=True):
        np.testing.assert_array_equal(a, b)


def test_silence_in_a_bin_has_a_finite_cost() -> None:
    posterior, x = make_posterior()
    silent = replace(posterior, bins=replace(posterior.bins, intensity=np.zeros_like(posterior.bins.intensity)))
    cost, gradient = at(silent, x)
    assert np.isfinite(cost)
    assert all(np.isfinite(part).all() for part in gradient)


def test_echoes_kept_aside_are_no_part_of_the_cost_and_cost_the_same() -> None:
    posterior, x = make_posterior()
    aside = replace(without_echoes(posterior), held_out=posterior.bins.looks)
    mu = posterior.predict(x)
    assert posterior.cost(x, mu) == pytest.approx(aside.cost(x, mu) + aside.held_out_costs(mu).sum())
    assert not posterior.held_out_costs(mu).any()


def test_a_gain_of_a_line_is_heard_over_the_floor_only() -> None:
    posterior, x = make_posterior()
    louder = replace(x, gain=x.gain + np.log(2.0))
    floor = posterior.bins.floor
    np.testing.assert_allclose(posterior.predict(louder) - floor, 2 * (posterior.predict(x) - floor), atol=1e-20)
