from dataclasses import replace

import numpy as np
import pytest

from backend.bordered import bordered
from backend.calibration import calibrated, uncalibrated_covariances
from backend.correction import spread_correction, spread_sigmas
from backend.dead_reckoning import DeadReckoning
from backend.pose_graph import PoseGraph
from backend.pose_kernels import moved
from backend.problem import Estimate
from tests.backend.conftest import MODEL, Survey, drift, lawn_mower

# What is constant of a good vehicle's drift outweighs what changes, as of a gyrocompass with a Doppler log.
STEADY = MODEL.model_copy(update={"heading_walk": 3e-5, "velocity_noise": 0.005, "heading_bias_sd": 0.0})
FIRST_POSE = np.array([0.005, 0.005, 0.013, 0.05, 0.05, 0.1])


def steady_survey(seed):
    time, T = lawn_mower(4, 150.0, 30.0, 2)
    T_dr = drift(time, T, STEADY, np.random.default_rng(seed))
    return Survey(time, T, T_dr, np.arange(0, len(time), 20), DeadReckoning(time, T_dr, STEADY))


def graph_of(survey, closures):
    """A graph that knows what is constant."""
    graph = survey.graph(closures, first_pose=FIRST_POSE)
    graph.add_constant_errors(survey.dead_reckoning.constant_errors(survey.anchor_pings))
    return graph


@pytest.fixture(scope="module")
def solved():
    """Per survey: the closures' solution without and with constant errors."""
    rows = []
    for seed in range(12):
        survey = steady_survey(seed)
        closures = survey.true_closures(np.random.default_rng(seed))
        rows.append((survey, survey.graph(closures, first_pose=FIRST_POSE).solve(), graph_of(survey, closures).solve()))
    return rows


def test_the_corrected_track_is_as_uncertain_as_its_errors_are_large(solved):
    squares = []
    for survey, _, solution in solved:
        T = spread_correction(survey.time, survey.T_world_body_dr, survey.anchor_pings, solution.T_world_anchor)
        sigmas = spread_sigmas(survey.dead_reckoning, survey.anchor_pings, solution.sigmas)
        error = T[:, :2, 3] - survey.T_world_body[:, :2, 3]
        squares.append(np.mean((error[40:] / sigmas[40:, :2]) ** 2))
    # the mean of twelve chi-squares of some three degrees of freedom each: 1 within 0.25, twice that to be sure
    assert 0.5 < np.mean(squares) < 1.6


def test_solving_for_constant_errors_brings_the_anchors_nearer_to_the_truth(solved):
    errors = [[survey.error(each.T_world_anchor) for each in pair] for survey, *pair in solved]
    without, with_them = np.median(errors, axis=0)
    assert with_them < 0.75 * without


def test_the_closures_that_hold_are_the_same_with_constant_errors(solved):
    for _, without, with_them in solved:
        assert without.reasons == with_them.reasons


def test_a_graph_without_closures_is_as_uncertain_as_dead_reckoning():
    survey = steady_survey(0)
    constants = survey.dead_reckoning.constant_errors(survey.anchor_pings)
    graph = PoseGraph(survey.dr_anchors)
    graph.add_first_pose([0.005, 0.005, survey.dead_reckoning.sigmas[0, 3], 1e-3, 1e-3, 0.1])
    for step in survey.odometry():
        graph.add_odometry(step.target, step.source, step.T_target_source, step.covariance)
    for anchor in range(graph.n_anchors):
        graph.add_depth_and_tilt(anchor, 0.1, 0.005)
    graph.add_constant_errors(constants)
    solution = graph.solve()
    assert np.array_equal(solution.T_world_anchor, survey.dr_anchors)
    theirs = survey.dead_reckoning.sigmas[survey.anchor_pings]
    # x, y and yaw; the first pose is given a millimetre, and tilts of 0.3 deg shorten levers by a thousandth
    np.testing.assert_allclose(solution.sigmas[:, [0, 1, 3]], theirs[:, [0, 1, 3]], rtol=0.01, atol=2e-3)


def test_covariances_are_those_of_the_whole_information():
    """A judge by differences: second derivatives of the error by all poses and constant errors, inverted at once."""
    time, T = lawn_mower(2, 60.0, 30.0, 0)
    survey = Survey(time, T, T, np.arange(0, len(time), 25), DeadReckoning(time, T, STEADY))
    exact = [
        replace(each, T_target_source=_between(survey, each)) for each in survey.true_closures(np.random.default_rng(0))
    ]
    problem = graph_of(survey, exact).problem()
    n, k = len(problem.T_world_anchor_dr), 4
    squares = bordered(problem, np.arange(len(exact)), 1.5)

    def error(x):
        return squares.error(moved(problem.T_world_anchor_dr, x[: 6 * n].reshape(n, 6)), x[6 * n :])

    step = np.concatenate([np.tile([1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3], n), np.full(k, 1e-2)])
    unit = np.diag(step)
    second = np.array([[error(a + b) - error(a - b) - error(b - a) + error(-a - b) for b in unit] for a in unit]) / (
        4.0 * np.outer(step, step)
    )
    judge = np.linalg.inv(second)
    found = squares.equations(problem.T_world_anchor_dr, np.zeros(k))
    np.testing.assert_allclose(np.linalg.inv(found.left), judge[6 * n :, 6 * n :], rtol=2e-3, atol=1e-6)
    for anchor, covariance in enumerate(found.covariances):
        block = slice(6 * anchor, 6 * anchor + 6)
        scale = np.sqrt(np.diag(covariance))
        np.testing.assert_allclose(
            covariance / np.outer(scale, scale), judge[block, block] / np.outer(scale, scale), atol=5e-3
        )


