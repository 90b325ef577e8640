"""Beliefs about relief and reflectivity: their spectra, and that they are the same on every grid."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.fft import dct

from frontend.arrays import FloatArray
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.priors import PriorConfig, from_cosine, make_prior, to_cosine, wavenumbers

CONFIG = PriorConfig()


def raster(n: int = 64, spacing: float = 1.0) -> Raster:
    return Raster(n, n, spacing, (0.0, 0.0))


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
    prior = make_prior(grid, CONFIG)
    basis = np.kron(cosine_basis(9), cosine_basis(7))  # rows: basis functions on the raveled raster
    for k, precision in enumerate((prior.height, prior.reflectivity)):
        covariance = basis.T @ np.diag(1 / precision.ravel()) @ basis
        applied = []
        for cell in np.eye(grid.n_cells):
            x = np.zeros((2, *grid.shape))
            x[k] = (covariance @ cell).reshape(grid.shape)
            applied.append(prior.apply(x)[k].ravel())
        np.testing.assert_allclose(applied, np.eye(grid.n_cells), atol=1e-9)  # condition number 1e4


@given(st.integers(0, 2**32 - 1))
def test_every_surface_that_is_not_expected_costs_something(seed: int) -> None:
    prior = make_prior(raster(8), CONFIG)
    x = np.random.default_rng(seed).standard_normal((2, 8, 8))
    assert (x * prior.apply(x)).sum() > 0


def wave(grid: Raster, wavelength: float) -> FloatArray:
    y = (np.arange(grid.n_y) + 0.5) * grid.spacing
    return np.broadcast_to(np.cos(2 * np.pi * y / wavelength)[:, None], grid.shape)


def cost(grid: Raster, x: FloatArray) -> FloatArray:
    """Half a square by the prior, of heights and of log-reflectivities."""
    prior = make_prior(grid, CONFIG)
    both = np.stack([x, x])
    return np.asarray(0.5 * (both * prior.apply(both)).sum(axis=(1, 2)))


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
    expected = 0.5 * 0.5 * 128.0**2 * (k2 + k2_longest) ** 2 / CONFIG.roughness
    assert cost(grid, wave(grid, wavelength))[0] == pytest.approx(expected, rel=0.02)


def test_reflectivity_varies_by_its_standard_deviation_at_a_place() -> None:
    grid = raster(256)
    prior = make_prior(grid, CONFIG)
    draw = from_cosine(np.random.default_rng(3).standard_normal(grid.shape) / np.sqrt(prior.reflectivity))
    # 256^2 m^2 hold some 80 independent patches of 2 pi (8 m)^2 each way: sd of the variance 10 %
    assert draw.std() == pytest.approx(CONFIG.reflectivity, rel=0.15)
    apart = np.corrcoef(draw[:, :-8].ravel(), draw[:, 8:].ravel())[0, 1]
    # a Matern field of smoothness 1 has correlation K_1(1) = 0.60 at its length
    assert apart == pytest.approx(0.60, abs=0.1)


def test_both_precisions_as_one_array() -> None:
    prior = make_prior(raster(6), CONFIG)
    np.testing.assert_array_equal(prior.precision[0], prior.height)
    np.testing.assert_array_equal(prior.precision[1], prior.reflectivity)
