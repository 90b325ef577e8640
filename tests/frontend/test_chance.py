import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.stats import norm

from frontend.chance import expected_by_chance, joint_chance, pooled, significance
from frontend.correlation import all_shifts, correlate, spectra
from frontend.frames import planar_pose
from frontend.priors import Prior
from frontend.relief import correlation_area


def prior(shift=8.0, turn=0.035):
    return Prior(planar_pose(0.0, 0.0, 0.0), np.diag([1.0, 1.0, turn**2, shift**2, shift**2, 1.0]))


def test_significance_is_fishers():
    assert significance(np.tanh(1.0), 1000.0, 10.0) == pytest.approx(np.sqrt(97.0))


def test_a_perfect_correlation_over_too_little_floor_is_worth_nothing():
    assert significance(1.0, 30.0, 10.0) == 0


def test_a_perfect_correlation_is_finite():
    assert np.isfinite(significance(1.0, 1000.0, 10.0))


def test_half_the_overlap_wants_a_higher_correlation():
    assert significance(0.5, 2000.0, 20.0) > significance(0.6, 1000.0, 20.0)


def test_correlations_of_unrelated_fields_scatter_as_the_significance_says():
    rng = np.random.default_rng(0)
    values = []
    for _ in range(12):
        a, b = (gaussian_filter(rng.normal(size=(96, 96)), 1.5, mode="wrap") for _ in range(2))
        area = np.sqrt(correlation_area(a, np.ones_like(a), 1.0) * correlation_area(b, np.ones_like(b), 1.0))
        padded = all_shifts(a.shape, b.shape).needs(a.shape, b.shape)
        surface = correlate(spectra(a[None], np.ones_like(a), padded), spectra(b[None], np.ones_like(b), padded))
        big = surface.overlap >= 0.3 * a.size
        values.append(significance(surface.correlation[0, big], surface.overlap[big], area))
    # 12 pairs of about 2000 independent shifts; the correlation area is right to 10 %
    assert np.std(np.concatenate(values)) == pytest.approx(1.0, abs=0.1)


def test_chance_falls_with_significance_and_grows_with_the_gate():
    low, high = (expected_by_chance(u, 4000.0, 20.0, prior()) for u in (4.0, 6.0))
    assert high < 1e-3 * low
    assert expected_by_chance(5.0, 4000.0, 20.0, prior(16.0)) == pytest.approx(
        4 * expected_by_chance(5.0, 4000.0, 20.0, prior(8.0)),
        rel=5e-3,  # a prior has a least width
    )
    assert expected_by_chance(5.0, 4000.0, 20.0, prior(turn=0.07)) == pytest.approx(
        2 * expected_by_chance(5.0, 4000.0, 20.0, prior()), rel=5e-3
    )


def test_no_significance_is_certain_to_occur():
    assert expected_by_chance(0.0, 4000.0, 20.0, prior()) > 1
    assert expected_by_chance(-2.0, 4000.0, 20.0, prior()) == expected_by_chance(0.5, 4000.0, 20.0, prior())


def test_expected_maxima_of_a_gaussian_field_are_those_that_occur():
    """A smooth Gaussian field on a torus, three axes of equal scale, against the formula with an equal volume."""
    rng = np.random.default_rng(1)
    n, s, level, count = 64, 2.0, 3.0, 0
    for _ in range(40):
        field = gaussian_filter(rng.normal(size=(n, n, n)), s, mode="wrap")
        field /= field.std()
        peak = np.ones_like(field, dtype=bool)
        for axis in range(3):
            for step in (-1, 1):
                peak &= field > np.roll(field, step, axis)
        count += int((peak & (field > level)).sum())
    # the field's gradient has variance 1 / (2 s^2): that of a correlation area of pi s^2
    area = np.pi * s**2
    volume = float(n**3)
    gate = Prior(np.eye(4), np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 1.0]))
    scale = volume / (4 / 3 * np.pi * gate.limit**1.5)
    expected = 40 * scale * expected_by_chance(level, 2 * np.pi, area, gate)
    # some hundred peaks: 5 % by counting; the formula counts peaks less saddles, a few per cent fewer at this level
    assert expected == pytest.approx(count, rel=0.2)


AREAS = (4000.0, 10.0, 20.0)


def test_a_second_witness_that_knows_nothing_costs_a_factor_of_two():
    assert joint_chance(7.0, 0.0, AREAS, prior()) == pytest.approx(2 * expected_by_chance(7.0, 4000.0, 10.0, prior()))


def test_a_second_witness_that_agrees_makes_it_surer_and_one_that_contradicts_changes_nothing():
    sure, likely, silent, contradicting = (joint_chance(7.0, echo, AREAS, prior()) for echo in (6.0, 4.0, 0.0, -3.0))
    assert sure < likely < silent
    assert contradicting == silent


def test_the_chance_of_two_witnesses_is_that_of_their_mean_over_unrelated_floors():
    """Of many pairs of white fields, as many exceed a pooled level as either try alone says, to its factor of two."""
    rng = np.random.default_rng(0)
    by_shape, by_echo = rng.normal(size=(2, 200_000))
    above = np.mean(pooled(by_shape, by_echo) > 3.0)
    assert norm.sf(3.0) < above < 2 * norm.sf(3.0)


def test_the_surest_thing_has_next_to_no_chance():
    assert joint_chance(60.0, 5.0, AREAS, prior()) == pytest.approx(0.0, abs=1e-300)
