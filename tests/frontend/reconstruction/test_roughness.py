"""The belief about a window's relief follows the window, and only where the window tells."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.sparse import csr_array

from frontend.arrays import FloatArray
from frontend.radiometry import Seafloor
from frontend.reconstruction.forward import Beams, Bins, Raster, render
from frontend.reconstruction.measured_heights import MeasuredHeights
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.priors import PriorConfig, make_prior, relief_spectrum, wavenumbers
from frontend.reconstruction.roughness import Roughness, RoughnessConfig, believing, learn_roughness
from frontend.reconstruction.solver import SolverConfig
from frontend.reconstruction.unknowns import from_cosine
from tests.frontend.reconstruction.small_window import make_tables

CONFIG, SOLVER = RoughnessConfig(), SolverConfig()
RASTER = Raster(30, 32, 4.0, (-4.0, -60.0))  # 120 by 128 m
FLOOR = Seafloor(roughness=0.01, reflectivity=0.1, length=8.0)


def place() -> tuple[FloatArray, FloatArray]:
    """Coordinates of the cells [m]: along the track, across it."""
    x, y = np.meshgrid(RASTER.spacing * np.arange(RASTER.n_x), RASTER.spacing * np.arange(RASTER.n_y))
    return x, y


def drawn(roughness: float, seed: int = 1) -> FloatArray:
    """Relief of so much roughness [m]."""
    density = relief_spectrum(np.add(*wavenumbers(RASTER)), roughness, PriorConfig().longest) / RASTER.spacing**2
    return np.asarray(from_cosine(np.random.default_rng(seed).standard_normal(RASTER.shape) * np.sqrt(density)))


def seen(relief: FloatArray, looks: float = 6.0) -> Posterior:
    """Thirty lines along the raster, 12 m above some relief on a flat floor."""
    n = 30
    sensor = np.zeros((n, 2, 3))
    sensor[..., 0] = 4.0 * np.arange(n)[:, None]
    forward, up = np.tile([1.0, 0.0, 0.0], (n, 1)), np.tile([0.0, 0.0, 1.0], (n, 1))
    beams = Beams(
        sensor, forward, np.tile([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]], (n, 1, 1)), up, np.zeros(n), np.zeros(n)
    )
    bins = Bins(np.ones((n, 2, 26)), np.full((n, 2, 26), looks), np.full((2, 26), 1e-9), 2.0)
    tables = make_tables()
    mu = render(relief - 12.0, np.zeros(RASTER.shape), RASTER, beams, tables, bins)
    bins = replace(bins, intensity=mu * np.random.default_rng(2).gamma(6.0, 1 / 6.0, mu.shape))
    prior = make_prior(RASTER, tables, FLOOR, PriorConfig())
    nothing_below = MeasuredHeights(csr_array((1, RASTER.n_cells)), np.zeros(1), np.zeros(1))
    surface = np.full(RASTER.shape, -12.0)
    return Posterior(
        RASTER, beams, tables, bins, prior, surface, nothing_below, 20.0, np.zeros(mu.shape), np.zeros(RASTER.shape)
    )


def learnt(relief: FloatArray) -> FloatArray:
    return learn_roughness(seen(relief), CONFIG, SOLVER).factor


def half_waves(wavelength: float, length: float) -> int:
    """Index of the cosine coefficient of a wavelength."""
    return round(2 * length / wavelength)


def test_a_window_that_tells_nothing_keeps_the_belief_of_the_dive() -> None:
    blind = seen(drawn(0.3), looks=0.0)
    np.testing.assert_array_equal(learn_roughness(blind, CONFIG, SOLVER).factor, 1.0)


def test_without_a_round_the_belief_of_the_dive_stays() -> None:
    posterior = seen(drawn(0.3))
    roughness = learn_roughness(posterior, RoughnessConfig(n_rounds=0), SOLVER)
    np.testing.assert_array_equal(believing(posterior, roughness).prior.background, posterior.prior.background)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_floor_as_rough_as_believed_is_believed_so_still(seed: int) -> None:
    factor = learnt(drawn(FLOOR.roughness, seed))
    # sums over 57 neighbours, a part of them told: a factor of two is more than two standard deviations; on the low
    # side only the setting bounds it, for reflectivity explains a part of what relief shades
    assert factor.max() < 2.0


def test_a_rougher_floor_is_believed_rougher_where_it_is_told() -> None:
    told = (slice(2, 9), slice(0, 4))  # waves of 27 m and longer, most of them across the track: those shade most
    rough, same = (
        np.mean([learnt(drawn(times * FLOOR.roughness, seed))[told].mean() for seed in (1, 2, 3)]) for times in (10, 1)
    )
    # 28 waves of three floors, half of them told: a standard deviation of a fifth; patches take a share, never add one
    assert 2.5 < rough < 15
    assert 0.3 < same < 1.5


def test_a_ripple_is_believed_in_where_its_wave_is_and_nowhere_else() -> None:
    _, y = place()
    factor = learnt(0.8 * np.sin(2 * np.pi * y / 24.0))
    row = half_waves(24.0, 120.0)
    assert factor[row, 0] > 10
    # waves along the track, many widths of the average away
    assert factor[:, 20:].max() < 1.5
    assert np.argmax(factor[:, 0]) == pytest.approx(row, abs=2)  # the average is three coefficients wide


def test_a_groove_along_the_track_is_a_wave_that_all_lines_share() -> None:
    _, y = place()
    factor = learnt(np.where(np.abs(y - 90.0) < 12.0, (y - 78.0) / 8.0, 0.0))  # 3 m over 24 m, then a drop
    assert factor[:10, 0].max() > 5
    assert factor[:10, 0].mean() > 5 * factor[0, 10:20].mean()


def test_a_boulder_or_two_roughen_no_floor() -> None:
    stony = drawn(FLOOR.roughness)
    stony[6, 10] += 0.25  # a stone of 1 m by 2 m, 2 m high, in a cell of 4 m by 4 m
    stony[22, 20] += 0.25
    assert learnt(stony).max() < 3.0


def test_factors_keep_their_bounds() -> None:
    narrow = RoughnessConfig(least=0.9, most=2.0)
    factor = learn_roughness(seen(drawn(1.0)), narrow, SOLVER).factor
    assert factor.min() >= 0.9
    assert factor.max() == 2.0


def test_looking_changes_no_argument_and_gives_the_same_again() -> None:
    posterior = seen(drawn(0.1))
    before = posterior.prior.background.copy()
    first, again = (learn_roughness(posterior, CONFIG, SOLVER).factor for _ in range(2))
    np.testing.assert_array_equal(posterior.prior.background, before)
    assert posterior.prior.object_height == PriorConfig().object_height * RASTER.spacing
    assert first.tobytes() == again.tobytes()


@given(st.integers(0, 2**32 - 1))
def test_on_its_own_grid_a_belief_is_itself(seed: int) -> None:
    roughness = Roughness(RASTER, np.exp(np.random.default_rng(seed).normal(0, 2, RASTER.shape)))
    np.testing.assert_allclose(roughness.on(RASTER), roughness.factor, rtol=1e-12)


def test_a_wave_keeps_its_factor_on_a_finer_grid_and_shorter_ones_keep_the_belief() -> None:
    factor = np.ones(RASTER.shape)
    factor[10, 4] = 50.0
    fine = Raster(119, 130, 1.0, (-4.0, -60.0))  # a little shorter one way, a little longer the other
    found = Roughness(RASTER, factor).on(fine)
    assert found.shape == fine.shape
    assert np.unravel_index(np.argmax(found), found.shape) == (10, 4)
    # a wave of 24 m lies a twelfth of a coefficient off: what linear interpolation of logarithms leaves
    assert found[10, 4] == pytest.approx(50.0 ** (1 - 10 / 119 - 4 / 64), rel=0.1)
    np.testing.assert_array_equal(found[31:], 1.0)


@pytest.mark.parametrize("wrong", [{"n_rounds": -1}, {"least": 1.5}, {"most": 0.5}, {"width": 0.0}, {"evidence": 0.0}])
def test_settings_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        RoughnessConfig.model_validate(wrong)
