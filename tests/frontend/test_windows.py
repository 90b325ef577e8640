from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from frontend.trajectory import Trajectory
from frontend.windows import Window, WindowConfig, sliding_windows, window_length


def straight_track(x):
    x = np.asarray(x, dtype=np.float64)
    zero = np.zeros_like(x)
    return Trajectory(np.arange(len(x)) * 0.2, x, zero, zero, zero, zero, zero)


def test_windows_of_a_straight_track_are_equally_long_and_half_overlap():
    windows = sliding_windows(straight_track(np.arange(201.0)), 0.0, WindowConfig(length=80.0, n_edge_pings=0))
    assert windows == [Window(0, 0, 81, 40), Window(1, 40, 121, 80), Window(2, 80, 161, 120), Window(3, 120, 201, 160)]


def test_the_first_and_last_ping_of_a_window_are_left_out():
    inner = sliding_windows(straight_track(np.arange(201.0)), 0.0, WindowConfig(length=80.0, n_edge_pings=1))
    assert [(w.first_ping, w.end_ping) for w in inner] == [(1, 80), (41, 120), (81, 160), (121, 200)]


def test_the_length_comes_from_the_slant_range_unless_configured():
    assert window_length(50.0, WindowConfig()) == 75.0
    assert window_length(float("nan"), WindowConfig(length=30.0)) == 30.0


def test_a_track_shorter_than_a_window_gives_one_window():
    assert sliding_windows(straight_track(np.arange(20.0)), 50.0) == [Window(0, 1, 19, 10)]


def test_one_ping_gives_one_window_with_that_ping():
    assert sliding_windows(straight_track([7.0]), 50.0) == [Window(0, 0, 1, 0)]


def test_two_pings_are_not_dropped_as_edges():
    assert sliding_windows(straight_track([0.0, 1.0]), 50.0) == [Window(0, 0, 2, 1)]


def test_a_vehicle_that_never_moves_gives_one_window_of_all_pings():
    (window,) = sliding_windows(straight_track(np.zeros(500)), 50.0, WindowConfig(n_edge_pings=0))
    assert (window.first_ping, window.end_ping) == (0, 500)


def test_pings_of_a_halt_belong_to_the_windows_of_the_place_and_add_none():
    moving = np.arange(201.0)
    halting = np.concatenate([moving[:100], np.full(1000, 100.0), moving[100:]])
    config = WindowConfig(length=80.0, n_edge_pings=0)
    windows = sliding_windows(straight_track(halting), 0.0, config)
    assert len(windows) == len(sliding_windows(straight_track(moving), 0.0, config))
    assert windows[1].end_ping == 1121
    assert windows[1].first_ping == 40


def test_a_long_rest_of_the_track_is_a_window_of_full_length():
    windows = sliding_windows(straight_track(np.arange(231.0)), 0.0, WindowConfig(length=80.0, n_edge_pings=0))
    assert (windows[-1].first_ping, windows[-1].end_ping) == (150, 231)


def test_a_short_rest_of_the_track_lengthens_the_last_window():
    windows = sliding_windows(straight_track(np.arange(211.0)), 0.0, WindowConfig(length=80.0, n_edge_pings=0))
    assert (windows[-1].first_ping, windows[-1].end_ping) == (120, 211)


def test_a_window_knows_its_pings():
    window = Window(3, 10, 25, 17)
    assert window.n_pings == 15
    assert np.array_equal(np.arange(100)[window.pings], np.arange(10, 25))


def test_an_empty_track_is_refused():
    with pytest.raises(ValueError, match="windows need at least one ping, got an empty track"):
        sliding_windows(straight_track([]), 50.0)


@pytest.mark.parametrize("slant_range", [0.0, -3.0, float("nan"), float("inf")])
def test_no_length_and_no_slant_range_is_refused(slant_range):
    with pytest.raises(ValueError, match="slant range must be positive to derive a window length"):
        sliding_windows(straight_track([0.0, 1.0]), slant_range)


def test_a_misspelt_key_is_refused():
    with pytest.raises(ValidationError, match="lenght"):
        WindowConfig(lenght=3.0)


steps = st.lists(st.one_of(st.just(0.0), st.floats(0.01, 30.0)), min_size=1, max_size=300)


@settings(max_examples=60, deadline=None)
@given(steps, st.floats(5.0, 100.0), st.floats(0.0, 0.9))
def test_windows_cover_every_ping_in_order_and_hold_their_anchor(steps, length, overlap):
    track = straight_track(np.cumsum(steps))
    windows = sliding_windows(track, 1.0, WindowConfig(length=length, overlap=overlap, n_edge_pings=0))
    assert [window.number for window in windows] == list(range(len(windows)))
    assert all(w.first_ping <= w.anchor_ping < w.end_ping for w in windows)
    assert all(a.first_ping <= b.first_ping and a.end_ping <= b.end_ping for a, b in pairwise(windows))
    covered = np.zeros(len(track), dtype=bool)
    for window in windows:
        covered[window.pings] = True
    assert covered.all()


@settings(max_examples=30, deadline=None)
@given(steps, st.integers(1, 200))
def test_finished_windows_do_not_change_when_more_pings_come(steps, n_first):
    config = WindowConfig(length=40.0)
    track = straight_track(np.cumsum(steps))
    early = sliding_windows(track[slice(0, n_first)], 1.0, config)[:-1]
    late = sliding_windows(track, 1.0, config)
    assert late[: len(early)] == early
