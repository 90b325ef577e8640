from dataclasses import replace

import numpy as np
import pytest

from backend.consistency import ConsistencyConfig
from backend.do_no_harm import DoNoHarmConfig, harmful_closures, residual_distances
from backend.factors import between_factor, pose_values
from backend.poses import RelativePose


@pytest.fixture(scope="module")
def solved(make_survey):
    """A survey, its true closures and the solution that all of them hold."""
    survey, rng = make_survey(0), np.random.default_rng(0)
    closures = survey.true_closures(rng)
    solution = survey.graph(closures).solve()
    assert solution.is_inlier.all()
    return survey, closures, solution


def test_nothing_is_withdrawn_where_all_fits(solved):
    survey, closures, solution = solved
    assert harmful_closures(solution, closures, survey.compared(closures)) == {}


def test_the_closure_with_the_worst_residual_is_withdrawn(solved):
    survey, closures, solution = solved
    lying = replace(closures[3], T_target_source=closures[3].T_target_source.copy())
    lying.T_target_source[0, 3] += 5.0
    closures = [*closures[:3], lying, *closures[4:]]
    reasons = harmful_closures(solution, closures, survey.compared(closures))
    assert reasons == {3: "its residual is too large against its covariance"}


def test_closures_that_do_not_hold_the_graph_are_not_looked_at(solved):
    survey, closures, solution = solved
    lying = replace(closures[3], T_target_source=closures[3].T_target_source.copy())
    lying.T_target_source[0, 3] += 5.0
    closures = [*closures[:3], lying, *closures[4:]]
    weights = solution.closure_weights.copy()
    weights[3] = 0.0
    assert harmful_closures(replace(solution, closure_weights=weights), closures, survey.compared(closures)) == {}
    assert harmful_closures(replace(solution, closure_weights=0.0 * weights), closures, survey.compared(closures)) == {}


def test_all_are_withdrawn_where_they_correct_more_than_dead_reckoning_can_be_wrong(solved):
    survey, closures, solution = solved
    strict = DoNoHarmConfig(max_correction=0.1)
    reasons = harmful_closures(solution, closures, survey.compared(closures), strict)
    assert set(reasons) == set(range(len(closures)))
    assert set(reasons.values()) == {"the correction is larger than dead reckoning can be wrong"}


def test_a_graph_whose_closures_are_all_withdrawn_gives_dead_reckoning_back(solved):
    survey, closures, _ = solved
    solution = survey.graph(closures, do_no_harm=DoNoHarmConfig(max_correction=0.1)).solve()
    assert solution.T_world_anchor.tobytes() == survey.dr_anchors.tobytes()
    assert set(solution.reasons) == {"the correction is larger than dead reckoning can be wrong"}


def test_a_closure_wrong_in_depth_alone_is_withdrawn(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    closures = survey.true_closures(rng)
    closures[2].T_target_source[2, 3] += 3.0
    solution = survey.graph(closures).solve()
    assert not solution.is_inlier[2]
    assert solution.is_inlier.sum() == len(closures) - 1
    assert solution.reasons[2] == "it does not fit the pose graph"


def test_residual_distances_are_twice_gtsams_errors(solved):
    _, closures, solution = solved
    values = pose_values(solution.T_world_anchor)
    expected = [2.0 * between_factor(closure).error(values) for closure in closures]
    np.testing.assert_allclose(residual_distances(solution.T_world_anchor, closures), expected, rtol=1e-6, atol=1e-9)


def test_residual_distances_see_every_axis():
    T = np.tile(np.eye(4), (2, 1, 1))
    for axis in range(3):
        measured = np.eye(4)
        measured[axis, 3] = 0.3
        relative = RelativePose(0, 1, measured, np.diag(np.full(6, 0.01)))
        np.testing.assert_allclose(residual_distances(T, [relative]), [9.0])


def test_no_closures_have_no_residuals():
    assert residual_distances(np.eye(4)[None], []).shape == (0,)


def test_votes_that_the_graph_takes_away_leave_the_rest_unbelieved(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    closures = survey.true_closures(rng)
    wrong_in_depth = [replace(c, T_target_source=c.T_target_source.copy()) for c in closures]
    for closure in wrong_in_depth[1:]:
        closure.T_target_source[2, 3] += 3.0 * rng.choice([-1.0, 1.0])
    solution = survey.graph(wrong_in_depth, consistency=ConsistencyConfig(min_votes=8)).solve()
    assert not solution.is_inlier.any()
    assert solution.T_world_anchor.tobytes() == survey.dr_anchors.tobytes()
