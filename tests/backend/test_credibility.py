from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from backend.consistency import ConsistencyConfig, consistent_closures, credible_set
from backend.credibility import is_credible, log_alias_ratio, log_set_chance
from backend.innovations import Innovations
from backend.pose_graph import PoseGraphConfig

GATE = chi2.ppf(0.9999, 3)
STEP = np.array([1e-4, 1.0, 1.0])  # variance of a step: yaw, x, y
NOISE = 1e-2 * STEP


def loops(residuals, length, heading=None):
    """Closures of loops one after the other, that share no step, each so many steps long."""
    residuals, n = np.asarray(residuals, dtype=np.float64), len(residuals)
    first = np.arange(n) * length
    drift = np.arange(n * length + 1)[:, None, None] * np.diag(STEP)
    each = (np.tile(np.diag(NOISE), (n, 1, 1)), first, first + length, drift, np.zeros((n, 3)))
    ahead = np.tile([1.0, 0.0], (n, 1)) if heading is None else np.asarray(heading)
    return Innovations(residuals[:, 0], residuals[:, 1:], *each, np.full(n, np.sqrt(length)), np.ones(n), ahead)


def at_distances(distances, length):
    """Closures that lie along x, so many standard deviations from dead reckoning."""
    residuals = np.zeros((len(distances), 3))
    residuals[:, 1] = np.asarray(distances) * np.sqrt(length * STEP[1] + NOISE[1])
    return loops(residuals, length)


def alias_ratio(votes, scale):
    """Of a set beside which there is no other closure."""
    return log_alias_ratio(votes, votes[np.zeros(0, dtype=np.int64)], scale)


@pytest.mark.parametrize("distance", [0.5, 2.0, 4.0])
def test_the_chance_of_one_closure_is_the_share_of_the_gate_that_lies_nearer_times_how_many_there_are(distance):
    chance = np.exp(log_set_chance(at_distances([distance], 9), 1.0, 5))
    assert chance == pytest.approx(5.0 * (distance**2 / GATE) ** 1.5)


def test_beyond_the_gate_a_closure_may_have_fallen_as_far():
    assert log_set_chance(at_distances([9.0], 9), 1.0, 5) == pytest.approx(np.log(5.0))


def test_the_chance_of_two_is_how_often_false_ones_agree_as_well():
    rng, n = np.random.default_rng(0), 200_000
    direction = rng.standard_normal((n, 2, 3))
    radius = np.sqrt(GATE) * rng.uniform(size=(n, 2, 1)) ** (1.0 / 3.0)
    false = (radius * direction / np.linalg.norm(direction, axis=-1, keepdims=True)).reshape(n, 6)
    share = ((false**2).sum(axis=1) <= 3.0**2 + 1.0**2).mean()
    # 200 000 draws of a share of about a twentieth are good to one in a hundred
    assert np.exp(log_set_chance(at_distances([3.0, 1.0], 9), 1.0, 2)) == pytest.approx(share, rel=0.03)


def test_more_to_choose_from_makes_chance_likelier_by_the_number_of_ways():
    votes = at_distances([1.0, 1.0, 1.0], 4)
    more = log_set_chance(votes, 1.0, 10) - log_set_chance(votes, 1.0, 3)
    assert more == pytest.approx(np.log(120.0))


def test_loops_of_every_length_that_are_off_by_the_same_are_deceived_and_not_adrift():
    same = np.tile([0.0, 3.0, -3.0], (8, 1))
    assert alias_ratio(loops(same, 4), 1.5) > 3.0
    # as far off and each its own way, as drift is
    turned = same * np.sign(np.random.default_rng(3).standard_normal((8, 3)))
    assert alias_ratio(loops(turned, 4), 1.5) < 0.0


def test_what_is_wrong_ahead_is_told_where_the_vehicle_heads_every_way():
    heading = np.array([[np.cos(a), np.sin(a)] for a in np.arange(8) * np.pi / 4.0])
    wrong = np.concatenate([np.zeros((8, 1)), 4.0 * heading], axis=1)
    assert alias_ratio(loops(wrong, 4, heading), 1.5) > 3.0
    assert alias_ratio(loops(wrong, 4, heading[::-1]), 1.5) < 0.0


