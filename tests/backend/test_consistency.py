import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from backend.consistency import (
    ConsistencyConfig,
    consistent_closures,
    count_votes,
    group_closures,
    reconsidered,
    suit_overlap,
)
from backend.innovations import Innovations, innovations
from backend.stacks import stacked


def test_all_true_closures_agree(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    consistent = consistent_closures(survey.compared(survey.true_closures(rng)))
    assert consistent.is_member.all()
    assert consistent.odometry_scale < 2.0


@pytest.mark.parametrize("seed", [0, 1])
def test_of_as_many_independent_false_closures_hardly_one_agrees(make_survey, seed):
    survey, rng = make_survey(seed), np.random.default_rng(seed)
    true = survey.true_closures(rng)
    is_member = consistent_closures(survey.compared(true + survey.independent_false(len(true), rng))).is_member
    assert is_member[: len(true)].sum() >= len(true) - 1
    assert is_member[len(true) :].sum() <= 1  # by chance a false one lies where it should


@pytest.mark.parametrize("seed", [0, 1])
def test_two_groups_of_false_closures_with_one_offset_each_do_not_outvote_the_true_ones(make_survey, seed):
    survey, rng = make_survey(seed), np.random.default_rng(seed)
    true = survey.true_closures(rng)
    false = survey.repeated_false(2 * len(true), len(true), rng)
    is_member = consistent_closures(survey.compared(true + false)).is_member
    assert is_member[: len(true)].sum() >= len(true) - 1
    assert not is_member[len(true) :].any()


def test_drift_three_times_its_model_is_blamed_on_odometry_and_not_on_closures(make_survey):
    scales = []
    for seed in range(5):
        survey, rng = make_survey(seed, drift_factor=3.0), np.random.default_rng(seed)
        consistent = consistent_closures(survey.compared(survey.true_closures(rng)))
        assert consistent.is_member.mean() > 0.6
        scales.append(consistent.odometry_scale)
    assert 1.4 < np.median(scales) < 4.1  # one draw of the constant errors each: far from the mean factor


def test_one_place_many_times_is_one_vote_and_not_believed(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    closures = [survey.closure(t, s, rng) for t, s in [(4, 57), (4, 58), (5, 57), (3, 57)]]
    compared = survey.compared(closures)
    assert count_votes(compared, ConsistencyConfig()) == 1
    assert not consistent_closures(compared).is_member.any()
    assert consistent_closures(compared, ConsistencyConfig(min_votes=1)).is_member.all()


def test_a_single_closure_is_believed_only_if_asked_for_and_near_dead_reckoning(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    alone = [survey.closure(4, 57, rng)]
    far = [survey.false_closure(4, 57, np.array([300.0, 300.0, 0.0]), rng)]
    one_is_enough = ConsistencyConfig(min_votes=1)
    assert not consistent_closures(survey.compared(alone)).is_member.any()
    assert consistent_closures(survey.compared(alone), one_is_enough).is_member.all()
    assert not consistent_closures(survey.compared(far), one_is_enough).is_member.any()


def lone(survey, closure, chance):
    return innovations(survey.dr_anchors, stacked(survey.odometry()), stacked([closure]), [chance])


def test_a_single_closure_is_believed_where_it_is_sure_and_dead_reckoning_tight(make_survey):
    survey, rng = make_survey(0, drift_factor=0.5), np.random.default_rng(0)
    near, far = survey.closure(44, 50, rng), survey.closure(4, 57, rng)
    assert lone(survey, near, 0.0).reach < 5.0 < lone(survey, far, 0.0).reach
    assert consistent_closures(lone(survey, near, 1e-9)).is_member.all()
    assert not consistent_closures(lone(survey, near, 1e-3)).is_member.any()
    assert not consistent_closures(lone(survey, far, 1e-9)).is_member.any()
    never = ConsistencyConfig(max_lone_chance=0.0)
    assert not consistent_closures(lone(survey, near, 1e-9), never).is_member.any()


def test_a_sure_closure_outside_the_gate_is_not_believed(make_survey):
    survey, rng = make_survey(0, drift_factor=0.5), np.random.default_rng(0)
    false = survey.false_closure(44, 50, np.array([12.0, 12.0, 0.0]), rng)
    assert not consistent_closures(lone(survey, false, 1e-9)).is_member.any()


def test_sure_closures_that_contradict_each_other_are_not_believed():
    # dead reckoning is good to 2 m, each closure to 0.1 m, and they lie 2 m apart
    def two(chance):
        drift = np.arange(5)[:, None, None] * np.diag([1e-6, 1.0, 1.0])
        shift, noise = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.tile(np.diag([1e-6, 0.01, 0.01]), (2, 1, 1))
        ends = (np.array([0, 0]), np.array([4, 4]))
        return Innovations(
            np.zeros(2), shift, noise, *ends, drift, np.zeros((2, 3)), np.full(2, 2.0), np.array(chance), np.eye(2)
        )

    assert not consistent_closures(two([1e-9, 1e-9])).is_member.any()
    assert consistent_closures(two([1e-9, 1.0])).is_member.tolist() == [True, False]
    assert consistent_closures(two([1.0, 1e-9])).is_member.tolist() == [False, True]


def test_about_a_solution_all_true_closures_agree_though_dead_reckoning_is_far_off(make_survey):
    survey, rng = make_survey(3, drift_factor=3.0), np.random.default_rng(3)
    true = survey.true_closures(rng)
    believed = consistent_closures(survey.compared(true))
    about = innovations(survey.true_anchors, stacked(survey.odometry()), stacked(true))
    again = reconsidered(about, believed, ConsistencyConfig())
    assert again.is_member.sum() >= believed.is_member.sum()
    assert again.is_member.all()


def test_places_that_agree_on_more_drift_than_any_scale_allows_are_not_believed():
    # 1 m**2 a step, 36 steps a loop and 32 of them shared: an offset of 18 m is three standard deviations, of 150 m 25
    for offset, is_believed in ((18.0, True), (150.0, False)):
        shift, ends = np.array([[offset, 0.0], [offset + 0.5, 0.0]]), np.array([[0, 4], [36, 40]])
        drift = np.arange(41)[:, None, None] * np.diag([1e-6, 1.0, 1.0])
        compared = Innovations(
            np.zeros(2),
            shift,
            np.tile(np.diag([1e-6, 0.01, 0.01]), (2, 1, 1)),
            *ends,
            drift,
            np.zeros((2, 3)),
            np.zeros(2),
            np.ones(2),
            np.eye(2),
        )
        assert consistent_closures(compared).is_member.all() == is_believed


def test_no_closures_make_an_empty_set(make_survey):
    consistent = consistent_closures(make_survey(0).compared([]))
    assert consistent.is_member.shape == (0,)
    assert consistent.odometry_scale == 1.0


def test_closures_left_out_by_thinning_are_judged_by_the_others(make_survey):
    survey, rng = make_survey(1), np.random.default_rng(1)
    true = survey.true_closures(rng)
    closures = true + survey.independent_false(5, rng)
    thinned = consistent_closures(survey.compared(closures), ConsistencyConfig(max_closures=12))
    assert thinned.is_member[: len(true)].sum() >= len(true) - 1
    assert thinned.is_member[len(true) :].sum() <= 1


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(41, 80)), max_size=30), st.integers(1, 8))
def test_members_of_a_group_lie_near_its_founder_and_founders_apart(ends, stretch):
    first, last = np.array(ends, dtype=np.int64).reshape(-1, 2).T
    group = group_closures(first, last, stretch)
    order = np.lexsort((last, first))
    founders = {number: next(int(c) for c in order if group[c] == number) for number in set(group.tolist())}
    for closure, number in enumerate(group):
        founder = founders[int(number)]
        assert abs(first[closure] - first[founder]) < stretch
        assert abs(last[closure] - last[founder]) < stretch
    for a in founders.values():
        for b in founders.values():
            assert a == b or abs(first[a] - first[b]) >= stretch or abs(last[a] - last[b]) >= stretch


@given(st.floats(0.0, 0.95))
def test_closures_share_a_vote_within_two_window_lengths(overlap):
    stretch = suit_overlap(ConsistencyConfig(), overlap).stretch
    apart = 1.0 - overlap  # window lengths from one anchor to the next
    assert stretch * apart + 1e-6 >= 2.0
    assert (stretch - 1) * apart < 2.0
    assert suit_overlap(ConsistencyConfig(stretch=7), overlap).stretch == 7


def test_a_larger_stretch_makes_fewer_groups():
    first, last = np.arange(0, 20), np.arange(60, 40, -1)  # two opposite legs side by side
    assert [len(set(group_closures(first, last, stretch).tolist())) for stretch in (1, 2, 5, 30)] == [20, 10, 4, 1]


def test_misspelt_settings_are_refused():
    with pytest.raises(ValidationError, match="min_vote"):
        ConsistencyConfig(min_vote=1)
