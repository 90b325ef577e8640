"""Roughness and reflectivity out of echoes that were drawn from them."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.arrays import FloatArray
from frontend.radiometry import Seafloor
from frontend.reconstruction.forward import Beams, Bins, Raster, render
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.priors import (
    PriorConfig,
    make_prior,
    reflectivity_spectrum,
    relief_spectrum,
    wavenumbers,
)
from frontend.reconstruction.seafloor import estimate_seafloor
from frontend.reconstruction.unknowns import from_cosine
from tests.frontend.reconstruction.small_window import make_altimeter, make_tables

LONGEST = 100.0


def flight(n_lines: int = 110) -> tuple[Raster, Beams, Bins]:
    """Straight lines a metre apart, 12 m above a raster of 112 by 120 m."""
    raster = Raster(112, 120, 1.0, (-5.0, -56.0))
    sensor = np.repeat(np.stack([np.arange(n_lines), 0 * np.arange(n_lines), 0 * np.arange(n_lines)], 1)[:, None], 2, 1)
    forward, up = np.tile([1.0, 0.0, 0.0], (n_lines, 1)), np.tile([0.0, 0.0, 1.0], (n_lines, 1))
    side = np.tile([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]], (n_lines, 1, 1))
    beams = Beams(sensor.astype(float), forward, side, up, np.zeros(n_lines), np.zeros(n_lines))
    shape = (n_lines, 2, 100)
    return raster, beams, Bins(np.ones(shape), np.full(shape, 4.0), np.full((2, 100), 1e-9), 0.5)


def draw(density: FloatArray, rng: np.random.Generator) -> FloatArray:
    return np.asarray(from_cosine(rng.standard_normal(density.shape) * np.sqrt(density)))


def seen(floor: Seafloor, seed: int, boulders: float = 0.0, exponent: float = 2.0) -> Posterior:
    """Echoes of a floor with four looks, nothing solved yet."""
    rng, (raster, beams, bins), tables = (
        np.random.default_rng(seed),
        flight(),
        replace(make_tables(), exponent=exponent),
    )
    k2 = np.add(*wavenumbers(raster))
    z = -12.0 + draw(relief_spectrum(k2, floor.roughness, LONGEST), rng)
    z += np.where(rng.uniform(size=z.shape) < 0.002, boulders, 0.0)
    rho = draw(reflectivity_spectrum(k2, floor.reflectivity, floor.length), rng)
    mu = render(z, rho, raster, beams, tables, bins)
    bins = replace(bins, intensity=mu * rng.gamma(4.0, 0.25, mu.shape))
    prior = make_prior(raster, tables, Seafloor(), PriorConfig())
    surface, aside = np.full(raster.shape, -12.0), np.zeros(mu.shape)
    return Posterior(raster, beams, tables, bins, prior, surface, make_altimeter(raster), 20.0, aside, 0.0 * surface)


@pytest.mark.parametrize("floor", [Seafloor(0.01, 0.2, 5.0), Seafloor(0.001, 0.1, 8.0), Seafloor(0.003, 0.3, 4.0)])
def test_roughness_and_reflectivity_come_back(floor: Seafloor) -> None:
    found = estimate_seafloor([seen(floor, seed) for seed in (1, 2)], [12.0, 12.0], LONGEST)
    # the floor is taken for flat, and two windows hold few long waves: a factor of two in power, 1.5 in amplitude
    assert 0.4 < found.roughness / floor.roughness < 2.5
    assert 0.6 < found.reflectivity / floor.reflectivity < 1.6


@pytest.mark.parametrize("exponent", [1.0, 4.0])
def test_roughness_comes_back_under_another_scattering_exponent(exponent: float) -> None:
    floor = Seafloor(0.003, 0.2, 5.0)
    found = estimate_seafloor([seen(floor, seed, exponent=exponent) for seed in (1, 2)], [12.0, 12.0], LONGEST)
    assert 0.4 < found.roughness / floor.roughness < 2.5  # as above; taken for Lambert's it would be a quarter or four


def noisier(posterior: Posterior, looks: tuple[float, float], rng: np.random.Generator) -> Posterior:
    """The same echoes, each side multiplied by speckle of so many looks once more."""
    more = np.stack([rng.gamma(n, 1 / n, posterior.bins.intensity[:, 0].shape) for n in looks], axis=1)
    return replace(posterior, bins=replace(posterior.bins, intensity=posterior.bins.intensity * more))


# one side a hundred times as noisy as the other smoothed the floor to a quarter; and in the second draw a simplex
# collapsed on its way from the usual floor, so that strong patches were taken for relief
@pytest.mark.parametrize(
    ("floor", "looks"), [(Seafloor(3e-3, 0.2, 5.0), (0.3, 30.0)), (Seafloor(3e-4, 0.6, 1.2), (1.0, 1.0))]
)
def test_a_floor_comes_back_through_noise(floor: Seafloor, looks: tuple[float, float]) -> None:
    rng = np.random.default_rng(1)
    echoes = [noisier(seen(floor, seed), looks, rng) for seed in (1, 1, 2, 3, 4)][1:]
    found = estimate_seafloor(echoes, [12.0] * 4, LONGEST)
    assert 0.4 < found.roughness / floor.roughness < 2.5  # as above
    assert 0.6 < found.reflectivity / floor.reflectivity < 1.6


def test_patches_are_not_taken_for_relief() -> None:
    rough, patchy = (
        estimate_seafloor([seen(floor, seed) for seed in (3, 5)], [12.0, 12.0], LONGEST)
        for floor in (Seafloor(0.01, 0.02, 5.0), Seafloor(1e-4, 0.3, 5.0))
    )
    # a hundredth in truth; what two windows of 24 m by 110 m leave open, and shading of steep slopes is not linear
    assert patchy.roughness < 0.25 * rough.roughness
    assert rough.reflectivity < 0.8 * patchy.reflectivity


def test_a_few_boulders_do_not_roughen_the_floor() -> None:
    floor = Seafloor(1e-3, 0.1, 5.0)
    plain, stony = (estimate_seafloor([seen(floor, 4, height)], [12.0], LONGEST) for height in (0.0, 1.0))
    assert stony.roughness < 4 * plain.roughness


def test_without_a_window_large_enough_the_floor_is_the_usual_one() -> None:
    assert estimate_seafloor([], [], LONGEST) == Seafloor()
    posterior = seen(Seafloor(), 1)
    assert estimate_seafloor([posterior], [60.0], LONGEST) == Seafloor()  # the swath ends before slopes show
