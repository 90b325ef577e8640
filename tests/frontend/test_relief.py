from dataclasses import replace

import numpy as np
import pytest

from frontend.relief import Relief, ReliefConfig, band_pass, block_means, correlation_area, extract_relief
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor


def raster(z, weight=None, spacing=1.0):
    z = np.asarray(z, dtype=np.float64)
    weight = np.ones_like(z) if weight is None else weight
    return Relief(z, weight, z, z, np.ones_like(z), spacing, (0.0, 0.0))


def rough_submap(seed=0):
    rng = np.random.default_rng(seed)
    return cut_submap(rough_seafloor(rng), (150.0, 150.0, 0.3), rng)


def gain(wavelength, config, direction=(0.6, 0.8)):
    """Amplitude that passes, far from the edges, of a wave."""
    y, x = np.mgrid[0:240, 0:240]
    z = np.sin(2 * np.pi * (direction[0] * x + direction[1] * y) / wavelength)
    passed = band_pass(z, np.ones_like(z), 1.0, config)[60:180, 60:180]
    return np.sqrt(2 * np.mean(passed**2))


def test_half_of_the_longest_wave_passes_in_every_direction():
    config = ReliefConfig(longest=20.0, longest_across=1e3)
    assert gain(20.0, config) == pytest.approx(0.5, abs=0.02)
    assert gain(20.0, config, (-0.6, 0.8)) == pytest.approx(0.5, abs=0.02)
    assert gain(20.0, config, (0.0, 1.0)) == pytest.approx(0.5, abs=0.02)


def test_half_of_the_shortest_wave_passes():
    config = ReliefConfig(longest=60.0, longest_across=1e3, shortest=6.0)
    assert gain(6.0, config) == pytest.approx(0.5, abs=0.02)


def test_waves_inside_the_band_pass_and_long_ones_do_not():
    config = ReliefConfig(longest=20.0)
    assert gain(8.0, config) > 0.9
    assert gain(100.0, config) < 0.05


def test_streaks_across_the_track_go_and_ridges_along_it_stay():
    config = ReliefConfig(longest=20.0, longest_across=30.0)
    assert gain(8.0, config, (1.0, 0.0)) < 0.01
    assert gain(8.0, config, (0.0, 1.0)) > 0.9


def test_half_of_the_longest_wave_across_passes():
    """A wave of 8 m along x whose phase runs round in 30 m along y."""
    config = ReliefConfig(longest=20.0, longest_across=30.0)
    y, x = np.mgrid[0:240, 0:240]
    z = np.sin(2 * np.pi * x / 8.0) * np.cos(2 * np.pi * y / 30.0)
    passed = band_pass(z, np.ones_like(z), 1.0, config)[60:180, 60:180]
    assert passed.std() / z[60:180, 60:180].std() == pytest.approx(0.5, abs=0.03)


def test_a_coarse_grid_keeps_waves_of_some_cells():
    z = np.sin(2 * np.pi * np.arange(200) / 8.0)[:, None] * np.ones((1, 200))
    config = ReliefConfig(longest=1.0, longest_across=1e3, min_cells=8.0)
    passed = band_pass(z, np.ones_like(z), 5.0, config)[50:150, 50:150]
    assert passed.std() / z.std() == pytest.approx(0.5, abs=0.03)


def test_offset_and_tilt_are_no_relief():
    y, x = np.mgrid[0:60, 0:80]
    z = 3.0 + 0.1 * x - 0.05 * y
    assert np.abs(band_pass(z, np.ones_like(z), 1.0, ReliefConfig())).max() < 1e-9


def test_the_gauge_of_a_submap_does_not_change_its_relief():
    submap = rough_submap()
    y, x = np.meshgrid(submap.surface.y, submap.surface.x, indexing="ij")
    tilted = replace(submap, surface=replace(submap.surface, z=submap.surface.z + 2.0 + 0.03 * x - 0.02 * y))
    assert extract_relief(tilted).z == pytest.approx(extract_relief(submap).z, abs=1e-9)


def test_of_sand_waves_the_floor_between_the_crests_is_left():
    submap = rough_submap()
    x, y = np.meshgrid(submap.surface.x, submap.surface.y)
    waves = 0.5 * np.sin(2 * np.pi * (0.6 * x + 0.8 * y) / 8.0)
    with_waves = replace(submap, surface=replace(submap.surface, z=submap.surface.z + waves))
    bare, relief = extract_relief(submap), extract_relief(with_waves)
    inside = bare.weight > 0.5 * bare.weight.max()
    assert np.std(waves) > np.std(bare.z[inside])
    assert np.std(relief.z[inside]) < 1.3 * np.std(bare.z[inside])
    assert np.corrcoef(relief.z[inside], bare.z[inside])[0, 1] > 0.8


