from dataclasses import replace

import numpy as np
import pytest

from frontend.overlap import concentration, correlate_at, lay_over, stack_layers, weighted_correlation
from frontend.relief import Relief, extract_relief
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor


def layers_of(z, origin=(0.0, 0.0), weight=None):
    z = np.asarray(z, dtype=np.float64)
    weight = np.ones_like(z) if weight is None else weight
    return stack_layers(Relief(z, weight, 2 * z, 3 * z, np.full(z.shape, 0.3), 1.0, origin))


def bilinear_field(shape):
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]].astype(float)
    return 1.0 + 0.5 * x - 0.25 * y + 0.1 * x * y


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
    assert lay_over(target, source, (8.0, -10.0, 0.8)).correlation > 0.7  # each loses what runs in one direction in it
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


@pytest.mark.parametrize("correlation", [0.0, 0.4, 0.9])
def test_the_correlation_of_gaussian_floors_is_carried_by_all_of_them(correlation):
    a, rest = np.random.default_rng(0).normal(size=(2, 120, 130))
    b = correlation * a + np.sqrt(1 - correlation**2) * rest
    overlap = lay_over(layers_of(a), layers_of(b), (0.0, 0.0, 0.0))
    # a mean of 15000 products of variance 10 to 100 is within 0.1 of its expectation, 1 to 3
    assert 1.0 <= overlap.concentration < 1.1


@pytest.mark.parametrize("n", [2, 5])
def test_what_a_few_boulders_carry_counts_between_their_number_and_that_of_all_pieces(n):
    z = np.zeros((31, 31))
    z.flat[np.random.default_rng(0).choice(30 * 30, n, replace=False)] = 1.0
    overlap = lay_over(layers_of(z), layers_of(z), (0.0, 0.0, 0.0))
    n_seen = int(overlap.z_source.sum())
    # the geometric mean of both; of reliefs wholly alike a Gaussian one has a kurtosis of 3: its pieces count as thirds
    n_all = len(overlap.x)
    assert n_all / overlap.concentration == pytest.approx(np.sqrt(n_all * 3 * n_seen))


def test_concentration_is_the_same_with_and_without_the_samples():
    rng = np.random.default_rng(0)
    z, weight = rng.standard_t(3, size=(40, 40)), rng.uniform(0.1, 1, (40, 40))
    a, b = layers_of(z, weight=weight), layers_of(z + rng.normal(size=z.shape))
    overlap = lay_over(a, b, (0.3, -0.1, 0.01))
    by_shape, by_echo, times, area = correlate_at(a, b, (0.3, -0.1, 0.01))
    assert times > 1
    assert times == pytest.approx(overlap.concentration, rel=1e-9)
    assert (by_shape, by_echo) == pytest.approx((overlap.correlation, overlap.reflectivity_correlation), abs=1e-12)
    assert area == overlap.area


def test_nothing_is_carried_by_nothing():
    assert concentration(0.0, 0.0) == 1.0
    assert lay_over(layers_of(np.zeros((9, 9))), layers_of(np.zeros((9, 9))), (0.0, 0.0, 0.0)).concentration == 1.0
