from dataclasses import replace

import numpy as np
import pytest

from backend.consistency import ConsistencyConfig
from backend.do_no_harm import DoNoHarmConfig, harmful_closures, residual_distances
from backend.factors import between_factor, pose_values
from backend.poses import RelativePose, invert
from backend.problem import Estimate


@pytest.fixture(scope="module")
def solved(make_survey):
    """A survey, its true closures and the solution that all of them hold."""
    survey, rng = make_survey(0), np.random.default_rng(0)
    closures = survey.true_closures(rng)
    solution = survey.graph(closures).solve()
    assert solution.is_inlier.all()
    return survey, closures, solution


def harm(survey, closures, solution, holding=None, agreement=None, config=None):
    """What is found harmful where these closures hold the solution."""
    holding = np.arange(len(closures)) if holding is None else holding
    estimate = Estimate(solution.T_world_anchor, holding, solution.odometry_scale)
    return harmful_closures(estimate, survey.graph(closures).problem(), agreement, config)


def test_nothing_is_withdrawn_where_all_fits(solved):
    survey, closures, solution = solved
    assert harm(survey, closures, solution) == {}


def test_the_closure_with_the_worst_residual_is_withdrawn(solved):
    survey, closures, solution = solved
    lying = replace(closures[3], T_target_source=closures[3].T_target_source.copy())
    lying.T_target_source[0, 3] += 5.0
    closures = [*closures[:3], lying, *closures[4:]]
    reasons = harm(survey, closures, solution)
    assert reasons == {3: "its residual is too large against its covariance"}


def test_closures_that_do_not_hold_the_graph_are_not_looked_at(solved):
    survey, closures, solution = solved
    lying = replace(closures[3], T_target_source=closures[3].T_target_source.copy())
    lying.T_target_source[0, 3] += 5.0
    closures = [*closures[:3], lying, *closures[4:]]
    others = np.delete(np.arange(len(closures)), 3)
    assert harm(survey, closures, solution, others) == {}
    assert harm(survey, closures, solution, others[:0]) == {}


def test_all_are_withdrawn_where_they_correct_more_than_dead_reckoning_can_be_wrong(solved):
    survey, closures, solution = solved
    strict = DoNoHarmConfig(max_correction=0.1)
    reasons = harm(survey, closures, solution, config=strict)
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


def test_closures_whose_maps_disagree_are_withdrawn_the_worst_of_them(solved):
    survey, closures, solution = solved

    def agreement(target, source, _):
        return -1.0 if (target, source) == (closures[5].target, closures[5].source) else 8.0

    assert harm(survey, closures, solution, agreement=agreement) == {5: "the maps disagree where the graph lays them"}
    among = survey.graph(closures).solve(agreement=agreement)
    assert among.reasons[5] == "the maps disagree where the graph lays them"
    assert among.is_inlier.sum() == len(closures) - 1


def test_maps_that_agreed_better_where_dead_reckoning_laid_them_speak_against_a_closure(solved):
    survey, closures, _ = solved
    relative = [invert(survey.dr_anchors[c.target]) @ survey.dr_anchors[c.source] for c in closures]

    def agreement(_, __, T_target_source):
        return 9.0 if any(np.array_equal(T_target_source, T) for T in relative) else 6.0

    solution = survey.graph(closures).solve(agreement=agreement)
    assert not solution.is_inlier.any()
    assert solution.T_world_anchor.tobytes() == survey.dr_anchors.tobytes()


def test_maps_that_do_not_overlap_say_nothing(solved):
    survey, closures, solution = solved
    assert harm(survey, closures, solution, agreement=lambda *_: float("nan")) == {}