def test_unknown_shadowed_and_hopeless_cells_have_no_weight_and_no_influence():
    submap = rough_submap()
    shadow, sigma, z = submap.is_shadow.copy(), submap.sigma.copy(), submap.surface.z.copy()
    shadow[10:20, 10:20], sigma[30:35, 30:35], z[50:60, 40:60] = True, np.nan, np.nan
    wild = np.where(shadow, 1e3, z)
    clean = replace(submap, is_shadow=shadow, sigma=sigma, surface=replace(submap.surface, z=z))
    dirty = replace(clean, surface=replace(submap.surface, z=wild))
    relief = extract_relief(clean)
    assert not relief.is_trusted[10:20, 10:20].any()
    assert not relief.is_trusted[30:35, 30:35].any()
    assert not relief.is_trusted[50:60, 40:60].any()
    assert relief.is_trusted.mean() > 0.9
    assert np.array_equal(extract_relief(dirty).z, relief.z)
    assert all(
        np.isfinite(a).all() for a in (relief.z, relief.weight, relief.reflectivity, relief.height, relief.sigma)
    )
    assert not relief.z[~relief.is_trusted].any()


def test_trust_falls_with_sigma():
    submap = rough_submap()
    sigma = submap.sigma.copy()
    sigma[:, 40:] *= 3
    weight = extract_relief(replace(submap, sigma=sigma)).weight
    assert weight[50, 20] > 1.5 * weight[50, 60] > 0


def test_trust_falls_to_nothing_at_the_edge():
    weight = extract_relief(rough_submap()).weight
    assert weight[50, 40] == pytest.approx(0.5)  # a sigma as good as the median
    assert weight[50, 0] < 0.1
    assert weight[0, 0] == 0


def test_a_submap_of_which_nothing_is_known_has_an_empty_relief():
    submap = rough_submap()
    empty = replace(submap, surface=replace(submap.surface, z=np.full_like(submap.surface.z, np.nan)))
    relief = extract_relief(empty)
    assert relief.area == 0
    assert relief.information == 0
    assert relief.correlation_area == np.inf
    assert not relief.z.any()


def test_a_boulder_is_drawn_in_to_the_limit():
    submap = rough_submap()
    z = submap.surface.z.copy()
    z[50, 40] += 30.0
    relief = extract_relief(replace(submap, surface=replace(submap.surface, z=z)), ReliefConfig(clip=3.0))
    robust = 1.4826 * np.median(np.abs(relief.z))
    assert relief.z.max() == pytest.approx(3.0 * robust, rel=0.02)


def test_correlation_area_of_smoothed_noise_is_that_of_its_gaussian():
    """Noise smoothed by s correlates as exp(-r^2 / 4 s^2); the square of that integrates to 2 pi s^2."""
    from scipy.ndimage import gaussian_filter

    z = gaussian_filter(np.random.default_rng(0).normal(size=(400, 400)), 2.0, mode="wrap")
    # chance adds the circle of 20 m over the area, 3 % of the correlation area; the estimate itself scatters by 5 %
    assert correlation_area(z, np.ones_like(z), 1.0) == pytest.approx(2 * np.pi * 4.0, rel=0.15)


def test_correlation_area_is_in_square_metres_whatever_the_spacing():
    from scipy.ndimage import gaussian_filter

    z = gaussian_filter(np.random.default_rng(0).normal(size=(400, 400)), 4.0, mode="wrap")
    assert correlation_area(z, np.ones_like(z), 0.5) == pytest.approx(2 * np.pi * 4.0, rel=0.2)


def test_ripples_tell_much_less_than_rough_floor():
    x = np.arange(80) * np.ones((100, 1))
    rng = np.random.default_rng(0)
    ripples = np.sin(2 * np.pi * x / 8.0)
    rough = extract_relief(cut_submap(rough_seafloor(rng), (150.0, 150.0, 0.0), rng))
    assert correlation_area(ripples, np.ones_like(ripples), 1.0) > 10 * rough.correlation_area


def test_flat_mud_has_less_information_than_rough_floor():
    rng = np.random.default_rng(1)
    rough, mud = rough_seafloor(rng), rough_seafloor(rng, rms=0.8)
    mud = replace(mud, z=0.01 * mud.z)
    high, low = (extract_relief(cut_submap(s, (150.0, 150.0, 0.0), rng, error=0.05)) for s in (rough, mud))
    assert high.information > 0.8
    assert low.information < 0.5  # what is left is the error itself


def test_block_means_fill_up_with_nothing():
    values = np.arange(15.0).reshape(3, 5)
    means = block_means(values, 2)
    assert means.shape == (2, 3)
    assert means[0].tolist() == [3.0, 5.0, (4 + 9) / 4]
    assert means[1, 0] == (10 + 11) / 4
    assert np.array_equal(block_means(values, 1), values)