def _between(survey, closure):
    """The true relative pose of a closure."""
    T = survey.true_anchors
    return np.linalg.inv(T[closure.target]) @ T[closure.source]


def test_a_scale_that_closures_see_is_taken_off_the_odometry():
    time, T = lawn_mower(4, 150.0, 30.0, 2)
    T_dr = T.copy()
    T_dr[:, :2, 3] = T[0, :2, 3] + 1.01 * (T[:, :2, 3] - T[0, :2, 3])
    survey = Survey(time, T, T_dr, np.arange(0, len(time), 20), DeadReckoning(time, T_dr, STEADY))
    closures = [replace(each, T_target_source=_between(survey, each)) for each in _wide(survey)]
    problem = graph_of(survey, closures).problem()
    found = calibrated(problem, Estimate(survey.dr_anchors, np.arange(len(closures)), 1.0))
    along = np.linalg.norm(survey.true_anchors[1:, :3, 3] - survey.true_anchors[:-1, :3, 3], axis=1)
    taken = np.array([step.T_target_source[:3, 3] for step in found.problem.odometry])
    # 1 % is 1.7 of its standard deviations; closures of 0.3 m over 60 m, thirty of them, tell it to a tenth
    np.testing.assert_allclose(np.linalg.norm(taken, axis=1) / along, 1.0, atol=0.002)
    assert found.problem.constants is None
    assert (np.diagonal(found.covariances, axis1=1, axis2=2) > 0).all()


def _wide(survey):
    """Closures between anchors up to 60 m from each other, which see how long that is."""
    rng = np.random.default_rng(0)
    return [survey.closure(target, source, rng) for target, source in survey.revisits(60.0)]


def test_errors_that_change_from_leg_to_leg_are_not_taken_for_constant_ones():
    """A log that reads 3 % too much on one leg and 3 % too little on the next, as a current makes it."""
    time, T = lawn_mower(6, 200.0, 30.0, 2)
    step = np.diff(T[:, :2, 3], axis=0)
    wrong = 1.0 + 0.03 * np.sign(step[:, :1] + 0.5 * step[:, 1:])
    T_dr = T.copy()
    T_dr[1:, :2, 3] = T[0, :2, 3] + np.cumsum(wrong * step, axis=0)
    survey = Survey(time, T, T_dr, np.arange(0, len(time), 20), DeadReckoning(time, T_dr, STEADY))
    closures = _wide(survey)
    problem = graph_of(survey, closures).problem()
    estimate = Estimate(survey.true_anchors, np.arange(len(closures)), 2.0)
    assert calibrated(problem, estimate) is None
    covariances = uncalibrated_covariances(problem, estimate)
    assert (np.linalg.eigvalsh(covariances) > 0).all()


def test_constant_errors_that_are_not_solved_for_make_poses_less_certain_still():
    survey = steady_survey(3)
    closures = survey.true_closures(np.random.default_rng(3))
    problem = graph_of(survey, closures).problem()
    estimate = Estimate(survey.true_anchors, np.arange(len(closures)), 1.0)
    solved_for = calibrated(problem, estimate).covariances
    not_solved_for = uncalibrated_covariances(problem, estimate)
    axes = np.diagonal(not_solved_for - solved_for, axis1=1, axis2=2)[1:, [2, 3, 4]]
    assert axes.mean() > 0.0


def test_a_false_closure_is_no_more_believed_with_constant_errors():
    survey, rng = steady_survey(5), np.random.default_rng(5)
    closures = [*survey.true_closures(rng), *survey.repeated_false(10, 5, rng)]
    without = survey.graph(closures, first_pose=FIRST_POSE).solve()
    assert graph_of(survey, closures).solve().reasons == without.reasons


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: replace(c, moves=c.moves[1:]), r"constant errors of \d+ anchors are wanted, got shapes"),
        (lambda c: replace(c, rest=c.rest[1:]), r"constant errors of \d+ anchors are wanted, got shapes"),
        (
            lambda c: replace(c, rest=0.0 * c.rest),
            "constant errors must be finite and leave each step a positive",
        ),
        (lambda c: replace(c, moves=np.nan * c.moves), "constant errors must be finite"),
    ],
)
def test_constant_errors_that_do_not_fit_the_graph_are_refused(change, message):
    survey = steady_survey(0)
    graph = survey.graph([])
    with pytest.raises(ValueError, match=message):
        graph.add_constant_errors(change(survey.dead_reckoning.constant_errors(survey.anchor_pings)))
