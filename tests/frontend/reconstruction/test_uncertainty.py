"""Sigma: that of the belief where nothing is told, more of it away from the track, and that of objects beside it."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.arrays import FloatArray
from frontend.reconstruction.measured_heights import MeasuredHeights
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.priors import PriorConfig, relief_spectrum, wavenumbers
from frontend.reconstruction.solver import Solution, SolverConfig
from frontend.reconstruction.uncertainty import SigmaConfig, height_sigma
from tests.frontend.reconstruction.small_window import make_posterior

PLAIN = SigmaConfig(factor=1.0, longest=PriorConfig().longest)
ROUGHNESS = 0.1  # of the small window's floor


def sigma(posterior: Posterior, config: SigmaConfig = PLAIN, objects: float = 0.0) -> FloatArray:
    """Sigma at the origin, an object in the middle of the finest resolution."""
    x, higher = posterior.origin(), posterior.origin()
    higher.objects[35, 15] = objects
    mu = posterior.predict(x)
    levels = [(posterior, Solution(there, mu, (0.0,))) for there in (x, higher)]
    return height_sigma(levels, config, SolverConfig(), np.random.default_rng(1))


@pytest.fixture(scope="module")
def seen() -> Posterior:
    """Six lines over 70 by 30 m, with altimeter."""
    return make_posterior()[0]


@pytest.fixture(scope="module")
def blind(seen: Posterior) -> Posterior:
    """The same, nothing heard."""
    silent = MeasuredHeights(seen.measured.weights, seen.measured.height, 0.0 * seen.measured.precision)
    return replace(seen, measured=silent, bins=replace(seen.bins, looks=0.0 * seen.bins.looks))


@pytest.mark.parametrize("longest", [100.0, 400.0])
def test_where_nothing_is_told_sigma_is_that_of_the_belief(blind: Posterior, longest: float) -> None:
    found = sigma(blind, SigmaConfig(factor=1.0, longest=longest, n_draws=300))
    k2 = np.add(*wavenumbers(blind.raster))
    variance = relief_spectrum(k2, ROUGHNESS, longest).sum() / blind.raster.n_cells  # cells of one square metre
    # nearly all of it is in one wave, drawn 300 times: a variance is good to 8 %, 300 m of it to three of those
    assert np.mean(found**2) == pytest.approx(variance, rel=0.25)


def test_what_is_heard_makes_it_smaller(seen: Posterior, blind: Posterior) -> None:
    assert np.median(sigma(seen)) < 0.5 * np.median(sigma(blind))


def test_it_grows_away_from_the_track(seen: Posterior) -> None:
    found = sigma(seen, SigmaConfig(n_draws=40))
    track, edges = found[33:37, 8:20].mean(), found[[4, 5, -6, -5], 8:20].mean()
    assert edges > 1.5 * track


def test_a_factor_is_a_factor(seen: Posterior) -> None:
    np.testing.assert_allclose(sigma(seen, SigmaConfig(factor=3.0)), 3 * sigma(seen, SigmaConfig(factor=1.0)))


def test_an_object_is_as_uncertain_as_it_is_high(seen: Posterior) -> None:
    with_it, without = sigma(seen, objects=2.0), sigma(seen)
    change = with_it**2 - without**2
    # its square spread by a Gaussian of two cells, which the truncated kernel of scipy samples to a few per mille
    assert change.sum() == pytest.approx(2.0**2, rel=1e-6)
    assert change[35, 15] == pytest.approx(2.0**2 / (2 * np.pi * 2.0**2), rel=0.01)
    np.testing.assert_allclose(change[:20], 0.0, atol=1e-12)


def test_the_same_generator_gives_the_same_bytes(seen: Posterior) -> None:
    assert sigma(seen).tobytes() == sigma(seen).tobytes()
