import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from backend.factors import between_factors, graph_of, pose_values
from backend.gauss_newton import covariances, minimum
from backend.optimiser import half_squared_error, marginal_covariances, optimise
from backend.pose_kernels import inverse_jacobian, moved, residual
from backend.poses import logarithm

SCALE = 1.5  # of the odometry


@pytest.fixture
def problem(make_survey):
    """A dive with depths, tilts, a fix, true closures and false ones, drifted three times as far as its model says."""
    survey, rng = make_survey(3, 3.0), np.random.default_rng(3)
    graph = survey.graph(survey.true_closures(rng) + survey.independent_false(2, rng))
    graph.add_fix(7, *survey.true_anchors[7, :2, 3], 0.5)
    return graph.problem()


@pytest.fixture
def least_squares(problem):
    return problem.least_squares(SCALE, np.arange(len(problem.closures)))


@pytest.fixture
def factors(problem):
    """The judge: the same graph of GTSAM's factors."""
    return [*problem.known_factors(SCALE), *between_factors(problem.closures)]


def test_the_error_is_that_of_gtsam(problem, least_squares, factors):
    T = problem.T_world_anchor_dr
    # GTSAM holds what a depth leaves free with a sigma of 1000 km: 1e-9 of the square of a kilometre
    assert least_squares.error(T) == pytest.approx(half_squared_error(factors, T), rel=1e-9)


def test_the_gradient_is_that_of_gtsam(problem, least_squares, factors):
    T = problem.T_world_anchor_dr
    gradient = least_squares.normal_equations(T)[2]
    judge = graph_of(factors).linearize(pose_values(T)).gradientAtZero()
    judge = np.stack([judge.at(anchor) for anchor in range(len(T))])
    np.testing.assert_allclose(gradient, judge, atol=1e-9 * np.abs(judge).max())


def test_the_minimum_is_that_of_gtsam(problem, least_squares, factors):
    T = problem.T_world_anchor_dr
    np.testing.assert_allclose(minimum(least_squares, T), optimise(factors, T), atol=1e-6)  # its last step is as good


def test_covariances_are_gtsams_marginals(problem, least_squares, factors):
    T = minimum(least_squares, problem.T_world_anchor_dr)
    judge = marginal_covariances(factors, T)
    np.testing.assert_allclose(covariances(least_squares, T), judge, atol=1e-8 * np.abs(judge).max())


def test_squared_residuals_know_no_weights(problem, least_squares):
    T = problem.T_world_anchor_dr
    halved = least_squares.weighted(0.5 * least_squares.relative.weights)
    assert np.array_equal(halved.squared_residuals(T), least_squares.squared_residuals(T))
    between = least_squares.relative.weights * least_squares.squared_residuals(T)
    assert least_squares.error(T) - halved.error(T) == pytest.approx(0.25 * between.sum(), rel=1e-9)


def test_what_weighs_nothing_is_as_good_as_left_out(problem, least_squares):
    n = len(problem.closures)
    weights = least_squares.relative.weights.copy()
    weights[-n + 5 :] = 0.0
    few, T = problem.least_squares(SCALE, np.arange(5)), problem.T_world_anchor_dr
    np.testing.assert_allclose(minimum(least_squares.weighted(weights), T), minimum(few, T), atol=1e-9)


ROTATIONS = st.tuples(*[st.floats(-3.5, 3.5)] * 3)  # beyond half a turn too


@settings(max_examples=60, deadline=None)
@given(ROTATIONS, st.tuples(*[st.floats(-100.0, 100.0)] * 3))
def test_a_pose_moves_by_the_exponential_and_differs_by_the_logarithm(turn, shift):
    delta = np.array([turn + shift])
    T = moved(np.eye(4)[None], delta)
    np.testing.assert_allclose(T[0], gtsam.Pose3.Expmap(delta[0]).matrix(), atol=1e-10)
    error = np.empty(6)
    residual(np.eye(4), T[0], error)
    np.testing.assert_allclose(moved(np.eye(4)[None], error[None]), T, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 1e-3, 0.04, 0.06, 1.0, 3.0, np.pi - 1e-6])
def test_the_residual_and_its_derivative_are_right_at_any_angle(angle):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(angle * np.array([0.6, 0.0, -0.8])).as_matrix(), [2.0, -1.0, 3.0]
    error = np.empty(6)
    residual(np.eye(4), T, error)
    np.testing.assert_allclose(error, logarithm(T[None])[0], atol=1e-7 / max(np.pi - angle, 1e-1))
    noise = gtsam.noiseModel.Unit.Create(6)
    factor = gtsam.BetweenFactorPose3(0, 1, gtsam.Pose3(), noise)
    judge = graph_of([factor]).linearize(pose_values(np.stack([np.eye(4), T]))).at(0).jacobian()[0]
    derivative = np.empty((6, 6))
    inverse_jacobian(error, derivative)
    np.testing.assert_allclose(derivative, judge[:, 6:], atol=1e-6)
