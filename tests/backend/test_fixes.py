import logging
from dataclasses import replace

import gtsam
import numpy as np
import pytest

from backend.fixes import FIX_BEYOND_DRIFT, harmful_fixes
from backend.optimiser import marginal_covariances

WELL_KNOWN = (0.005, 0.005, 0.005, 0.01, 0.01, 0.1)  # sigmas of the first pose: heading and place from the surface
SIGMA = 1.0  # of a fix [m]


def fixed(survey, anchors, rng, closures=(), offsets=None):
    """A graph with fixes as good as they say, moved by offsets [m] where there are any."""
    graph, offsets = survey.graph(list(closures), first_pose=WELL_KNOWN), offsets or {}
    for anchor in anchors:
        seen = survey.true_anchors[anchor][:2, 3] + SIGMA * rng.normal(size=2) + offsets.get(anchor, 0.0)
        graph.add_fix(anchor, *seen, SIGMA)
    return graph


def aligned(make_survey, seed, drift_factor=1.0):
    """A survey whose dead reckoning begins at the truth."""
    survey = make_survey(seed, drift_factor)
    first = survey.anchor_pings[0]
    G = survey.T_world_body[first] @ np.linalg.inv(survey.T_world_body_dr[first])
    yaw = np.arctan2(G[1, 0], G[0, 0])
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    turn[:2, 3] = survey.T_world_body[first][:2, 3] - turn[:2, :2] @ survey.T_world_body_dr[first][:2, 3]
    return replace(survey, T_world_body_dr=turn @ survey.T_world_body_dr)


def test_how_far_a_fix_may_lie_is_gtsams_marginal_of_its_anchor_and_its_own_variance(make_survey):
    survey = make_survey(0)
    graph, last = survey.graph([], first_pose=WELL_KNOWN), len(survey.dr_anchors) - 1
    problem = graph.problem()
    held = [factor for factor in problem.known_factors(1.0) if not isinstance(factor, gtsam.PoseTranslationPrior3D)]
    body = marginal_covariances(held, survey.dr_anchors)[last][3:, 3:]
    R = survey.dr_anchors[last][:3, :3]
    marginal = (R @ body @ R.T)[:2, :2] + SIGMA**2 * np.eye(2)
    worst = np.linalg.eigh(marginal)
    along, sd = worst[1][:, 1], np.sqrt(worst[0][1])
    limit = np.sqrt(-2.0 * np.log(1.0 - 0.99))  # of a Rayleigh variable
    for share, is_taken in ((0.97, True), (1.03, False)):  # tilt moves the marginal by a percent or two
        graph = survey.graph([], first_pose=WELL_KNOWN)
        graph.add_fix(last, *(survey.dr_anchors[last][:2, 3] + share * limit * sd * along), SIGMA)
        assert (harmful_fixes(graph.problem(), 1.0, 0.99) == {}) is is_taken


@pytest.mark.parametrize("drift_factor", [1.0, 3.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_good_fixes_are_all_taken_though_dead_reckoning_is_worse_than_its_model(make_survey, seed, drift_factor):
    survey, rng = aligned(make_survey, seed, drift_factor), np.random.default_rng(seed)
    solution = fixed(survey, [10, 30, 31, 45, 60], rng, survey.true_closures(rng)).solve()
    assert solution.fix_reasons == ("",) * 5
    error = solution.T_world_anchor[[10, 30, 45, 60], :2, 3] - survey.true_anchors[[10, 30, 45, 60], :2, 3]
    assert np.abs(error).max() < 4.0 * SIGMA


def test_a_fix_that_is_wildly_wrong_is_left_out_with_a_reason_and_does_no_harm(make_survey, caplog):
    survey = aligned(make_survey, 0)
    closures = survey.true_closures(np.random.default_rng(0))
    anchors, wrong = [10, 30, 45, 60], {45: np.array([400.0, -300.0])}
    with caplog.at_level(logging.WARNING, logger="backend.solving"):
        solution = fixed(survey, anchors, np.random.default_rng(1), closures, wrong).solve()
    assert solution.fix_reasons == ("", "", FIX_BEYOND_DRIFT, "")
    assert "the fix of anchor 45 is not taken" in caplog.text
    assert "," not in FIX_BEYOND_DRIFT
    without = survey.graph(closures, first_pose=WELL_KNOWN)
    rng = np.random.default_rng(1)
    for anchor in anchors:
        seen = survey.true_anchors[anchor][:2, 3] + SIGMA * rng.normal(size=2)
        if anchor != 45:
            without.add_fix(anchor, *seen, SIGMA)
    assert solution.T_world_anchor.tobytes() == without.solve().T_world_anchor.tobytes()


def test_a_wrong_fix_does_not_take_good_neighbours_with_it(make_survey):
    survey, wrong = aligned(make_survey, 1), {31: np.array([0.0, 150.0])}
    reasons = fixed(survey, [29, 30, 31, 32, 33], np.random.default_rng(2), offsets=wrong).solve().fix_reasons
    assert [bool(reason) for reason in reasons] == [False, False, True, False, False]


def test_with_the_only_fix_wrong_dead_reckoning_comes_back_bit_for_bit(make_survey):
    survey = aligned(make_survey, 0)
    solution = fixed(survey, [60], np.random.default_rng(0), offsets={60: np.array([0.0, 5000.0])}).solve()
    assert solution.fix_reasons == (FIX_BEYOND_DRIFT,)
    assert solution.T_world_anchor.tobytes() == survey.dr_anchors.tobytes()


def test_where_there_are_no_fixes_there_are_no_reasons(make_survey):
    assert make_survey(0).graph([]).solve().fix_reasons == ()


def test_with_fixes_the_track_is_as_uncertain_as_its_errors_are_large(make_survey):
    nees = []
    for seed in range(12):
        survey, rng = aligned(make_survey, seed), np.random.default_rng(seed)
        solution = fixed(survey, [15, 30, 45, 60], rng).solve()
        error = solution.T_world_anchor[1:, :2, 3] - survey.true_anchors[1:, :2, 3]
        nees.append(np.mean((error / solution.sigmas[1:, :2]) ** 2))
    # constant heading deviation, scale and misalignment make a run a chi-square of few degrees of freedom: a factor two
    assert 0.4 < np.mean(nees) < 2.0
