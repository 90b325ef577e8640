"""Windows that the whole track decides: short where a short track turns back, else left to the range."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.trajectory import Trajectory
from frontend.window_defaults import suit_track
from frontend.windows import WindowConfig, resolve_windows, sliding_windows

RANGE = 30.0


def arc(distance, turn, n=801):
    """A track of even curvature that runs a distance [m] and turns by an angle [rad]."""
    yaw, zero = np.linspace(0.0, turn, n), np.zeros(n)
    middle, step = 0.5 * (yaw[1:] + yaw[:-1]), distance / (n - 1)
    x, y = (np.concatenate([[0.0], np.cumsum(step * f(middle))]) for f in (np.cos, np.sin))
    return Trajectory(np.arange(n) * 0.2, x, y, zero, zero, zero, yaw)


def test_a_short_track_that_turns_back_gets_windows_of_a_ninth_that_overlap_more():
    suited = suit_track(WindowConfig(), RANGE, arc(180.0, 3.5 * np.pi))
    assert suited.length == pytest.approx(20.0)
    assert suited.overlap == 0.8


def test_windows_are_no_shorter_than_half_a_slant_range():
    assert suit_track(WindowConfig(), RANGE, arc(60.0, 3.5 * np.pi)).length == 15.0


@pytest.mark.parametrize("turn", [0.0, np.pi, -1.6 * np.pi])
def test_a_track_that_does_not_go_round_keeps_the_windows_of_the_range(turn):
    assert suit_track(WindowConfig(), RANGE, arc(160.0, turn)) == WindowConfig()


def test_a_long_track_keeps_the_windows_of_the_range_however_it_turns():
    assert suit_track(WindowConfig(), RANGE, arc(410.0, 6 * np.pi)) == WindowConfig()


def test_what_is_set_is_kept():
    track = arc(160.0, 3.5 * np.pi)
    assert suit_track(WindowConfig(length=40.0), RANGE, track) == WindowConfig(length=40.0)
    suited = suit_track(WindowConfig(overlap=0.3, min_radius=7.0), RANGE, track)
    assert (suited.overlap, suited.min_radius) == (0.3, 7.0)


def test_turns_are_still_told_by_the_slant_range():
    suited = suit_track(WindowConfig(), RANGE, arc(160.0, 3.5 * np.pi))
    assert resolve_windows(suited, RANGE, 0.2).min_radius == RANGE


def test_a_vehicle_that_turns_on_the_spot_keeps_the_windows_of_the_range():
    assert suit_track(WindowConfig(), RANGE, arc(0.0, 6 * np.pi)) == WindowConfig()


def test_an_overlap_that_nobody_set_is_a_half():
    assert resolve_windows(WindowConfig(), RANGE, 0.2).overlap == 0.5
    assert resolve_windows(WindowConfig(overlap=0.0), RANGE, 0.2).overlap == 0.0


@given(st.floats(20.0, 400.0), st.floats(2.1 * np.pi, 8 * np.pi))
def test_windows_that_share_pings_reach_as_far_as_in_a_long_dive_or_over_the_track(distance, turn):
    track = arc(distance, turn)
    windows = sliding_windows(track, RANGE, suit_track(WindowConfig(), RANGE, track))
    own = windows[len(windows) // 2]
    shared = [w for w in windows if w.first_ping < own.end_ping and w.end_ping > own.first_ping]
    way = track.distance[shared[-1].end_ping - 1] - track.distance[shared[0].first_ping]
    # 2.6 lengths; edge pings take 1 % of each, the end of the track cuts some off or lengthens the last.
    length = max(distance / 9, RANGE / 2)
    assert min(2.5 * length, 0.5 * distance) <= way <= 2.6 * length + length / 8
