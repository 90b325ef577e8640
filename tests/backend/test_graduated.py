import gtsam
import numpy as np
import pytest

from backend.factors import between_factors, graph_of, pose_values
from backend.gauss_newton import minimum
from backend.graduated import truncated_weights
from backend.least_squares import LeastSquares
from backend.poses import RelativePose
from backend.stacks import stacked
from backend.terms import first_term, joined, relative_terms, unary_terms


def at(x):
    T = np.eye(4)
    T[0, 3] = x
    return T


def measured(first, second, x, sigma=0.1):
    return RelativePose(first, second, at(x), np.diag(np.full(6, sigma**2)))


CHAIN = [measured(k, k + 1, 1.0) for k in range(3)]
START = np.stack([at(float(k)) for k in range(4)])


def held(doubtful):
    """Four anchors a metre apart, the first of them held, and what may be wrong."""
    relative = [first_term(np.eye(4), np.full(6, 0.01)), relative_terms(stacked([*CHAIN, *doubtful]))]
    return LeastSquares(4, joined(relative), unary_terms(START, [], []))


def test_a_wrong_measurement_weighs_nothing_and_right_ones_all():
    doubtful = [measured(0, 3, 3.1), measured(1, 3, -5.0), measured(0, 2, 1.9)]
    weights, T = truncated_weights(held(doubtful), 3, START, 0.9999)
    np.testing.assert_allclose(weights, [1.0, 0.0, 1.0])
    # it stops before the last digit
    np.testing.assert_allclose(T, minimum(held([doubtful[0], doubtful[2]]), START), atol=1e-4)


def test_without_doubt_there_are_no_weights():
    weights, T = truncated_weights(held([]), 0, START, 0.9999)
    assert weights.shape == (0,)
    np.testing.assert_allclose(T, START, atol=1e-12)


def test_least_squares_shares_a_disagreement_by_the_variances():
    # three steps of variance 0.01 against one: each step gives way by a quarter of 0.4 m
    T = minimum(held([measured(0, 3, 3.4)]), START)
    np.testing.assert_allclose(T[:, 0, 3], [0.0, 1.1, 2.2, 3.3], atol=1e-6)


def test_half_the_square_of_a_residual_of_two_sigmas_is_two():
    assert held([measured(0, 1, 1.2)]).error(START) == pytest.approx(2.0)


def test_weights_are_those_of_gtsams_graduated_non_convexity():
    rng = np.random.default_rng(0)
    ends = [(0, 2), (1, 3), (0, 3), (2, 0), (3, 1), (3, 0)]
    doubtful = [measured(a, b, b - a + rng.normal(0, 0.1) + 3.0 * (k % 3 == 1)) for k, (a, b) in enumerate(ends)]
    prior = gtsam.PriorFactorPose3(0, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, 0.01))
    factors = [prior, *between_factors([*CHAIN, *doubtful])]
    params = gtsam.GncLMParams(gtsam.LevenbergMarquardtParams())
    params.setLossType(gtsam.GncLossType.TLS)
    params.setKnownInliers(list(range(1 + len(CHAIN))))
    judge = gtsam.GncLMOptimizer(graph_of(factors), pose_values(START), params)
    judge.setInlierCostThresholdsAtProbability(0.9999)
    judge.optimize()
    weights, _ = truncated_weights(held(doubtful), len(doubtful), START, 0.9999)
    np.testing.assert_allclose(weights, np.asarray(judge.getWeights())[1 + len(CHAIN) :], atol=1e-6)
    assert weights.tolist() == [1.0, 0.0, 1.0, 1.0, 0.0, 1.0]
