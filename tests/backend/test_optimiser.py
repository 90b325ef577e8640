import gtsam
import numpy as np
import pytest

from backend.optimiser import half_squared_error, marginal_covariances, optimise


def at(x):
    T = np.eye(4)
    T[0, 3] = x
    return T


def between(first, second, x, sigma=0.1):
    return gtsam.BetweenFactorPose3(first, second, gtsam.Pose3(at(x)), gtsam.noiseModel.Isotropic.Sigma(6, sigma))


@pytest.fixture
def known():
    """Four anchors a metre apart, the first of them held."""
    prior = gtsam.PriorFactorPose3(0, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, 0.01))
    return [prior, *(between(k, k + 1, 1.0) for k in range(3))]


START = np.stack([at(float(k)) for k in range(4)])


def test_least_squares_shares_a_disagreement_by_the_variances(known):
    T = optimise([*known, between(0, 3, 3.4, sigma=0.1)], START)
    # three steps of variance 0.01 against one: each step gives way by a quarter of 0.4 m
    np.testing.assert_allclose(T[:, 0, 3], [0.0, 1.1, 2.2, 3.3], atol=1e-6)


def test_the_minimum_of_a_chain_has_no_error_and_variances_that_add(known):
    assert half_squared_error(known, START) == pytest.approx(0.0, abs=1e-18)
    along = marginal_covariances(known, START)[:, 3, 3]
    np.testing.assert_allclose(along, 1e-4 + 1e-2 * np.arange(4), rtol=1e-9)


def test_half_the_square_of_a_residual_of_two_sigmas_is_two():
    assert half_squared_error([between(0, 1, 1.2)], START) == pytest.approx(2.0)


def test_where_it_starts_is_not_changed(known):
    start = START.copy()
    optimise([*known, between(0, 3, 3.4)], start)
    assert np.array_equal(start, START)