def test_drift_three_times_its_model_is_no_offset():
    rng = np.random.default_rng(1)
    adrift = 3.0 * np.sqrt(9 * STEP) * rng.standard_normal((200, 10, 3))
    ratios = [alias_ratio(loops(one, 9), 3.0) for one in adrift]
    # were the priors those by which it drifts, a ratio of ten would come up once in ten times at most (Markov)
    assert np.mean(np.array(ratios) > np.log(10.0)) < 0.1


def test_what_is_credible_is_set_by_the_user():
    closures, members = at_distances([1.0, 1.0, 1.0, 4.0, 4.0], 4), np.arange(3)
    chance = np.exp(log_set_chance(closures[members], 1.0, 5))
    for allowed, expected in ((2.0 * chance, True), (0.5 * chance, False)):
        assert is_credible(closures, members, 1.0, ConsistencyConfig(max_set_chance=allowed, stretch=1)) == expected
    doubted = ConsistencyConfig(max_set_chance=10.0, alias_odds=1e6, stretch=1)
    assert not is_credible(closures, members, 1.0, doubted)


def test_thirty_false_closures_alone_are_hardly_ever_believed(make_survey):
    believed = 0
    for seed in range(12):
        survey, rng = make_survey(seed), np.random.default_rng(seed)
        believed += consistent_closures(survey.compared(survey.independent_false(30, rng))).is_member.any()
    # a tenth of a set is expected a dive at most, so 1.2 in twelve; four or more would come up once in thirty times
    assert believed < 4


@pytest.mark.parametrize("method", ["consistent", "incremental", "particles", "atlas"])
@pytest.mark.parametrize("seed", range(3))
def test_closures_from_all_over_with_one_wrong_offset_are_not_believed(make_survey, seed, method):
    survey, rng = make_survey(seed), np.random.default_rng(seed)
    # of legs side by side too: what all share between two passes of the area would be drift as well
    near = survey.revisits(60.0)
    pairs = [near[k] for k in rng.choice(len(near), 20, replace=False)]
    false = [survey.false_closure(*pair, np.array([5.0, 4.0, 0.0]), rng) for pair in pairs]
    solution = survey.graph(false, config=PoseGraphConfig(method=method)).solve()
    assert not solution.is_inlier.any()
    np.testing.assert_array_equal(solution.T_world_anchor, survey.dr_anchors)


def test_a_set_that_somebody_else_chose_passes_only_where_it_is_credible(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    true, config = survey.true_closures(rng), ConsistencyConfig()
    compared, members = survey.compared(true), np.arange(len(true))
    found = credible_set(compared, members, 2.0, config)
    assert found.is_member.all()
    assert found.odometry_scale == 2.0
    doubted = credible_set(compared, members, 2.0, config.model_copy(update={"alias_odds": 1e30}))
    assert not doubted.is_member.any()
    assert doubted.odometry_scale == 1.0
    assert not credible_set(compared, members[:1], 2.0, config).is_member.any()  # one vote


def test_what_is_believed_alone_passes_though_the_set_does_not(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    target, source = min(survey.revisits(), key=lambda pair: pair[1] - pair[0])
    sure = replace(survey.compared([survey.closure(target, source, rng)]), chance=np.zeros(1))
    config = ConsistencyConfig(max_lone_reach=1e3)
    assert credible_set(sure, np.zeros(0, dtype=np.int64), 2.0, config).is_member.all()


@pytest.mark.parametrize("drift_factor", [1.0, 3.0])
@pytest.mark.parametrize("seed", range(4))
def test_true_closures_are_credible_whatever_the_drift(make_survey, drift_factor, seed):
    survey, rng = make_survey(seed, drift_factor), np.random.default_rng(seed)
    assert consistent_closures(survey.compared(survey.true_closures(rng))).is_member.mean() > 0.6
