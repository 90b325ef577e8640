"""Moments: every way of writing a time gives the same seconds."""

from datetime import UTC, date, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sssslam.navigation.moments import midnight, moment, nearest_day, second_of_day, unroll_days

NOON = datetime(2016, 5, 1, 12, 0, 0, 500_000, tzinfo=UTC)


@pytest.mark.parametrize(
    "text",
    [
        "1462104000.5",
        "1462104000500",
        "1462104000500000",
        "1462104000500000000",
        "2016-05-01T12:00:00.5Z",
        "2016-05-01 12:00:00.500",
        "2016/05/01 12:00:00.5 UTC",
        "2016-05-01T14:00:00.5+02:00",
    ],
)
def test_a_moment_is_the_same_however_it_is_written(text):
    assert moment(text) == pytest.approx(NOON.timestamp(), abs=1e-6)


@pytest.mark.parametrize("text", ["", "noon", "12:00", "2016-13-01"])
def test_what_is_no_moment_is_refused(text):
    with pytest.raises(ValueError, match=r"Invalid isoformat|must be in"):
        moment(text)


def test_a_time_of_day_is_read_with_and_without_colons():
    assert second_of_day("01:02:03.5") == second_of_day("010203.5") == 3723.5
    with pytest.raises(ValueError, match="a time of day is wanted"):
        second_of_day("250000")


def test_midnight_is_that_of_utc():
    assert midnight(date(1970, 1, 3)) == 2 * 86400.0


def test_times_of_day_go_on_after_midnight():
    seconds = np.array([86398.0, np.nan, 86399.5, 1.0, 2.0])
    np.testing.assert_allclose(unroll_days(seconds)[[0, 2, 3, 4]], [86398.0, 86399.5, 86401.0, 86402.0])


@given(day=st.integers(0, 40_000), second=st.floats(0, 86399), late=st.floats(-43000, 43000))
def test_the_nearest_day_is_the_one_that_was_meant(day, second, late):
    assert nearest_day(second, day * 86400.0 + second + late) == day * 86400.0
