from itertools import pairwise

import numpy as np
import pytest

from backend.constant_errors import ConstantErrors, corrected_steps, tangents
from backend.dead_reckoning import DeadReckoning, DeadReckoningConfig
from backend.poses import RelativePose, tangent_covariance


def test_a_step_errs_by_its_constant_errors_and_by_what_is_left(make_survey):
    survey = make_survey(0)
    pings = survey.anchor_pings
    constants = survey.dead_reckoning.constant_errors(pings)
    own = constants.moves[1:] @ constants.moves[1:].swapaxes(1, 2)
    whole = [survey.dead_reckoning.odometry_covariance(i, j) for i, j in pairwise(pings)]
    np.testing.assert_allclose(constants.rest + own, whole, rtol=1e-9, atol=1e-12)


def test_a_scaled_velocity_lengthens_a_step_and_a_turned_one_moves_it_to_port(poses):
    T = poses(np.array([[0.0, 0.0, -5.0], [0.0, 30.0, -5.0]]), np.full(2, np.pi / 2))  # 30 m to the north
    config = DeadReckoningConfig(velocity_scale_sd=0.01, velocity_misalignment_sd=0.02, heading_deviation_sd=0.0)
    moves = DeadReckoning([0.0, 20.0], T, config).constant_errors([0, 1]).moves
    np.testing.assert_allclose(moves[1, 3:, 0], [0.3, 0.0, 0.0], atol=1e-12)  # ahead
    np.testing.assert_allclose(moves[1, 3:, 1], [0.0, 0.6, 0.0], atol=1e-12)  # to port
    assert (moves[0] == 0.0).all()


def test_what_is_solved_for_leaves_the_first_pose_alone_and_every_step_as_it_is() -> None:
    moves, rest = np.ones((4, 6, 2)), np.tile(np.eye(6), (3, 1, 1))
    steps = ConstantErrors(moves, rest).of_steps()
    assert not steps.moves[0].any()
    np.testing.assert_array_equal(steps.moves[1:], moves[1:])
    kept, sigmas = steps.first_pose(np.full(6, 2.0))
    assert not kept.any()
    np.testing.assert_allclose(sigmas, 2.0)


def test_the_first_pose_deviates_with_its_own_heading(poses):
    T = poses(np.array([[3.0, 4.0, 0.0], [3.0, 34.0, 0.0]]), np.full(2, np.pi / 2))
    config = DeadReckoningConfig(heading_deviation_sd=0.03, velocity_scale_sd=0.0, velocity_misalignment_sd=0.0)
    moves = DeadReckoning([0.0, 20.0], T, config).constant_errors([0, 1]).moves
    np.testing.assert_allclose(moves[0, 2], [0.0, 0.0, 0.0, 0.03], atol=1e-12)  # with the sine, to the north
    np.testing.assert_allclose(moves[0, 3:], 0.0, atol=1e-12)  # which turns the track about itself
    np.testing.assert_allclose(moves[1], 0.0, atol=1e-12)  # and no step seen from there


def test_a_first_pose_better_known_than_constant_errors_allow_is_moved_by_none():
    moves = np.zeros((2, 6, 1))
    moves[0, 2, 0], moves[0, 3, 0] = 0.03, 0.4
    kept, rest = ConstantErrors(moves, np.eye(6)[None]).first_pose(np.array([0.01, 0.01, 0.001, 0.5, 0.1, 0.1]))
    assert kept[2, 0] == 0.0
    assert kept[3, 0] == 0.4
    np.testing.assert_allclose(rest, [0.01, 0.01, 0.001, 0.3, 0.1, 0.1])


def test_moves_and_covariances_turn_alike(make_survey):
    survey = make_survey(1)
    constants = survey.dead_reckoning.constant_errors(survey.anchor_pings)
    T = np.stack([step.T_target_source for step in survey.odometry()])
    turned = tangents(T, constants.moves[1:])
    whole = constants.moves[1:] @ constants.moves[1:].swapaxes(1, 2)
    np.testing.assert_allclose(turned @ turned.swapaxes(1, 2), tangent_covariance(T, whole), atol=1e-12)


def test_corrected_steps_are_as_uncertain_as_what_is_left():
    rest = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    T = np.eye(4)
    T[0, 3] = 2.0
    steps = corrected_steps(
        [RelativePose(0, 1, np.eye(4), np.eye(6))], T[None], ConstantErrors(np.zeros((2, 6, 1)), rest[None])
    )
    assert (steps[0].target, steps[0].source) == (0, 1)
    np.testing.assert_array_equal(steps[0].T_target_source, T)
    np.testing.assert_array_equal(steps[0].covariance, rest)


@pytest.mark.parametrize("pings", [[0, 5000], [-1, 5]])
def test_pings_beyond_the_track_are_refused(make_survey, pings):
    with pytest.raises(ValueError, match=r"pings must lie in 0\.\.\d+, got"):
        make_survey(0).dead_reckoning.constant_errors(pings)
