import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.acceptance import chance_of, lead_of
from frontend.frames import planar_parameters, planar_pose
from frontend.overlap import stack_layers
from frontend.priors import Prior
from frontend.probability import ProbabilityConfig, log_odds, probability
from frontend.relief import extract_relief
from frontend.search import propose
from frontend.verification import verify
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor

leads = st.floats(-5.0, 30.0)
chances = st.floats(0.0, 1e6)


def test_an_alignment_without_lead_that_one_pair_of_unrelated_floors_shows_has_the_odds_of_the_offset():
    config = ProbabilityConfig(offset=-2.0)
    assert log_odds(0.0, 1.0, config) == pytest.approx(-2.0)
    assert probability(0.0, 1.0, config) == pytest.approx(1 / (1 + np.exp(2.0)))


def test_lead_and_decades_of_chance_add_their_weights():
    config = ProbabilityConfig(offset=-4.0, lead=2.0, chance=0.5)
    assert log_odds(1.5, 1e-6, config) == pytest.approx(-4.0 + 3.0 + 3.0)


def test_chances_smaller_than_any_fit_has_seen_count_no_more():
    assert log_odds(2.0, 0.0) == log_odds(2.0, 1e-300) == log_odds(2.0, 1e-12)


def test_another_share_of_true_pairs_changes_the_odds_by_bayes_rule():
    p, share, rare = probability(2.0, 1e-3), ProbabilityConfig().share, 0.01
    true, false = p / share * rare, (1 - p) / (1 - share) * (1 - rare)
    assert probability(2.0, 1e-3, ProbabilityConfig(share=rare)) == pytest.approx(true / (true + false))


@given(leads, chances)
def test_a_probability_is_one(lead, chance):
    assert 0 <= probability(lead, chance) <= 1


@given(leads, st.floats(1e-11, 1e2), st.floats(0.01, 0.1))
def test_more_lead_and_less_chance_are_likelier_true(lead, chance, more):
    base = log_odds(lead, chance)
    assert log_odds(lead + more, chance) > base
    assert log_odds(lead, chance * (1 - more)) > base


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_lead_that_is_no_number_is_refused(bad):
    with pytest.raises(ValueError, match="a lead must be finite, got"):
        probability(bad, 1e-3)


@pytest.mark.parametrize("bad", [-1e-3, np.nan])
def test_a_chance_below_none_is_refused(bad):
    with pytest.raises(ValueError, match="a chance must not be negative, got"):
        probability(3.0, bad)


def submap_layers(seafloor, pose, rng, number):
    return stack_layers(extract_relief(cut_submap(seafloor, planar_parameters(pose), rng, number, 0.06)))


def probability_of_best(target, source, prior):
    peaks = propose(target.relief, source.relief, prior)
    verified = sorted((verify(target, source, p.T_target_source) for p in peaks), key=lambda v: -v.level)
    best, next_best = verified[0], verified[1]
    return probability(lead_of(best, next_best.level), chance_of(best, prior))


def test_the_same_place_is_probable_and_another_floor_is_not():
    rng = np.random.default_rng(4)
    seafloor, other = rough_seafloor(rng), rough_seafloor(rng)
    start, relative = planar_pose(150.0, 150.0, 0.2), planar_pose(10.0, -15.0, 0.6)
    prior = Prior(planar_pose(14.0, -10.0, 0.62), np.diag([1e-4, 1e-4, 1e-3, 64.0, 64.0, 1.0]))
    target = submap_layers(seafloor, start, rng, 0)
    same, elsewhere = (submap_layers(floor, start @ relative, rng, 1) for floor in (seafloor, other))
    assert probability_of_best(target, same, prior) > 0.99
    assert probability_of_best(target, elsewhere, prior) < 0.5
