"""Series: linear, round the circle and smooth between their own times, silent far beyond their ends."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sssslam.navigation.series import Series, interpolate, interpolate_angle, interpolate_position, make_series


def test_a_series_is_put_in_order_without_unknown_and_repeated_times():
    series = make_series(np.array([3.0, 1.0, 2.0, 1.0, np.nan]), np.array([30.0, 10.0, np.nan, 11.0, 50.0]))
    np.testing.assert_array_equal(series.time, [1.0, 3.0])
    np.testing.assert_array_equal(series.values, [10.0, 30.0])
    assert make_series(np.array([1.0]), np.array([np.nan])) is None


def test_values_between_are_linear_and_held_for_two_intervals_beyond():
    series = Series(np.array([0.0, 1.0, 2.0]), np.array([0.0, 10.0, 20.0]))
    np.testing.assert_array_equal(
        interpolate(series, np.array([-2.5, -2.0, 0.5, 3.9, 4.1])), [np.nan, 0, 5, 20, np.nan]
    )


def test_angles_go_the_short_way_round():
    series = Series(np.array([0.0, 1.0]), np.radians([179.0, -179.0]))
    np.testing.assert_allclose(np.degrees(interpolate_angle(series, np.array([0.5]))), 180.0)


def test_a_position_between_fixes_follows_a_curve_and_beyond_them_goes_on():
    time = np.arange(0.0, 60.0, 5.0)
    series = Series(time, 100 * np.sin(time / 40))
    at = np.array([-5.0, 12.5, 56.0])
    # Between: a cubic errs by its third order, some (5/40)^3 * 100 / 24 = 8 mm; beyond: by the bend, decimetres.
    np.testing.assert_allclose(interpolate_position(series, at)[1], 100 * np.sin(at[1] / 40), atol=0.05)
    np.testing.assert_allclose(interpolate_position(series, at), 100 * np.sin(at / 40), atol=0.5)


def test_a_single_value_speaks_for_its_own_moment_only():
    series = Series(np.array([1.0]), np.array([7.0]))
    np.testing.assert_array_equal(interpolate_position(series, np.array([0.9, 1.0])), [np.nan, 7.0])
    assert series.interval == 0


@given(st.lists(st.tuples(st.floats(0, 1e6), st.floats(-1e6, 1e6)), min_size=1, max_size=20))
def test_a_series_gives_its_own_values_back(points):
    series = make_series(*np.array(points).T)
    # Times a microsecond apart cost the cubic some digits of a position.
    np.testing.assert_allclose(interpolate(series, series.time), series.values)


def test_numbers_that_nothing_in_the_sea_has_are_unknown_and_slopes_stay_finite():
    assert make_series(np.array([1.0, 2.0]), np.array([1e308, -np.inf])) is None
    assert make_series(np.array([1e17]), np.array([1.0])) is None
    series = make_series(np.array([0.0, 1e-320, 1.0, 2.0]), np.array([0.0, 5.0, 1.0, 2e9]))
    np.testing.assert_array_equal(series.time, [0.0, 1.0])
    for tiny in (1e-320, -1e-200):
        series = make_series(np.arange(4.0), np.array([tiny, 0.0, 1.0, 2.0]))
        with np.errstate(all="raise"):
            assert interpolate_position(series, np.array([0.5]))[0] == 0
    series = make_series(np.array([0.0, 1e-320, 1.0, 2.0]), np.array([0.0, 5.0, 1.0, 2e9]))
    with np.errstate(all="raise"):
        np.testing.assert_array_equal(interpolate_position(series, np.array([0.5])), [0.5])
