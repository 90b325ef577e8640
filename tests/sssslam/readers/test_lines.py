"""Lines out of a file, structures by their offsets, and series brought together: each against its definition."""

import mmap
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sssslam.readers.layout import as_float64, gather, layout
from sssslam.readers.lines import fill_width, gather_lines, nearest_in_time, plausible_lengths
from sssslam.readers.whole_metres import smooth_whole_metres
from sssslam.readers.xtf_packets import map_file


@pytest.fixture
def mapped(tmp_path: Path) -> mmap.mmap:
    """A file of the bytes 0 to 255."""
    (tmp_path / "bytes").write_bytes(bytes(range(256)))
    return map_file(tmp_path / "bytes")


def test_lines_are_the_numbers_at_their_offsets(mapped):
    lines = gather_lines(mapped, np.array([1, 100, 7]), np.array([2, 0, 3]), "<u2")
    expected = [[0x0201, 0x0403, np.nan], [np.nan] * 3, [0x0807, 0x0A09, 0x0C0B]]
    np.testing.assert_array_equal(lines, np.array(expected, dtype=np.float32))


def test_structures_are_read_by_their_offsets(mapped):
    dtype = layout(8, {"a": (1, "u1"), "b": (4, ">u2")})
    found = gather(mapped, np.array([0, 16]), dtype)
    assert found["a"].tolist() == [1, 17]
    assert found["b"].tolist() == [0x0405, 0x1415]
    assert len(gather(mapped, np.zeros(0, dtype=np.int64), layout(1000, {"a": (0, "u1")}))) == 0


def test_a_signalling_nan_makes_no_warning():
    odd = np.array([0x7F800001, 0x3F800000], dtype=np.uint32).view(np.float32)
    assert np.array_equal(as_float64(odd), [np.nan, 1.0], equal_nan=True)


@given(st.lists(st.integers(0, 10**6), max_size=40))
def test_plausible_pings_side_by_side_take_a_small_multiple_of_what_they_hold(lengths):
    n = np.array(lengths, dtype=np.int64)
    kept = n[plausible_lengths(n)]
    assert (kept > 0).all()
    assert len(kept) * kept.max(initial=0) <= 8 * n.sum()


def test_the_narrower_side_is_filled_with_nan():
    port, starboard = fill_width(np.ones((2, 1), np.float32), np.zeros((2, 3), np.float32))
    np.testing.assert_array_equal(port, np.array([[1, np.nan, np.nan]] * 2, dtype=np.float32))
    assert starboard.shape == (2, 3)


times = st.lists(st.floats(-1e3, 1e3), max_size=30).map(np.array)


@given(times, times, st.floats(0, 100))
def test_pairs_in_time_are_close_nearest_and_used_once(time, other, tolerance):
    rows, other_rows = nearest_in_time(time.astype(np.float64), other.astype(np.float64), tolerance)
    assert len(rows) == len(other_rows)
    assert len(np.unique(rows)) == len(rows)
    assert len(np.unique(other_rows)) == len(other_rows)
    for row, other_row in zip(rows, other_rows, strict=True):
        distance = np.abs(other - time[row])
        assert distance[other_row] <= tolerance
        # A tie in the middle goes either way.
        assert distance[other_row] <= distance.min() + 1e-9


def test_the_same_times_pair_row_by_row():
    rows, other_rows = nearest_in_time(np.arange(5.0), np.arange(5.0), 0.1)
    assert rows.tolist() == other_rows.tolist() == [0, 1, 2, 3, 4]


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-0.4, 0.4))
def test_a_straight_track_comes_back_from_whole_metres(east_speed, north_speed, start):
    k = np.arange(400) / 20
    track = np.stack([1000 + start + east_speed * k, -500 + start + north_speed * k])
    smooth = np.stack(smooth_whole_metres(*np.round(track).astype(np.int64)))
    # Between its steps each axis is known to a ping, since there it crossed a half; outside them to half a metre.
    error = np.abs(smooth - track)
    assert error.max() <= 0.5 + 3 / 20
    crossings = [np.flatnonzero(np.diff(np.round(axis)) != 0) for axis in track]
    for axis, before in zip(error, crossings, strict=True):
        if before.size > 1:
            assert axis[before[0] + 1 : before[-1] + 1].max() <= 3 / 20 + 1e-9


def test_positions_of_a_unit_without_gnss_are_unknown():
    east, north = smooth_whole_metres(np.array([0, 5, 5, 0]), np.array([0, 7, 7, 0]))
    np.testing.assert_array_equal(east, [np.nan, 5, 5, np.nan])
    np.testing.assert_array_equal(north, [np.nan, 7, 7, np.nan])
