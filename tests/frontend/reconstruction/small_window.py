"""A few lines over a small surface: cheap enough to differentiate by hand."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.sparse import csr_array

from frontend.arrays import FloatArray
from frontend.frames import rotation_world_body
from frontend.radiometry import Seafloor, Tables
from frontend.reconstruction.forward import Beams, Bins, Raster
from frontend.reconstruction.measured_heights import MeasuredHeights
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.priors import PriorConfig, make_prior
from frontend.reconstruction.unknowns import Unknowns, nothing


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
    under_way = (np.full(n, 1e-3), np.linspace(-5e-5, 5e-5, n))  # 1.5 m/s, up to 4 degrees a second
    beams = Beams(sensor, rotation[:, :, 0], side, rotation[:, :, 2], *under_way)
    bins = Bins(np.ones((n, 2, 60)), np.ones((n, 2, 60)), np.full((2, 60), 1e-7), 0.5)
    return z, rho, raster, beams, bins


def make_altimeter(raster: Raster) -> MeasuredHeights:
    """Four heights under the track, each between two cells."""
    row, column = 35, np.array([7, 11, 15, 20])
    places = np.stack([row * raster.n_x + column, row * raster.n_x + column + 1], axis=1)
    weights = csr_array((np.full(8, 0.5), (np.repeat(np.arange(4), 2), places.ravel())), shape=(4, raster.n_cells))
    return MeasuredHeights(weights, np.array([-11.8, -12.1, -12.0, -12.3]), np.array([4.0, 8.0, 4.0, 2.0]))


def make_posterior(looks: float = 4.0, tail: float = 20.0, relief: float = 0.1) -> tuple[Posterior, Unknowns]:
    """A posterior whose echoes were drawn with so many looks from the unknowns that come with it."""
    z, rho, raster, beams, bins = make_scene(relief=relief)
    tables, rng = make_tables(), np.random.default_rng(5)
    boulders = np.where(rng.uniform(size=z.shape) < 0.01, 0.4, 0.0)
    beam, gain = 0.03 * np.sin(0.3 * np.arange(61)) * np.array([[1.0], [-1.0]]), rng.normal(0, 0.02, (6, 2))
    x = Unknowns(z + 12.0, boulders, rho, beam, gain)
    expected, aside = np.full(raster.shape, -12.0), np.zeros(bins.looks.shape)
    prior = make_prior(raster, tables, Seafloor(0.1, 0.1, 8.0), PriorConfig())
    empty = Posterior(raster, beams, tables, bins, prior, expected, make_altimeter(raster), tail, aside, 0.0 * z)
    mu = empty.predict(x)
    echoes = mu * rng.gamma(max(looks, 1.0), 1 / max(looks, 1.0), mu.shape)
    return replace(empty, bins=replace(bins, intensity=echoes, looks=np.full(mu.shape, looks))), x


def make_direction(posterior: Posterior, rng: np.random.Generator) -> Unknowns:
    """A random direction as coordinates, each part about as long as belief lets it be."""
    prior, origin = posterior.prior, posterior.origin()
    parts = prior.draw(prior.object_precision(origin.objects), len(origin.gain), rng)
    covariance = np.linalg.inv(prior.beam)
    return Unknowns(
        parts.background / prior.background,
        parts.objects / prior.object_precision(origin.objects),
        parts.log_reflectivity / prior.reflectivity,
        parts.beam @ covariance,
        parts.gain / prior.gain,
    )


def only(name: str, x: Unknowns) -> Unknowns:
    """One part of a direction, the others zero."""
    return replace(nothing(x.background.shape, x.beam.shape[1], len(x.gain)), **{name: getattr(x, name)})
