from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from frontend.trajectory import Trajectory
from frontend.turns import straight_and_turning
from frontend.windows import (
    Window,
    WindowConfig,
    finished_windows,
    resolve_windows,
    sliding_windows,
    window_length,
)


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


def winding_track(parts):
    """A track of pieces of 25 m that turn by so much a metre each, a ping a metre."""
    curvature = np.repeat(parts, 25)
    yaw = np.cumsum(curvature)
    x, y, zero = np.cumsum(np.cos(yaw)), np.cumsum(np.sin(yaw)), np.zeros_like(yaw)
    return Trajectory(np.arange(len(yaw)) * 0.5, x, y, zero, zero, zero, yaw)


winding = st.lists(st.sampled_from([0.0, 0.0, 0.0, 0.01, 0.03, 0.06, -0.05]), min_size=1, max_size=24).map(
    winding_track
)


@settings(max_examples=60, deadline=None)
@given(winding, st.integers(3, 60), st.floats(0.0, 0.9))
def test_windows_of_lines_have_as_many_lines_and_leave_none_out(track, n_lines, overlap):
    config = WindowConfig(method="lines", n_lines=n_lines, overlap=overlap, n_edge_pings=0)
    windows = sliding_windows(track, 50.0, config)
    assert {w.n_pings for w in windows[:-1]} <= {n_lines}
    assert len(track) < n_lines or n_lines <= windows[-1].n_pings < 2 * n_lines
    assert np.unique(np.concatenate([np.arange(w.first_ping, w.end_ping) for w in windows])).size == len(track)
    steps = {b.first_ping - a.first_ping for a, b in pairwise(windows[:-1])}
    assert steps <= {max(1, round(n_lines * (1 - overlap)))}


def test_lines_that_nobody_counted_run_the_length_of_a_window():
    config = resolve_windows(WindowConfig(method="lines"), 50.0, 0.5)
    assert (config.length, config.n_lines, config.min_radius) == (75.0, 150, 50.0)
    assert resolve_windows(WindowConfig(), 50.0, float("nan")).n_lines == 75
    assert resolve_windows(WindowConfig(length=0.1), 50.0, 1.0).n_lines == 3


def test_a_halt_fills_windows_of_lines_but_not_those_of_distance():
    halting = straight_track(np.concatenate([np.arange(100.0), np.full(500, 99.0), np.arange(100.0, 200.0)]))
    lines = sliding_windows(halting, 50.0, WindowConfig(method="lines", n_lines=100, overlap=0.0, n_edge_pings=0))
    assert len(lines) == 7
    assert len(sliding_windows(halting, 50.0, WindowConfig(length=99.0, overlap=0.0, n_edge_pings=0))) == 2


@settings(max_examples=60, deadline=None)
@given(winding, st.floats(5.0, 100.0), st.floats(0.0, 0.9))
def test_adaptive_windows_cover_every_ping_and_none_reaches_across_a_cut(track, length, overlap):
    config = WindowConfig(method="adaptive", length=length, overlap=overlap, n_edge_pings=0, min_radius=50.0)
    windows = sliding_windows(track, 50.0, config)
    assert np.unique(np.concatenate([np.arange(w.first_ping, w.end_ping) for w in windows])).size == len(track)
    assert [w.number for w in windows] == list(range(len(windows)))
    assert all(w.first_ping <= w.anchor_ping < w.end_ping for w in windows)
    pieces = straight_and_turning(track, config.min_turn, 50.0)
    assert all(any(a <= w.first_ping and w.end_ping <= b for a, b in pieces) for w in windows)


def test_adaptive_windows_of_a_straight_track_are_those_of_distance():
    track = straight_track(np.arange(300.0))
    ways = [WindowConfig(method=method) for method in ("adaptive", "distance")]
    assert sliding_windows(track, 50.0, ways[0]) == sliding_windows(track, 50.0, ways[1])


@settings(max_examples=80, deadline=None)
@given(winding, st.integers(1, 600), st.sampled_from(["distance", "lines", "adaptive"]), st.floats(0.0, 0.8))
def test_finished_windows_of_no_method_change_when_more_pings_come(track, n_first, method, overlap):
    config = WindowConfig(method=method, length=40.0, n_lines=30, overlap=overlap, min_radius=50.0)
    early = finished_windows(track[slice(0, n_first)], 1.0, config)
    late = sliding_windows(track, 1.0, config)
    assert late[: len(early)] == early


def test_a_window_that_a_turn_may_yet_cut_is_not_finished():
    # at every ping of a leg and a turn; windows a fifth of their length apart, so that several end near the cut
    track = winding_track([0.0] * 6 + [0.06] * 4)
    config = WindowConfig(method="adaptive", length=40.0, overlap=0.8, min_radius=50.0)
    late = sliding_windows(track, 1.0, config)
    for n_first in range(1, len(track)):
        early = finished_windows(track[slice(0, n_first)], 1.0, config)
        assert late[: len(early)] == early
