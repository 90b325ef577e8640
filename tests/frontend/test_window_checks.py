"""Windows that cannot be reconstructed are told apart, each with its reason, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.bottom import Bottom
from frontend.recording import Recording
from frontend.trajectory import Trajectory
from frontend.window_checks import Unusable, in_range_of_bottom, usable_windows, why_unusable
from frontend.windows import Window, WindowConfig, sliding_windows

N, RANGE, ALTITUDE = 200, 50.0, 10.0
CONFIG = WindowConfig(length=60.0, n_edge_pings=0)


def recording(x, y=None, yaw=None, altitude=ALTITUDE):
    """Silent pings at some positions."""
    n = len(x)
    zero, echo = np.zeros(n), np.ones((n, 1), dtype=np.float32)
    y, yaw = (zero if values is None else values for values in (y, yaw))
    track = Trajectory(np.arange(float(n)), np.asarray(x, dtype=np.float64), y, zero - 20.0, zero, zero, yaw)
    known = np.full(n, altitude, dtype=np.float64)
    return Recording(echo, echo, zero + RANGE, zero + 1500.0, track, known, known, known)


def bottom(n=N, *, is_found=True, altitude=ALTITUDE):
    found = np.broadcast_to(np.asarray(is_found)[..., None], (n, 2))
    return Bottom(np.full((n, 2), altitude), np.full(n, altitude), 1.0, found)


def circle(radius, turn):
    """A turn to port at ten degrees and 200 pings."""
    angle = np.linspace(0.0, turn, N)
    return recording(radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle)


WHOLE = Window(0, 0, N, N // 2)


def test_a_straight_leg_over_a_bottom_can_be_reconstructed():
    assert why_unusable(recording(np.arange(float(N))), WHOLE, bottom(), CONFIG) is None


@pytest.mark.parametrize(("radius", "reason"), [(0.0, Unusable.PURE_TURN), (2.4, Unusable.PURE_TURN), (2.6, None)])
def test_a_turn_is_pure_below_a_radius_of_a_quarter_of_the_altitude(radius, reason):
    if radius == 0.0:  # it spins while it drifts, or nothing would move
        spun = recording(np.linspace(0.0, 5.0, N), yaw=np.linspace(0.0, 2 * np.pi, N))
        assert why_unusable(spun, WHOLE, bottom(), CONFIG) is reason
    else:
        assert why_unusable(circle(radius, np.pi), WHOLE, bottom(), CONFIG) is reason


def test_waves_are_no_turn_however_short_the_window():
    sway = 0.15 * np.sin(np.arange(N))
    assert why_unusable(recording(np.linspace(0.0, 2.0, N), yaw=sway), WHOLE, bottom(), CONFIG) is None


@pytest.mark.parametrize(("n_lost", "reason"), [(N // 2, None), (N // 2 + 1, Unusable.BOTTOM_LOST)])
def test_the_bottom_must_be_known_in_half_of_the_pings(n_lost, reason):
    lost = replace(recording(np.arange(float(N))), altitude=np.full(N, np.nan))
    found = np.arange(N) >= n_lost
    assert why_unusable(lost, WHOLE, bottom(is_found=found), CONFIG) is reason
    assert why_unusable(lost, WHOLE, bottom(is_found=found), CONFIG.model_copy(update={"min_bottom": 0.0})) is None


def test_an_altimeter_is_as_good_as_an_echo():
    seen = recording(np.arange(float(N)))
    assert why_unusable(seen, WHOLE, bottom(is_found=False), CONFIG) is None


def test_a_bottom_out_of_range_is_lost():
    high = recording(np.arange(float(N)), altitude=60.0)
    assert not in_range_of_bottom(high, bottom(altitude=60.0)).any()
    assert why_unusable(high, WHOLE, bottom(altitude=60.0), CONFIG) is Unusable.BOTTOM_LOST


@pytest.mark.parametrize(("jump", "reason"), [(197.0, None), (200.0, Unusable.NO_NAVIGATION)])
def test_a_step_that_is_most_of_the_way_hides_the_track(jump, reason):
    steps = np.ones(N - 1)
    steps[50] = jump
    x = np.concatenate([[0.0], np.cumsum(steps)])
    assert why_unusable(recording(x), WHOLE, bottom(), CONFIG) is reason


def test_a_frozen_position_is_no_navigation():
    assert why_unusable(recording(np.zeros(N)), WHOLE, bottom(), CONFIG) is Unusable.NO_NAVIGATION


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_a_handful_of_pings_is_given_a_chance(n):
    few = recording(np.arange(float(n)) ** 2)
    assert why_unusable(few, Window(0, 0, n, n // 2), bottom(n), CONFIG) is None


@given(st.lists(st.booleans(), min_size=8, max_size=8))
def test_what_is_left_is_numbered_anew_and_every_window_left_out_is_counted(lost):
    # eight windows side by side, of some the bottom is lost
    windows = [Window(k, 25 * k, 25 * k + 25, 25 * k + 12) for k in range(8)]
    blind = replace(recording(np.arange(float(N))), altitude=np.full(N, np.nan))
    usable, skipped = usable_windows(blind, windows, bottom(is_found=~np.repeat(lost, 25)), CONFIG)
    assert [w.number for w in usable] == list(range(len(usable)))
    assert [w.first_ping for w in usable] == [25 * k for k in range(8) if not lost[k]]
    assert skipped == ({"bottom lost over most of it": sum(lost)} if any(lost) else {})


def test_windows_of_a_dive_that_is_well_are_all_kept():
    dive = recording(np.arange(float(N)))
    windows = sliding_windows(dive.trajectory_dr, RANGE, CONFIG)
    assert usable_windows(dive, windows, bottom(), CONFIG) == (windows, {})
