import gtsam
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from backend.factors import between_factors, graph_of, pose_values, poses_of
from backend.gauss_newton import minimum, one_step, rough_minimum
from backend.least_squares import LeastSquares
from backend.poses import RelativePose
from backend.stacks import stacked
from backend.terms import joined, relative_terms, unary_terms


def damped(factors, T):
    """The judge: GTSAM's own Levenberg-Marquardt, to the last digit."""
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-14)
    params.setAbsoluteErrorTol(1e-14)
    return poses_of(gtsam.LevenbergMarquardtOptimizer(graph_of(factors), pose_values(T), params).optimize())


def squares(n_anchors, relative):
    """Least squares of relative poses alone."""
    return LeastSquares(n_anchors, joined([relative_terms(stacked(relative))]), unary_terms(np.eye(4)[None], [], []))


@pytest.fixture
def surveyed(make_survey):
    """A dive with true closures and two false ones, and where dead reckoning starts it."""
    survey, rng = make_survey(3, 3.0), np.random.default_rng(3)
    problem = survey.graph(survey.true_closures(rng) + survey.independent_false(2, rng)).problem()
    return problem, problem.least_squares(1.0, np.arange(len(problem.closures))), survey.dr_anchors


def test_the_minimum_is_that_of_levenberg_and_marquardt(surveyed):
    problem, least_squares, start = surveyed
    judge = damped([*problem.known_factors(1.0), *between_factors(problem.closures)], start)
    reached = minimum(least_squares, start)
    assert least_squares.error(reached) == pytest.approx(least_squares.error(judge), abs=1e-4)  # what may be left
    np.testing.assert_allclose(reached, judge, atol=1e-2)  # a hundredth of a sigma of metres


def test_a_rough_minimum_leaves_a_small_share_of_the_error(surveyed):
    _, least_squares, start = surveyed
    least = least_squares.error(minimum(least_squares, start))
    assert least <= least_squares.error(rough_minimum(least_squares, start)) < (1.0 + 2e-3) * least


def test_one_step_goes_down_and_not_all_the_way(surveyed):
    _, least_squares, start = surveyed
    least = least_squares.error(minimum(least_squares, start))
    assert least < least_squares.error(one_step(least_squares, start)) < least_squares.error(start)


def test_at_the_minimum_nothing_moves(surveyed):
    _, least_squares, start = surveyed
    there = minimum(least_squares, minimum(least_squares, start))
    for again in (minimum, rough_minimum, one_step):
        np.testing.assert_allclose(again(least_squares, there), there, atol=1e-4)


def test_poses_that_nothing_holds_are_solved_all_the_same():
    start = np.stack([np.eye(4), np.eye(4)])
    start[1, 0, 3] = 1.0
    least_squares = squares(2, [RelativePose(0, 1, np.eye(4), 0.01 * np.eye(6))])
    assert least_squares.error(minimum(least_squares, start)) < 1e-6
    assert least_squares.error(one_step(least_squares, start)) < 1e-3


def test_a_step_uphill_is_damped_instead():
    """A ring of anchors thrown about, where undamped steps lead astray."""
    rng, step = np.random.default_rng(0), np.eye(4)
    step[:3, :3], step[0, 3] = Rotation.from_euler("z", np.pi / 3).as_matrix(), 5.0
    relative = [RelativePose(k, (k + 1) % 6, step, 0.01 * np.eye(6)) for k in range(6)]
    start = np.tile(np.eye(4), (6, 1, 1))
    start[:, :3, :3] = Rotation.from_rotvec(rng.normal(0, 2.0, (6, 3))).as_matrix()
    start[:, :3, 3] = rng.normal(0, 10.0, (6, 3))
    least_squares = squares(6, relative)
    assert least_squares.error(one_step(least_squares, start)) <= least_squares.error(start)
    assert least_squares.error(minimum(least_squares, start)) < 1e-2 * least_squares.error(start)


def test_where_it_starts_is_not_changed(surveyed):
    _, least_squares, start = surveyed
    before = start.copy()
    for descend in (minimum, rough_minimum, one_step):
        descend(least_squares, start)
    assert np.array_equal(start, before)
