"""Beliefs about relief and reflectivity: their spectra, and that they are the same on every grid."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.fft import dct

from frontend.arrays import FloatArray
from frontend.radiometry import Seafloor
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.priors import Prior, PriorConfig, make_prior, wavenumbers
from frontend.reconstruction.unknowns import Unknowns, from_cosine, nothing, to_cosine
from tests.frontend.reconstruction.small_window import make_tables

CONFIG, FLOOR = PriorConfig(), Seafloor(roughness=0.01, reflectivity=0.1, length=8.0)


def raster(n: int = 64, spacing: float = 1.0) -> Raster:
    return Raster(n, n, spacing, (0.0, 0.0))


def prior_on(grid: Raster) -> Prior:
    return make_prior(grid, make_tables(), FLOOR, CONFIG)


def cosine_basis(n: int) -> FloatArray:
    return np.asarray(dct(np.eye(n), norm="ortho", axis=0))


def test_cosine_coefficients_come_back() -> None:
    x = np.random.default_rng(1).standard_normal((2, 12, 15))
    np.testing.assert_allclose(from_cosine(to_cosine(x)), x, atol=1e-14)
    # a stack is transformed raster by raster
    np.testing.assert_allclose(to_cosine(x)[1], to_cosine(x[1]), atol=1e-14)


def test_cosine_coefficients_are_orthonormal() -> None:
    x = np.random.default_rng(2).standard_normal((8, 9))
    np.testing.assert_allclose(to_cosine(x), cosine_basis(8) @ x @ cosine_basis(9).T, atol=1e-13)


def test_wavenumbers_are_the_eigenvalues_of_the_second_difference() -> None:
    n, spacing = 12, 0.5
    second = (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) / spacing**2
    second[0, 0] = second[-1, -1] = 1 / spacing**2  # mirrored at the edges
    k2_y, k2_x = wavenumbers(Raster(n, 7, spacing, (0.0, 0.0)))
    np.testing.assert_allclose(np.sort(k2_y.ravel()), np.linalg.eigvalsh(second), atol=1e-12)
    assert (k2_y.shape, k2_x.shape) == ((n, 1), (1, 7))


def test_precision_times_covariance_is_one() -> None:
    grid = Raster(9, 7, 1.0, (0.0, 0.0))
    prior = prior_on(grid)
    basis = np.kron(cosine_basis(9), cosine_basis(7))  # rows: basis functions on the raveled raster
    for name, precision in (("background", prior.background), ("log_reflectivity", prior.reflectivity)):
        covariance = basis.T @ np.diag(1 / precision.ravel()) @ basis
        applied = []
        for cell in np.eye(grid.n_cells):
            x = nothing(grid.shape, 61, 3)
            getattr(x, name)[:] = (covariance @ cell).reshape(grid.shape)
            applied.append(getattr(prior.gradient(x), name).ravel())
        np.testing.assert_allclose(applied, np.eye(grid.n_cells), atol=1e-8)  # condition number 1e5


def random(grid: Raster, seed: int) -> Unknowns:
    rng = np.random.default_rng(seed)
    sizes = [grid.shape] * 3 + [(2, 61), (4, 2)]
    return Unknowns(*(rng.standard_normal(size) for size in sizes))


@given(st.integers(0, 2**32 - 1))
def test_everything_that_is_not_expected_costs_something(seed: int) -> None:
    grid = raster(8)
    prior, x = prior_on(grid), random(grid, seed)
    assert prior.cost(x) > 0
    assert prior.gradient(x).dot(x) > 0
    assert prior.cost(x.times(0.0)) == 0.0


@given(st.integers(0, 2**32 - 1))
def test_the_gradient_of_the_belief_equals_finite_differences(seed: int) -> None:
    grid = raster(8)
    prior, x, step = prior_on(grid), random(grid, seed).times(0.1), random(grid, seed + 1).times(1e-5)
    up, down = (prior.cost(x.plus(step, sign)) for sign in (1.0, -1.0))
    assert prior.gradient(x).dot(step) == pytest.approx((up - down) / 2, rel=1e-4, abs=1e-7)


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_the_gaussian_touches_the_belief_in_objects_from_above(here: float, there: float) -> None:
    prior = prior_on(raster(4))
    cost = 0.25 * np.log1p(np.array([here, there, 0.0]) ** 2 / prior.object_height**2)
    precision = prior.object_precision(np.array([here]))[0]
    above = cost[0] + 0.5 * precision * (there**2 - here**2)
    assert above >= cost[1] - 1e-9


def test_an_object_ten_times_as_high_costs_the_weight_times_a_logarithm() -> None:
    grid = raster(8)
    prior, low, high = prior_on(grid), nothing(grid.shape, 61, 3), nothing(grid.shape, 61, 3)
    low.objects[2, 2], high.objects[2, 2] = 0.5, 5.0
    # far above the scale of 0.05 m
    assert prior.cost(high) - prior.cost(low) == pytest.approx(0.5 * np.log(10.0), rel=0.01)


def test_settings_are_factors_on_what_the_dive_says() -> None:
    grid, told = raster(8), PriorConfig(roughness=2.0, reflectivity=2.0)
    prior = make_prior(grid, make_tables(), FLOOR, told)
    np.testing.assert_allclose(prior.background, prior_on(grid).background / 2)
    np.testing.assert_allclose(prior.reflectivity, prior_on(grid).reflectivity / 4)


def test_neighbouring_knots_of_the_beam_deviate_together() -> None:
    covariance = np.linalg.inv(prior_on(raster(8)).beam)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), CONFIG.beam, rtol=1e-3)
    # two knots are 0.07 rad apart, the length
    assert covariance[20, 22] / covariance[20, 20] == pytest.approx(np.exp(-0.5), rel=1e-3)


def wave(grid: Raster, wavelength: float) -> FloatArray:
    y = (np.arange(grid.n_y) + 0.5) * grid.spacing
    return np.broadcast_to(np.cos(2 * np.pi * y / wavelength)[:, None], grid.shape)


def cost(grid: Raster, x: FloatArray) -> FloatArray:
    """What a raster costs as background and as log-reflectivity."""
    prior, zero = prior_on(grid), nothing(grid.shape, 61, 3)
    return np.array([prior.cost(replace(zero, background=x)), prior.cost(replace(zero, log_reflectivity=x))])


@pytest.mark.parametrize("wavelength", [16.0, 32.0, 64.0])
def test_a_wave_costs_the_same_at_any_spacing(wavelength: float) -> None:
    coarse, fine = (cost(grid, wave(grid, wavelength)) for grid in (raster(64, 1.0), raster(128, 0.5)))
    # a difference quotient sees a wave of 16 cells flatter by (pi / 16)^2 / 3 = 1.3 %; twice squared
    np.testing.assert_allclose(coarse, fine, rtol=0.06)


def test_relief_has_the_power_spectrum_of_the_notes() -> None:
    grid, wavelength = raster(128), 32.0
    k2 = (2 * np.pi / wavelength) ** 2
    k2_longest = (2 * np.pi / CONFIG.longest) ** 2
    # a cosine of amplitude 1 holds half an area; its precision is one over the spectrum
    expected = 0.5 * 0.5 * 128.0**2 * (k2 + k2_longest) ** 2 / FLOOR.roughness
    assert cost(grid, wave(grid, wavelength))[0] == pytest.approx(expected, rel=0.02)


def test_reflectivity_varies_by_its_standard_deviation_at_a_place() -> None:
    grid = raster(256)
    prior = prior_on(grid)
    draw = from_cosine(np.random.default_rng(3).standard_normal(grid.shape) / np.sqrt(prior.reflectivity))
    # 256^2 m^2 hold some 80 independent patches of 2 pi (8 m)^2 each way: sd of the variance 10 %
    assert draw.std() == pytest.approx(FLOOR.reflectivity, rel=0.15)
    apart = np.corrcoef(draw[:, :-8].ravel(), draw[:, 8:].ravel())[0, 1]
    # a Matern field of smoothness 1 has correlation K_1(1) = 0.60 at its length
    assert apart == pytest.approx(0.60, abs=0.1)
