from dataclasses import replace

import numpy as np
import pytest

from frontend.acceptance import AcceptanceConfig, Rejection, chance_of, decide, lead_of
from frontend.frames import planar_pose
from frontend.priors import Prior
from frontend.verification import Verification

PRIOR = Prior(planar_pose(0.0, 0.0, 0.0), np.diag([1e-4, 1e-4, 1e-3, 25.0, 25.0, 1.0]))
SIGMAS = np.array([0.03, 0.03, 0.01, 0.3, 0.3, 0.4])
GOOD = Verification(
    T_target_source=planar_pose(3.0, -2.0, 0.02),
    sigmas=SIGMAS,
    correlation=0.6,
    significance=9.0,
    reflectivity_correlation=0.2,
    reflectivity_significance=2.0,
    overlap=0.5,
    overlap_area=4000.0,
    correlation_area=10.0,
    reflectivity_area=15.0,
    height_residual=1.2,
    tilt=0.01,
    middle=np.zeros(2),
)


def test_a_good_alignment_is_accepted():
    assert decide(GOOD, 3.0, PRIOR, AcceptanceConfig()) is None


@pytest.mark.parametrize(
    ("change", "runner_up", "rejection"),
    [
        ({"T_target_source": planar_pose(40.0, 0.0, 0.0)}, 3.0, Rejection.OUTSIDE_GATE),
        ({"T_target_source": planar_pose(0.0, 0.0, 0.5)}, 3.0, Rejection.OUTSIDE_GATE),
        ({"overlap": 0.2}, 3.0, Rejection.LITTLE_OVERLAP),
        ({"significance": 3.0}, 1.5, Rejection.BY_CHANCE),
        ({}, 8.5, Rejection.AMBIGUOUS),
        ({"height_residual": 9.0}, 3.0, Rejection.HEIGHTS_DISAGREE),
        ({"height_residual": float("nan")}, 3.0, Rejection.HEIGHTS_DISAGREE),
        ({"sigmas": SIGMAS * [1, 1, 1, 1, 20, 1]}, 3.0, Rejection.LOOSE),
        ({"sigmas": SIGMAS * [1, 1, 1, np.inf, 1, 1]}, 3.0, Rejection.LOOSE),
    ],
)
def test_each_rule_that_is_broken_is_named(change, runner_up, rejection):
    assert decide(replace(GOOD, **change), runner_up, PRIOR, AcceptanceConfig()) is rejection


def test_a_long_lead_makes_up_for_some_chance_and_the_other_way_round():
    config, faint = AcceptanceConfig(), replace(GOOD, significance=4.9)
    assert chance_of(faint, PRIOR) > 1e-3
    assert decide(faint, faint.level - 4.0, PRIOR, config) is None
    assert decide(faint, faint.level - 1.2, PRIOR, config) is Rejection.BY_CHANCE
    assert decide(GOOD, GOOD.level - 1.2, PRIOR, config) is None


def test_more_is_asked_for_where_more_is_asked():
    config = AcceptanceConfig(min_probability=1 - 1e-15)
    assert decide(GOOD, 3.0, PRIOR, config) is Rejection.BY_CHANCE


def test_a_next_best_below_chance_is_no_further_lead():
    assert lead_of(GOOD, -3.0) == lead_of(GOOD, 0.0) == GOOD.level


def test_reasons_hold_no_comma_and_fit_a_line():
    assert all("," not in reason and "\n" not in reason and reason for reason in Rejection)


def test_a_wider_gate_wants_more_significance():
    wide = Prior(PRIOR.T_target_source, PRIOR.covariance * 25.0)
    assert chance_of(GOOD, wide) > 100 * chance_of(GOOD, PRIOR)


def test_agreeing_reflectivity_lowers_the_chance_and_contradicting_does_not():
    agreeing, silent, contradicting = (
        chance_of(replace(GOOD, reflectivity_significance=z), PRIOR) for z in (6.0, 0.0, -4.0)
    )
    assert agreeing < silent == contradicting
