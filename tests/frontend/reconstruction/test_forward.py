"""The forward model and its adjoint."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from frontend.frames import rotation_world_body
from frontend.radiometry import Tables
from frontend.reconstruction.forward import Beams, Bins, Raster, coverage, linearise, pull_back, render


def make_tables() -> Tables:
    angle = -0.5 + 0.035 * np.arange(61)
    log_beam = np.stack([-((angle - 1.0) ** 2) / 0.5, -((angle - 0.9) ** 2) / 0.4])
    knots = np.maximum(np.arange(260) * 0.25, 0.5)
    return Tables(log_beam, -0.5, 0.035, -3 * np.log(knots), 0.25, np.array([1e-7, 2e-7]), 2.0)


def make_scene(pitch: float = 0.0, relief: float = 0.5):
    rng = np.random.default_rng(3)
    raster = Raster(70, 30, 1.0, (-5.0, -35.0))
    z = -12.0 + relief * gaussian_filter(rng.standard_normal(raster.shape), 2) * 5
    rho = 0.2 * gaussian_filter(rng.standard_normal(raster.shape), 2) * 5
    n = 6
    rotation = rotation_world_body(rng.normal(0, 0.08, n), np.full(n, pitch), rng.normal(0, 0.1, n))
    sensor = np.repeat(np.stack([np.linspace(2, 18, n), np.zeros(n), np.zeros(n)], axis=1)[:, None], 2, axis=1)
    side = np.stack([rotation[:, :, 1], -rotation[:, :, 1]], axis=1)
    beams = Beams(sensor, rotation[:, :, 0], side, rotation[:, :, 2])
    bins = Bins(np.ones((n, 2, 60)), np.ones((n, 2, 60)), np.full((2, 60), 1e-7), 0.5)
    return z, rho, raster, beams, bins


def test_adjoint_equals_finite_differences():
    z, rho, raster, beams, bins = make_scene()
    tables = make_tables()
    rng = np.random.default_rng(1)
    weight = rng.standard_normal(bins.intensity.shape) / render(z, rho, raster, beams, tables, bins)
    by_height, by_rho = pull_back(z, rho, raster, beams, tables, bins, weight)

    def cost(dz, drho):
        return (weight * render(z + dz, rho + drho, raster, beams, tables, bins)).sum()

    # away from cells where the step changes what is seen, central differences are exact to their own rounding
    step, relative = 1e-6, []
    for gradient, which in ((by_height, 0), (by_rho, 1)):
        order = np.argsort(-np.abs(gradient).ravel())[:200:5]
        for cell in order:
            d = np.zeros(raster.n_cells)
            d[cell] = step
            d = d.reshape(raster.shape)
            zero = np.zeros_like(d)
            up, down = (cost(s * d, zero) if which == 0 else cost(zero, s * d) for s in (1, -1))
            exact = (up - down) / (2 * step)
            relative.append(abs(gradient.ravel()[cell] - exact) / abs(exact))
    assert np.quantile(relative, 0.8) < 1e-6


def test_jacobian_rows_are_the_adjoint_bin_by_bin():
    z, rho, raster, beams, bins = make_scene(pitch=0.1)
    tables = make_tables()
    mu = render(z, rho, raster, beams, tables, bins)
    rows = linearise(z, rho, raster, beams, tables, bins, mu)
    for index in ((2, 0, 40), (3, 1, 35), (0, 1, 50)):
        weight = np.zeros(mu.shape)
        weight[index] = 1.0 / mu[index]
        by_height, by_rho = pull_back(z, rho, raster, beams, tables, bins, weight)
        dense = np.zeros((2, raster.n_cells))
        n = rows.n_cells[index]
        np.add.at(dense[0], rows.cell[index][:n], rows.by_height[index][:n])
        np.add.at(dense[1], rows.cell[index][:n], rows.by_reflectivity[index][:n])
        np.testing.assert_allclose(dense[0], by_height.ravel(), rtol=1e-4, atol=1e-5)  # float32 rows
        np.testing.assert_allclose(dense[1], by_rho.ravel(), rtol=1e-4, atol=1e-5)


def test_water_column_holds_only_the_noise_floor():
    z, rho, raster, beams, bins = make_scene(relief=0.0)
    mu = render(np.full_like(z, -12.0), rho, raster, beams, make_tables(), bins)
    # the first echo comes from 12 m below and is shared with the bin before
    np.testing.assert_array_equal(mu[:, 0, : int(12 / 0.5) - 1], 1e-7)
    assert (mu[:, 0, int(12 / 0.5) + 1] > 1e-6).all()


def test_energy_of_a_flat_floor_matches_the_integral():
    raster = Raster(140, 30, 1.0, (-5.0, -70.0))
    z, rho = np.full(raster.shape, -12.0), np.zeros(raster.shape)
    eye = np.eye(3)[None]
    beams = Beams(np.array([[[10.3, 0.2, 0.0]] * 2]), eye[:, :, 0], np.stack([eye[:, :, 1], -eye[:, :, 1]], 1), eye[:, :, 2])
    bins = Bins(np.ones((1, 2, 100)), np.ones((1, 2, 100)), np.full((2, 100), 1e-7), 0.5)
    tables = make_tables()
    mu = render(z, rho, raster, beams, tables, bins)
    r = np.array([30.25])
    theta = np.arccos(12 / r)
    beam = np.exp(np.interp(theta, -0.5 + 0.035 * np.arange(61), tables.log_beam[0]))
    exact = beam * r**-3 * (12 / r) ** 2 / np.sqrt(1 - (12 / r) ** 2)
    # two samples a bin at a step of a quarter cell: the sharing ripples by a few percent
    assert mu[0, 0, 58:63].mean() == pytest.approx(exact[0] + 1e-7, rel=0.03)


def test_a_wall_casts_a_shadow_as_long_as_the_ray_over_its_crest_says():
    raster = Raster(140, 30, 0.5, (-5.0, -35.0))
    z = np.full(raster.shape, -12.0)
    y = raster.origin[1] + raster.spacing * np.arange(raster.n_y)
    z[(y >= 14.9) & (y <= 15.6)] = -10.0
    eye = np.eye(3)[None]
    beams = Beams(np.array([[[3.2, 0.0, 0.0]] * 2]), eye[:, :, 0], np.stack([eye[:, :, 1], -eye[:, :, 1]], 1), eye[:, :, 2])
    passed, seen = coverage(z, raster, beams, 30.0)
    column = passed.any(axis=0).argmax()
    shadow = y[(passed & ~seen)[:, column] & (y > 0)]
    # the ray over the rear edge (15.5, -10) reaches -12 at 15.5 * 12 / 10 = 18.6 m; a cell seen in part counts as seen
    assert 18.6 - 0.75 <= shadow.max() <= 18.6
    assert shadow.min() == pytest.approx(16.0, abs=0.5)
