"""Navigation slower than the pings: tracks whose truth is known, held and rounded."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sssslam.readers.held_navigation import (
    fill_unknown,
    fix_pings,
    interpolate_positions,
    interpolate_series,
    resolution,
    stray_positions,
)


def _held(values: np.ndarray, every: int) -> np.ndarray:
    return values[every * (np.arange(len(values)) // every)]


@pytest.mark.parametrize("every", [2, 3, 8])
def test_a_straight_track_is_recovered_from_its_fixes(every):
    time = 0.1 * np.arange(100)
    east, north = 1.5 * time, -0.7 * time
    held = [_held(axis, every) for axis in (east, north)]
    x, y = interpolate_positions(time, *held, fix_pings(*held))
    # The local fit is kept solvable by 1e-9 on its diagonal, which costs as much of the metres fitted.
    np.testing.assert_allclose(x, east, atol=1e-7)
    np.testing.assert_allclose(y, north, atol=1e-7)


def test_a_turn_is_recovered_to_a_centimetre():
    time = 0.1 * np.arange(400)
    east, north = 20 * np.sin(0.1 * time), 20 * (1 - np.cos(0.1 * time))
    held = [_held(axis, 5) for axis in (east, north)]
    x, y = interpolate_positions(time, *held, fix_pings(*held))
    # Cubic through fixes 1 m apart on a circle of 20 m: the chord's height is 6 mm, the last hold extrapolates 0.8 m.
    np.testing.assert_allclose(np.hypot(x - east, y - north)[:-5], 0, atol=0.01)
    np.testing.assert_allclose(np.hypot(x - east, y - north)[-5:], 0, atol=0.1)


def test_rounded_fixes_come_nearer_to_the_truth_and_stay_within_their_rounding():
    time = 0.11 * np.arange(460)
    true = 1.07 * time
    rounded = np.round(_held(true, 2) / 0.185) * 0.185
    fixes = fix_pings(rounded, np.zeros(460))
    x, _ = interpolate_positions(time, rounded, np.zeros(460), fixes)
    assert np.sqrt(np.mean((x - true) ** 2)) < 0.6 * 0.185 / np.sqrt(12)
    assert np.abs(x[fixes] - rounded[fixes]).max() <= 0.185 / 2 + 1e-9


@pytest.mark.parametrize("speed", [1.0, 1.03])
def test_a_sharp_corner_is_not_cut_by_more_than_the_rounding(speed):
    time = 0.1 * np.arange(200)
    corner = speed * np.abs(time - 10.0)
    rounded = np.round(_held(corner, 2), 2)
    fixes = fix_pings(rounded, time[:1].repeat(200))
    x, _ = interpolate_positions(time, rounded, np.zeros(200), fixes)
    assert np.abs(x[fixes] - rounded[fixes]).max() <= 0.005 + 1e-9


def test_a_vehicle_that_stands_still_is_not_moved():
    time = 0.1 * np.arange(300)
    true = np.concatenate([1.0 * time[:100], np.full(100, 10.0), 10.0 + 1.0 * time[1:101]])
    held = _held(true, 4)
    x, _ = interpolate_positions(time, held, np.zeros(300), fix_pings(held, np.zeros(300)))
    # Up to one fix late at either end of the stop: 0.4 m.
    np.testing.assert_allclose(x, true, atol=0.45)
    np.testing.assert_allclose(x[110:195], 10.0, atol=0.05)


def test_an_outage_is_bridged_at_the_speed_around_it():
    time = 0.1 * np.arange(300)
    true = 1.5 * time
    held = _held(true, 4)
    held[100:200] = held[99]
    x, _ = interpolate_positions(time, held, np.zeros(300), fix_pings(held, np.zeros(300)))
    np.testing.assert_allclose(x, true, atol=1e-6)


def test_two_fixes_make_a_line():
    time = np.arange(4.0)
    x, _ = interpolate_positions(time, np.array([0.0, 0.0, 2.0, 2.0]), np.zeros(4), np.array([0, 2]))
    np.testing.assert_allclose(x, time)


def test_resolution_is_the_grid_that_figures_sit_on():
    assert resolution(0.25 * np.array([1.0, 2, 5, 9, 7])) == pytest.approx(0.25, rel=1e-9)
    assert resolution(0.25 * np.arange(9.0)) == 0.0
    assert resolution(np.random.default_rng(1).uniform(0, 1, 200)) == 0.0
    assert resolution(np.array([1.0, 2.0])) == 0.0


def test_resolution_survives_the_decimals_of_degrees():
    minutes = np.round(45.0 * 60 + np.linspace(0, 0.05, 300), 4)
    assert resolution(minutes / 60) == pytest.approx(1e-4 / 60, rel=1e-3)


def test_only_positions_off_the_track_are_stray():
    east, north = 2.0 * np.arange(100), np.zeros(100)
    east[60:] += 30.0
    assert not stray_positions(east, north).any()
    north[[20, 21, 70]] = 5e4
    np.testing.assert_array_equal(np.flatnonzero(stray_positions(east, north)), [20, 21, 70])


def test_a_series_that_arrives_with_the_fixes_is_interpolated_and_others_are_not():
    time, fixes = 0.1 * np.arange(100), np.arange(0, 100, 4)
    smooth = np.sin(time)
    np.testing.assert_allclose(interpolate_series(time, _held(smooth, 4), fixes)[:97], smooth[:97], atol=0.03)
    np.testing.assert_array_equal(interpolate_series(time, smooth, fixes), smooth)


def test_unknown_values_are_filled_between_and_held_outside():
    filled = fill_unknown(np.arange(5.0), np.array([np.nan, 1.0, np.nan, 3.0, np.nan]))
    np.testing.assert_array_equal(filled, [1, 1, 2, 3, 3])


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=3, max_size=60))
def test_interpolated_positions_are_finite_whatever_the_fixes(points):
    east, north = np.array(points, dtype=np.float64).T
    fixes = fix_pings(east, north)
    if len(fixes) > 1:
        for axis in interpolate_positions(np.arange(float(len(points))), east, north, fixes):
            assert np.isfinite(axis).all()
