"""A few lines over a small surface: cheap enough to differentiate by hand."""

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.sparse import csr_array

from frontend.arrays import FloatArray
from frontend.frames import rotation_world_body
from frontend.radiometry import Tables
from frontend.reconstruction.forward import Beams, Bins, Raster, render
from frontend.reconstruction.posterior import Altimeter, Posterior
from frontend.reconstruction.priors import PriorConfig, make_prior


def make_tables() -> Tables:
    """Beam patterns that differ from side to side, spreading, different noise."""
    angle = -0.5 + 0.035 * np.arange(61)
    log_beam = np.stack([-((angle - 1.0) ** 2) / 0.5, -((angle - 0.9) ** 2) / 0.4])
    knots = np.maximum(np.arange(260) * 0.25, 0.5)
    return Tables(log_beam, -0.5, 0.035, -3 * np.log(knots), 0.25, np.array([1e-7, 2e-7]), 2.0)


def make_scene(pitch: float = 0.0, relief: float = 0.5) -> tuple[FloatArray, FloatArray, Raster, Beams, Bins]:
    """Heights, log-reflectivity, raster, beams and bins of six lines 12 m above a rough floor."""
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


def make_altimeter(raster: Raster) -> Altimeter:
    """Four heights under the track, each between two cells."""
    row, column = 35, np.array([7, 11, 15, 20])
    places = np.stack([row * raster.n_x + column, row * raster.n_x + column + 1], axis=1)
    weights = csr_array((np.full(8, 0.5), (np.repeat(np.arange(4), 2), places.ravel())), shape=(4, raster.n_cells))
    return Altimeter(weights, np.array([-11.8, -12.1, -12.0, -12.3]), np.array([4.0, 8.0, 4.0, 2.0]))


def make_posterior(looks: float = 4.0, tail: float = 20.0, relief: float = 0.1) -> tuple[Posterior, FloatArray]:
    """A posterior whose echoes were drawn with so many looks from the state that comes with it."""
    z, rho, raster, beams, bins = make_scene(relief=relief)
    tables, state = make_tables(), np.stack([z, rho])
    mu = render(z, rho, raster, beams, tables, bins)
    echoes = mu * np.random.default_rng(5).gamma(max(looks, 1.0), 1 / max(looks, 1.0), mu.shape)
    seen = Bins(echoes, np.full(mu.shape, looks), bins.floor, bins.width)
    expected = np.stack([np.full(raster.shape, -12.0), np.zeros(raster.shape)])
    prior = make_prior(raster, PriorConfig())
    return Posterior(raster, beams, tables, seen, prior, expected, make_altimeter(raster), tail), state
