"""Ping times: stamps as recorders really write them, and times that increase."""

from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from sssslam.readers.ping_times import repair_times, seconds_since_1970

T0 = 1.7e9


@given(st.datetimes(datetime(1970, 1, 1), datetime(2199, 12, 31)))
def test_seconds_since_1970_agree_with_the_standard_library(moment):
    fields = (moment.year, moment.month, moment.day, moment.hour, moment.minute, moment.second)
    ours = seconds_since_1970(np.array(fields, dtype=np.float64)[:, None])
    assert ours[0] == moment.replace(microsecond=0, tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    "bad",
    [
        (0, 1, 1, 0, 0, 0),
        (2013, 13, 1, 0, 0, 0),
        (2013, 1, 0, 0, 0, 0),
        (2013, 1, 1, 24, 0, 0),
        (2013, 1, 1, 0, 60, 0),
        (2013, 1, 1, 0, 0, 90),
    ],
)
def test_a_field_out_of_its_range_makes_no_time(bad):
    assert np.isnan(seconds_since_1970(np.array(bad, dtype=np.float64)[:, None])[0])


def test_stamps_that_increase_evenly_stay_as_they_are():
    stamps = T0 + 0.11 * np.arange(50) + np.random.default_rng(0).uniform(0, 0.05, 50)
    time, notes = repair_times(stamps, 1.0)
    np.testing.assert_array_equal(time, stamps)
    assert notes == []


def test_a_pause_is_no_fault():
    stamps = T0 + np.concatenate([0.1 * np.arange(50), 300 + 0.1 * np.arange(50)])
    time, notes = repair_times(stamps, 1.0)
    np.testing.assert_array_equal(time, stamps)
    assert notes == []


def test_whole_seconds_are_spread_at_the_true_rate():
    true = 0.114 * np.arange(500)
    time, notes = repair_times(T0 + np.floor(true), 1.0)
    # A whole second tells a ping to 1 s; lines through four bursts halve that, and the mean rate is right.
    np.testing.assert_allclose(time - T0, true - 0.5, rtol=0, atol=0.5)
    assert np.mean(np.diff(time)) == pytest.approx(0.114, rel=0.01)
    assert np.diff(time).min() > 0.05
    assert "re-spread" in notes[0]


def test_bursts_with_stamps_of_their_own_are_spread():
    burst = 0.4 * np.repeat(np.arange(50), 8) + np.tile(0.001 * np.arange(8), 50)
    time, notes = repair_times(T0 + burst, 1.0)
    # Eight pings arrive together every 0.4 s: one every 0.05 s.
    np.testing.assert_allclose(np.diff(time), 0.05, atol=0.02)
    assert "re-spread" in notes[0]


def test_a_pause_between_bursts_stays_a_pause():
    burst = np.repeat(np.arange(20.0), 10)
    time, _ = repair_times(T0 + np.concatenate([burst, burst + 500.0]), 1.0)
    assert np.diff(time).max() == pytest.approx(480.0, abs=2.0)
    assert np.sort(np.diff(time))[-2] < 0.3


def test_a_single_repeated_stamp_moves_that_ping_only():
    stamps = T0 + 0.1 * np.arange(100)
    stamps[40] = stamps[39]
    time, notes = repair_times(stamps, 1.0)
    # 1e9 s as a double is good to 2e-7 s.
    np.testing.assert_allclose(time, T0 + 0.1 * np.arange(100), rtol=0, atol=1e-6)
    assert notes == ["ping times not later than the one before, interpolated: 1"]


def test_unknown_and_stray_stamps_are_interpolated_also_at_the_ends():
    true = T0 + 0.1 * np.arange(100)
    stamps = true.copy()
    stamps[[0, 30, 99]] = np.nan
    stamps[50] += 1e6
    stamps[60] -= 3600
    time, notes = repair_times(stamps, 1.0)
    np.testing.assert_allclose(time, true, rtol=0, atol=1e-6)
    assert notes == ["5 of 100 ping times were missing or astray and are interpolated"]


def test_a_clock_set_back_for_good_goes_on_at_the_usual_rate():
    true = T0 + 0.1 * np.arange(100)
    time, notes = repair_times(np.where(np.arange(100) < 50, true, true - 86400.0), 1.0)
    np.testing.assert_allclose(time, true, rtol=0, atol=1e-5)
    assert notes == ["the clock was set back (1x); the pings after it follow on at the usual rate"]


def test_without_any_stamp_the_nominal_interval_counts_from_zero():
    time, notes = repair_times(np.full(5, np.nan), 0.25)
    np.testing.assert_allclose(time, 0.25 * np.arange(5))
    assert len(notes) == 1


def test_stamps_all_alike_are_spread_at_the_nominal_interval():
    time, _ = repair_times(np.full(30, T0), 0.25)
    assert np.all(np.diff(time) > 0)
    assert time[0] == pytest.approx(T0, abs=5)


@settings(max_examples=200, deadline=None)
@given(
    npst.arrays(
        np.float64,
        st.integers(1, 60),
        elements=st.floats(0, 7e9) | st.just(np.nan) | st.integers(0, 30).map(lambda k: T0 + k / 4),
    )
)
def test_times_always_increase_and_the_stamps_are_not_touched(stamps):
    before = stamps.copy()
    time, _ = repair_times(stamps, 0.1)
    assert time.shape == stamps.shape
    assert np.isfinite(time).all()
    assert np.all(np.diff(time) > 0)
    np.testing.assert_array_equal(stamps, before)
