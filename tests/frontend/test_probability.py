import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.frames import planar_parameters, planar_pose
from frontend.overlap import stack_layers
from frontend.priors import Prior
from frontend.probability import ProbabilityConfig, log_odds, probability
from frontend.relief import extract_relief
from frontend.search import propose
from frontend.verification import verify
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor

significances = st.floats(-5.0, 30.0)
correlations = st.floats(-1.0, 1.0)


def test_an_alignment_that_says_nothing_has_the_odds_of_the_offset():
    config = ProbabilityConfig(offset=-2.0)
    assert log_odds(0.0, 0.0, 0.0, config) == pytest.approx(-2.0)
    assert probability(0.0, 0.0, 0.0, config) == pytest.approx(1 / (1 + np.exp(2.0)))


def test_lead_and_correlation_add_their_weights():
    config = ProbabilityConfig(offset=-4.0, lead=2.0, correlation=10.0)
    assert log_odds(7.0, 5.5, 0.3, config) == pytest.approx(-4.0 + 3.0 + 3.0)


def test_only_the_lead_counts_not_how_significant_both_are():
    assert log_odds(9.0, 8.0, 0.3) == pytest.approx(log_odds(5.0, 4.0, 0.3))


def test_a_next_best_below_chance_is_no_further_lead():
    assert log_odds(4.0, -3.0, 0.3) == log_odds(4.0, 0.0, 0.3)


def test_another_share_of_true_pairs_changes_the_odds_by_bayes_rule():
    p, share = probability(6.0, 4.0, 0.25), ProbabilityConfig().share
    rare = 0.01
    true, false = p / share * rare, (1 - p) / (1 - share) * (1 - rare)
    assert probability(6.0, 4.0, 0.25, ProbabilityConfig(share=rare)) == pytest.approx(true / (true + false))


@given(significances, significances, correlations)
def test_a_probability_is_one(significance, runner_up, correlation):
    assert 0 <= probability(significance, runner_up, correlation) <= 1


@given(significances, significances, st.floats(-1.0, 0.9), st.floats(0.01, 0.1))
def test_more_significance_and_more_correlation_are_likelier_true(significance, runner_up, correlation, more):
    base = log_odds(significance, runner_up, correlation)
    assert log_odds(significance + more, runner_up, correlation) > base
    assert log_odds(significance, runner_up, correlation + more) > base
    assert log_odds(significance, runner_up + more, correlation) <= base


@pytest.mark.parametrize("bad", [(np.nan, 0.0), (0.0, np.inf)])
def test_a_significance_that_is_no_number_is_refused(bad):
    with pytest.raises(ValueError, match="significances must be finite, got"):
        probability(*bad, 0.3)


@pytest.mark.parametrize("bad", [1.2, -1.2, np.nan])
def test_a_correlation_beyond_one_is_refused(bad):
    with pytest.raises(ValueError, match="a correlation lies between -1 and 1, got"):
        probability(6.0, 3.0, bad)


def submap_layers(seafloor, pose, rng, number):
    return stack_layers(extract_relief(cut_submap(seafloor, planar_parameters(pose), rng, number, 0.06)))


def probability_of_best(target, source, prior):
    peaks = propose(target.relief, source.relief, prior)
    verified = sorted((verify(target, source, p.T_target_source) for p in peaks), key=lambda v: -v.significance)
    return probability(verified[0].significance, verified[1].significance, verified[0].correlation)


def test_the_same_place_is_probable_and_another_floor_is_not():
    rng = np.random.default_rng(4)
    seafloor, other = rough_seafloor(rng), rough_seafloor(rng)
    start, relative = planar_pose(150.0, 150.0, 0.2), planar_pose(10.0, -15.0, 0.6)
    prior = Prior(planar_pose(14.0, -10.0, 0.62), np.diag([1e-4, 1e-4, 1e-3, 64.0, 64.0, 1.0]))
    target = submap_layers(seafloor, start, rng, 0)
    same, elsewhere = (submap_layers(floor, start @ relative, rng, 1) for floor in (seafloor, other))
    assert probability_of_best(target, same, prior) > 0.99
    assert probability_of_best(target, elsewhere, prior) < 0.5
