"""Stacked images of known floors: the exact adjoint, descent that cannot diverge, and what a straight track means."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from frontend.arrays import BoolArray, FloatArray
from frontend.bottom import Bottom
from frontend.radiometry import Radiometry, RadiometryConfig, estimate_radiometry
from frontend.reconstruction import CoirasConfig, ReconstructionConfig, method_of
from frontend.reconstruction.coiras import height_sigma, reconstruct, shape_from_image
from frontend.reconstruction.ground_image import (
    GroundImage,
    ImageConfig,
    ground_image,
    shadow_image,
    stacked,
    straight_course,
)
from frontend.reconstruction.image_cost import DescentConfig, Estimate, ImageCost
from frontend.reconstruction.image_descent import descend, stop_watch, upsampled
from frontend.reconstruction.image_pyramid import pyramid
from frontend.reconstruction.window_data import WindowData, window_data
from frontend.recording import Quantity, Recording
from frontend.windows import Window
from tests.frontend.flat_floor import FlatFloor

CONFIG = CoirasConfig(spacing=1.0)
FLOOR = FlatFloor(np.full(120, 12.0), strength=1e8)


def image_of(level: FloatArray, exponent: float = 2.0, altitude: float = 12.0, looks: float = 20.0) -> GroundImage:
    """An image of rows and columns 1 m apart, seen from some height [m] above 0."""
    n_y = level.shape[1]
    heights = np.full(n_y, altitude), np.zeros(n_y)
    return GroundImage(level, np.full(level.shape, looks), 100.0, *heights, (1.0, 1.0), exponent)


def lit(shape: tuple[int, ...]) -> BoolArray:
    return np.zeros(shape, dtype=bool)


def never() -> bool:
    return False


def rough_case(exponent: float, seed: int = 2) -> tuple[ImageCost, Estimate]:
    """A noisy image with a shadow and gaps, and an estimate that is far from explaining it."""
    rng = np.random.default_rng(seed)
    shape = (2, 6, 9)
    image = image_of(rng.gamma(2.0, 0.5, shape), exponent)
    image = replace(
        image,
        looks=np.where(rng.random(shape) < 0.2, 0.0, image.looks),
        nadir_height=rng.normal(0, 0.2, 6),
        sensor_height=12.0 + rng.normal(0, 0.1, 6),
        spacing=(0.7, 1.3),
    )
    cost = ImageCost(image, rng.random(shape) < 0.1, DescentConfig(), rng.normal(0, 0.2, shape))
    start = cost.start
    estimate = Estimate(
        start.height + rng.normal(0, 0.3, shape), rng.normal(0, 0.2, shape), rng.normal(0, 0.1, start.beam.shape)
    )
    return cost, estimate


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("part", ["height", "reflectivity", "beam"])
def test_the_gradient_is_that_of_central_differences(part: str, exponent: float) -> None:
    cost, estimate = rough_case(exponent)
    assert (cost.cosine(estimate.height)[0] > 0.05).all()  # away from the edge where facets begin to look away
    gradient, values = getattr(cost.gradient(estimate), part), getattr(estimate, part)
    numeric = np.empty_like(values)
    step = 1e-5
    for place in np.ndindex(values.shape):
        shift = np.zeros_like(values)
        shift[place] = step
        above, below = (cost(replace(estimate, **{part: values + sign * shift})) for sign in (1, -1))
        numeric[place] = (above - below) / (2 * step)
    np.testing.assert_allclose(gradient, numeric, rtol=1e-6, atol=1e-6 * np.abs(numeric).max())


def test_a_facet_that_looks_away_is_dark_and_draws_on_nothing() -> None:
    cost, _ = rough_case(1.0)
    cliff = cost.start.height.copy()
    cliff[:, :, 5:] -= 30.0
    cosine, *derivatives = cost.cosine(cliff)
    assert (cosine[:, :, 5] == 0).all()
    assert all((part[:, :, 5] == 0).all() for part in derivatives)


def test_a_flat_floor_with_even_reflectivity_is_level_one() -> None:
    cost = ImageCost(image_of(np.ones((2, 5, 30))), lit((2, 5, 30)), DescentConfig())
    np.testing.assert_allclose(cost.predict(cost.start), 1.0, atol=1e-12)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.0, 1e6), st.floats(1.0, 4.0))
def test_cost_falls_monotonically_and_nothing_diverges(seed: int, spike: float, exponent: float) -> None:
    rng = np.random.default_rng(seed)
    level = rng.exponential(1.0, (2, 12, 20))
    level[0, 3, 7], level[1, 8] = spike, 0.0
    image = image_of(level, exponent)
    relief = shape_from_image(image, level < 0.1, CONFIG)
    for costs in relief.costs:
        assert all(after <= before for before, after in pairwise(costs))
    # a floor above the sonar would be one that a descent has thrown away
    assert (relief.estimate.height < image.sensor_height[:, None]).all()
    assert np.isfinite(relief.estimate.height).all()


def bright_bump(exponent: float = 2.0) -> tuple[GroundImage, FloatArray]:
    """The image that the model itself gives of a mound, and the mound."""
    y, x = np.meshgrid(np.arange(40.0), np.arange(44.0), indexing="ij")
    mound = np.stack([0.8 * np.exp(-((x - 25) ** 2 + (y - 20) ** 2) / 40)] * 2)
    cost = ImageCost(image_of(np.ones(mound.shape), exponent), lit(mound.shape), DescentConfig())
    return image_of(cost.predict(replace(cost.start, height=mound)), exponent), mound


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_a_mound_comes_back_from_its_own_image(exponent: float) -> None:
    image, mound = bright_bump(exponent)
    height = shape_from_image(image, lit(mound.shape), CONFIG).estimate.height
    # what is smooth could be reflectivity: its prior takes a part, the shape remains
    assert np.corrcoef(height.ravel(), mound.ravel())[0, 1] > 0.85
    peak = np.unravel_index(np.argmax(height[0]), mound[0].shape)
    assert np.hypot(peak[0] - 20, peak[1] - 25) <= 3


def test_a_shadow_is_filled_with_the_reflectivity_around_it_and_the_floor_there_is_tangent_to_the_beam() -> None:
    level = np.ones((2, 24, 40))
    level[:, :, 20:23] = 0.0
    is_shadow = level == 0
    image = image_of(level)
    told, untold = (shape_from_image(image, shadow, CONFIG).estimate for shadow in (is_shadow, lit(level.shape)))
    inside = (slice(None), slice(6, 18), slice(20, 23))
    around = told.reflectivity[:, 6:18, 14:18].mean()
    assert abs(told.reflectivity[inside].mean() - around) < 0.5 * abs(untold.reflectivity[inside].mean() - around)
    cost = ImageCost(image, is_shadow, DescentConfig())
    cosine, flat = (cost.cosine(height)[0][inside].mean() for height in (told.height, cost.start.height))
    assert cosine < 0.7 * flat  # of the way to grazing that smoothness allows over three pixels


def test_a_shadow_map_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"a shadow map like the image, \(2, 40, 44\), wanted, got \(2, 3, 3\)"):
        shape_from_image(bright_bump()[0], lit((2, 3, 3)), CONFIG)


def test_time_that_is_up_leaves_the_result_as_it_stands() -> None:
    image, mound = bright_bump()
    cost = ImageCost(image, lit(mound.shape), DescentConfig())
    calls = iter([False] * 7 + [True])
    estimate, costs = descend(cost, cost.start, lambda: next(calls))
    assert len(costs) == 3  # the start and two whole iterations of three parts
    assert cost(estimate) <= costs[-1] < costs[0]
    rushed = CONFIG.model_copy(update={"descent": DescentConfig(deadline=1e-9)})
    np.testing.assert_array_equal(shape_from_image(image, lit(mound.shape), rushed).estimate.height, 0.0)


def test_an_iteration_moves_no_height_farther_than_it_may() -> None:
    image, mound = bright_bump()
    once = DescentConfig(n_iterations=1, largest_step=0.02)
    cost = ImageCost(replace(image, level=3 * image.level), lit(mound.shape), once)
    moved = np.abs(descend(cost, cost.start, never)[0].height - cost.start.height).max()
    assert 0 < moved <= 0.02 + 1e-12  # of pixels of 1 m


def test_a_deadline_passes() -> None:
    assert stop_watch(1e-9)()
    assert not stop_watch(1e6)()


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 6))
def test_a_pyramid_halves_and_keeps_the_mean(n_y: int, n_x: int, n_levels: int) -> None:
    level = np.random.default_rng(n_y).gamma(4.0, 0.25, (2, n_y, n_x))
    levels = pyramid(image_of(level), level < 0.1, n_levels)
    assert 1 <= len(levels) <= n_levels
    for (coarse, coarse_shadow), (fine, _) in pairwise(levels):
        assert tuple(2 * n for n in coarse.level.shape[1:]) == fine.level.shape[1:]
        assert coarse_shadow.shape == coarse.level.shape
        assert coarse.spacing == (2 * fine.spacing[0], 2 * fine.spacing[1])
    for image, _ in levels:
        assert np.sum(image.looks * image.level) == pytest.approx(np.sum(20.0 * level))


def test_upsampling_keeps_a_slope_where_it_is() -> None:
    image = image_of(np.ones((2, 16, 16)))
    (coarse, _), (fine, _) = pyramid(image, lit((2, 16, 16)), 2)
    costs = [ImageCost(level, lit(level.level.shape), DescentConfig()) for level in (coarse, fine)]
    slope = 0.1 * np.broadcast_to(costs[0].image.ground_range, (2, 8, 8))
    finer = upsampled(replace(costs[0].start, height=slope), costs[1]).height
    np.testing.assert_allclose(finer[:, :, 1:-1], 0.1 * fine.ground_range[1:-1] + 0 * finer[:, :, 1:-1], atol=1e-12)


def known(recording: Recording, quantity: Quantity = Quantity.INTENSITY) -> tuple[Bottom, Radiometry]:
    bottom = Bottom(np.full((recording.n_pings, 2), 12.0), np.full(recording.n_pings, 12.0), 1.0)
    stated = replace(recording, sonar=replace(recording.sonar, quantity=quantity))
    return bottom, estimate_radiometry(stated, bottom, RadiometryConfig())


@pytest.fixture(scope="module")
def flat() -> Recording:
    """A flat floor under a straight track, single looks."""
    return FLOOR.record(np.random.default_rng(1), Quantity.INTENSITY)


def whole(recording: Recording) -> Window:
    return Window(0, 0, recording.n_pings, recording.n_pings // 2)


def data_of(recording: Recording) -> tuple[WindowData, Radiometry]:
    bottom, radiometry = known(recording)
    return window_data(recording, whole(recording), bottom, radiometry), radiometry


def test_an_echo_at_slant_range_five_seen_from_three_up_lies_four_out(flat: Recording) -> None:
    data, _ = data_of(flat)
    data = replace(data, altitude=np.full(len(data.altitude), 3.0))
    echoes = np.zeros(data.intensity.shape)
    echoes[:, 1, 97:103] = 1.0  # 4.85 to 5.15 m, which is 3.81 to 4.19 m on the ground
    sums = stacked(echoes, data, 0.2)
    np.testing.assert_allclose(sums[0], 0.0)
    assert (np.flatnonzero(sums[1, 0]) == [19, 20]).all()
    assert sums[1].sum() == pytest.approx(6 * len(echoes))
    assert (np.flatnonzero(shadow_image(echoes > 0, data, 0.2)[1, 0]) == [19, 20]).all()


@pytest.mark.parametrize(("quantity", "exponent"), [(Quantity.INTENSITY, 2.0), (Quantity.AMPLITUDE, 1.0)])
def test_the_exponent_follows_what_was_recorded(flat: Recording, quantity: Quantity, exponent: float) -> None:
    echoes = (np.sqrt(side) if quantity == Quantity.AMPLITUDE else side for side in (flat.port, flat.starboard))
    port, starboard = echoes
    recording = replace(flat, port=port, starboard=starboard)
    bottom, radiometry = known(recording, quantity)
    data = window_data(recording, whole(recording), bottom, radiometry)
    assert ground_image(data, radiometry, 1.0, ImageConfig()).exponent == exponent
    other = ImageConfig(exponent_intensity=3.0, exponent_amplitude=1.5)
    assert ground_image(data, radiometry, 1.0, other).exponent == 1.5 * exponent
    submap = reconstruct(recording, whole(recording), bottom, radiometry, CONFIG)
    height = submap.surface.z[submap.is_known]
    # single-look speckle of some fifty samples a pixel; the bound is a tenth of what a wrong exponent would shift
    assert abs(height.mean() + 12.0) < 0.1
    assert height.std() < 0.15


def test_a_level_that_is_flat_is_one_whatever_the_recorder_multiplied_it_with(flat: Recording) -> None:
    for factor in (1.0, 1e-6, 1e9):
        louder = replace(flat, port=flat.port * np.float32(factor), starboard=flat.starboard * np.float32(factor))
        data, radiometry = data_of(louder)
        image = ground_image(data, radiometry, 1.0, ImageConfig())
        assert image.level[image.looks > 0].mean() == pytest.approx(1.0, abs=0.02)


def test_the_same_input_gives_the_same_bytes_and_is_not_changed(flat: Recording) -> None:
    before = flat.port.copy()
    once, again = (reconstruct(flat, whole(flat), *known(flat), CONFIG) for _ in range(2))
    assert once.surface.z.tobytes() == again.surface.z.tobytes()
    assert once.sigma.tobytes() == again.sigma.tobytes()
    np.testing.assert_array_equal(flat.port, before)


def test_the_track_is_taken_for_straight_and_the_vehicle_for_level(flat: Recording) -> None:
    n = flat.n_pings
    swayed = replace(
        flat.trajectory_dr,
        roll=0.1 * np.sin(np.arange(n)),
        pitch=0.1 * np.cos(np.arange(n)),
        yaw=0.2 * np.sin(0.3 * (np.arange(n) - n // 2)),
    )
    straight, wild = (data_of(replace(flat, trajectory_dr=track)) for track in (flat.trajectory_dr, swayed))
    images = [ground_image(data, radiometry, 1.0, ImageConfig()).level for data, radiometry in (straight, wild)]
    # the dive's radiometry knows of the roll, the image does not: the same but for the pattern
    assert np.corrcoef(images[0].ravel(), images[1].ravel())[0, 1] > 0.9


@pytest.mark.parametrize("crab", [0.0, 0.4, -1.0])
def test_a_vehicle_that_crabs_sees_beside_its_course(flat: Recording, crab: float) -> None:
    track = flat.trajectory_dr
    recording = replace(flat, trajectory_dr=replace(track, yaw=track.yaw + crab))
    data, _ = data_of(recording)
    np.testing.assert_allclose(straight_course(data).direction, [np.cos(crab), -np.sin(crab)], atol=1e-12)
    bright = flat.port.copy()
    bright[55:66, 560:590] *= 4  # 28 to 29.5 m slant range: about 26 m beside ping 60
    recording = replace(recording, port=bright)
    submap = reconstruct(recording, whole(recording), *known(recording), CONFIG)
    bright = gaussian_filter(np.nan_to_num(submap.log_reflectivity), 2)
    y, x = np.unravel_index(np.argmax(bright), bright.shape)
    place = np.array([submap.surface.x[x], submap.surface.y[y]])
    np.testing.assert_allclose(place, 26.0 * np.array([np.sin(crab), np.cos(crab)]), atol=3.0)  # reflectivity is smooth


def test_heave_does_not_bend_the_floor() -> None:
    altitude = 12.0 + 0.5 * np.sin(0.04 * np.arange(120))
    floor = FlatFloor(altitude, strength=1e8)
    recording = floor.record(np.random.default_rng(3), Quantity.INTENSITY)
    recording = replace(recording, trajectory_dr=replace(recording.trajectory_dr, z=altitude - 42.0), altitude=altitude)
    bottom = Bottom(np.stack([altitude, altitude], axis=1), altitude, 1.0)
    radiometry = estimate_radiometry(recording, bottom, RadiometryConfig())
    submap = reconstruct(recording, whole(recording), bottom, radiometry, CONFIG)
    world = submap.points[:, 2] + submap.T_world_submap_dr[2, 3]
    assert abs(world.mean() + 42.0) < 0.1
    assert world.std() < 0.15  # as of a flat floor seen without heave; its 0.4 m rms would show


def test_sigma_is_positive_and_grows_away_from_the_track(flat: Recording) -> None:
    data, radiometry = data_of(flat)
    image = ground_image(data, radiometry, 1.0, ImageConfig())
    sigma = height_sigma(shape_from_image(image, lit(image.level.shape), CONFIG), CONFIG)
    assert (sigma > 0).all()
    assert (np.diff(sigma, axis=2) >= 0).all()
    twice = CONFIG.model_copy(update={"sigma_factor": 2 * CONFIG.sigma_factor})
    np.testing.assert_allclose(height_sigma(shape_from_image(image, lit(image.level.shape), CONFIG), twice), 2 * sigma)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_a_few_pings_make_a_submap(flat: Recording, n: int) -> None:
    bottom, radiometry = known(flat)
    submap = reconstruct(flat, Window(3, 10, 10 + n, 10), bottom, radiometry, CONFIG)
    assert submap.number == 3
    assert np.isfinite(submap.surface.z[submap.is_known]).all()


def test_a_vehicle_at_rest_and_a_silent_side_do_no_harm(flat: Recording) -> None:
    track = flat.trajectory_dr
    still = replace(track, x=0.0 * track.x, y=0.0 * track.y)
    silent = replace(flat, trajectory_dr=still, port=np.full_like(flat.port, np.nan))
    submap = reconstruct(silent, whole(silent), *known(flat), CONFIG)
    assert np.isfinite(submap.surface.z[submap.is_known]).all()
    np.testing.assert_allclose(straight_course(data_of(silent)[0]).direction, [1.0, 0.0])


def test_a_range_that_does_not_reach_the_floor_is_refused(flat: Recording) -> None:
    bottom, radiometry = known(flat)
    high = Bottom(bottom.first_bottom_return, bottom.altitude + 60.0, 1.0)
    with pytest.raises(ValueError, match="a slant range of 45 m and an altitude of 72 m given: a range beyond it"):
        reconstruct(flat, whole(flat), high, radiometry, CONFIG)


def test_an_image_that_fits_in_no_memory_is_refused(flat: Recording) -> None:
    data, _ = data_of(flat)
    with pytest.raises(ValueError, match="pixels of 1e-06 m given, at most 2e"):
        stacked(data.intensity, data, 1e-6)


def test_coiras_is_a_method_by_its_name(flat: Recording) -> None:
    config = ReconstructionConfig(method="coiras", coiras=CONFIG)
    named = method_of(config)(flat, whole(flat), *known(flat))
    direct = reconstruct(flat, whole(flat), *known(flat), CONFIG)
    np.testing.assert_array_equal(named.surface.z, direct.surface.z)
