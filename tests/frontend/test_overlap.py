from dataclasses import replace

import numpy as np
import pytest

from frontend import overlap as module
from frontend.overlap import lay_over, sample_rasters, stack_layers, weighted_correlation
from frontend.relief import Relief, extract_relief
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor


def layers_of(z, origin=(0.0, 0.0), weight=None):
    z = np.asarray(z, dtype=np.float64)
    weight = np.ones_like(z) if weight is None else weight
    return stack_layers(Relief(z, weight, 2 * z, 3 * z, np.full(z.shape, 0.3), 1.0, origin))


def bilinear_field(shape):
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]].astype(float)
    return 1.0 + 0.5 * x - 0.25 * y + 0.1 * x * y


def test_a_bilinear_field_is_sampled_exactly_at_turned_and_shifted_positions():
    rasters = np.stack([np.ones((8, 9)), bilinear_field((8, 9))], axis=-1)
    positions = np.array([[0.3, -0.4], [1.0, 2.0]])
    planar = (3.0, 2.5, 0.7)
    x = 3.0 + np.cos(0.7) * positions[:, 0] - np.sin(0.7) * positions[:, 1]
    y = 2.5 + np.sin(0.7) * positions[:, 0] + np.cos(0.7) * positions[:, 1]
    samples = sample_rasters(rasters, positions, (0.0, 0.0, 1.0), planar)
    assert samples[:, 1] == pytest.approx(1.0 + 0.5 * x - 0.25 * y + 0.1 * x * y)


def test_origin_and_spacing_of_the_grid_count():
    rasters = np.stack([np.ones((8, 9)), bilinear_field((8, 9))], axis=-1)
    at = np.array([[10.0 + 0.5 * 3, -4.0 + 0.5 * 2]])
    assert sample_rasters(rasters, at, (10.0, -4.0, 0.5), (0.0, 0.0, 0.0))[0, 1] == pytest.approx(1 + 1.5 - 0.5 + 0.6)


@pytest.mark.parametrize("at", [(-0.01, 3.0), (3.0, -0.01), (8.0, 3.0), (3.0, 7.0), (1e9, 0.0)])
def test_positions_outside_the_grid_have_no_trust(at):
    rasters = np.ones((8, 9, 2))
    assert not sample_rasters(rasters, np.array([at]), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)).any()


def test_positions_beside_a_cell_without_trust_have_none():
    rasters = np.ones((8, 9, 2))
    rasters[4, 4, 0] = 0
    beside, apart = sample_rasters(rasters, np.array([[3.5, 3.5], [2.5, 2.5]]), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    assert not beside.any()
    assert apart.all()


def test_the_kernel_is_its_own_python_function():
    rng = np.random.default_rng(0)
    rasters, cells, frame = rng.uniform(0, 1, (7, 6, 3)), rng.uniform(0, 6, (30, 2)), np.array([0.5, 0.25, 1.0])
    planar, compiled, plain = np.array([0.2, 0.4, 0.3]), np.zeros((30, 3)), np.zeros((30, 3))
    module.sample(rasters, cells, frame, planar, compiled)
    getattr(module.sample, "py_func", module.sample)(rasters, cells, frame, planar, plain)
    assert compiled == pytest.approx(plain, abs=1e-14)


def test_a_submap_laid_over_itself_overlaps_and_correlates_fully():
    layers = layers_of(np.random.default_rng(0).normal(size=(30, 40)))
    overlap = lay_over(layers, layers, (0.0, 0.0, 0.0))
    # the last row and column have no cell beyond to interpolate with
    assert overlap.share == pytest.approx(29 * 39 / 1200)
    assert overlap.area == 29 * 39
    assert overlap.correlation == pytest.approx(1.0)
    assert overlap.reflectivity_correlation == pytest.approx(1.0)
    assert overlap.sigma == pytest.approx(0.3 * np.sqrt(2))


def test_pairs_of_samples_are_of_the_same_place():
    z = bilinear_field((30, 40))
    target, source = layers_of(z), layers_of(z[5:15, 8:20], origin=(100.0, 50.0))
    overlap = lay_over(target, source, (8.0 - 100.0, 5.0 - 50.0, 0.0))
    assert overlap.z_source == pytest.approx(overlap.z_target)
    assert overlap.height_target == pytest.approx(3 * overlap.z_target)
    assert overlap.reflectivity_target == pytest.approx(2 * overlap.z_target)
    assert overlap.share == 1.0


def test_slopes_are_those_of_the_target():
    z = 0.2 * np.arange(20.0)[None, :] - 0.1 * np.arange(20.0)[:, None]
    overlap = lay_over(layers_of(z), layers_of(np.zeros((4, 4))), (8.0, 8.0, 0.5))
    assert overlap.slope_target == pytest.approx(np.broadcast_to([0.2, -0.1], (16, 2)))
    assert overlap.slope_source == pytest.approx(np.zeros((16, 2)))


def test_the_share_is_that_of_the_smaller_submap():
    big, small = layers_of(np.ones((40, 40))), layers_of(np.ones((10, 10)))
    assert lay_over(big, small, (5.0, 5.0, 0.0)).share == 1.0
    assert lay_over(small, big, (-5.0, -5.0, 0.0)).share == pytest.approx(0.81)


def test_submaps_that_do_not_meet_share_nothing():
    layers = layers_of(np.ones((10, 10)))
    overlap = lay_over(layers, layers, (50.0, 0.0, 0.0))
    assert overlap.share == 0
    assert overlap.correlation == 0


def test_the_true_transform_correlates_best():
    rng = np.random.default_rng(5)
    seafloor = rough_seafloor(rng)
    a, b = (cut_submap(seafloor, pose, rng, error=0.02) for pose in ((150.0, 150.0, 0.0), (158.0, 140.0, 0.8)))
    target, source = stack_layers(extract_relief(a)), stack_layers(extract_relief(b))
    assert lay_over(target, source, (8.0, -10.0, 0.8)).correlation > 0.75
    assert lay_over(target, source, (-8.0, 10.0, -0.8)).correlation < 0.3


def test_correlation_of_nothing_and_of_constants_is_zero():
    none = np.empty(0)
    assert weighted_correlation(none, none, none) == 0
    assert weighted_correlation(np.ones(5), np.arange(5.0), np.ones(5)) == 0


def test_weighted_correlation_is_numpys_with_weights():
    rng = np.random.default_rng(0)
    a, b, w = rng.normal(size=50), rng.normal(size=50), rng.uniform(0, 1, 50)
    covariance = np.cov(a, b, aweights=w)
    expected = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert weighted_correlation(a, b, w) == pytest.approx(expected)


def test_inputs_stay_as_they_were():
    layers = layers_of(np.random.default_rng(0).normal(size=(10, 10)))
    before = replace(layers, rasters=layers.rasters.copy(), cells=layers.cells.copy())
    lay_over(layers, layers, (1.0, 1.0, 0.1))
    assert np.array_equal(layers.rasters, before.rasters)
    assert np.array_equal(layers.cells, before.cells)
