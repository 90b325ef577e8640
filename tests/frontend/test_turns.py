"""Turns are found where the lines of neighbouring pings cross inside the swath."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frontend.trajectory import Trajectory
from frontend.turns import heading_spread, is_turning, straight_and_turning, turn_reach


def driven(curvature, spacing=1.0):
    """A track that turns by so much a metre at each ping."""
    yaw = np.concatenate([[0.0], np.cumsum(np.asarray(curvature[1:]) * spacing)])
    x, y = (np.concatenate([[0.0], np.cumsum(spacing * part(yaw[:-1]))]) for part in (np.cos, np.sin))
    zero = np.zeros_like(yaw)
    return Trajectory(np.arange(len(yaw)) * 0.5, x, y, zero, zero, zero, yaw)


def leg_turn_leg(radius):
    """100 m straight, a half circle, 100 m back; where the turn begins and ends."""
    n = round(np.pi * radius)
    return driven(np.concatenate([np.zeros(101), np.full(n, 1.0 / radius), np.zeros(100)])), (100, 100 + n)


@pytest.mark.parametrize("radius", [10.0, 25.0, 40.0])
def test_a_leg_a_turn_and_a_leg_are_three_pieces(radius):
    track, (begin, end) = leg_turn_leg(radius)
    pieces = straight_and_turning(track, 0.35, 50.0)
    assert len(pieces) == 3
    # where half the baseline has seen the whole angle: within a baseline of 17.5 m of the true ends
    assert abs(pieces[1][0] - begin) <= 2 * turn_reach(0.35, 50.0)
    assert abs(pieces[1][1] - end) <= 2 * turn_reach(0.35, 50.0)


def test_a_turn_wider_than_the_swath_cuts_nothing():
    assert straight_and_turning(leg_turn_leg(60.0)[0], 0.35, 50.0) == [(0, 389)]


def test_lines_cross_inside_the_swath_where_a_turn_is_found_and_nowhere_else():
    for radius, crosses in ((30.0, True), (80.0, False)):
        track = driven(np.full(100, 1.0 / radius))
        ends = track.positions[:, :2] + 50.0 * np.stack([-np.sin(track.yaw), np.cos(track.yaw)], axis=-1)
        ahead = (np.diff(ends, axis=0) * np.stack([np.cos(track.yaw), np.sin(track.yaw)], axis=-1)[:-1]).sum(axis=1)
        assert (ahead < 0).all() == crosses  # the far end of a line goes back as the vehicle goes ahead
        assert is_turning(track, 0.35, 50.0)[20:-20].all() == crosses
        assert is_turning(track, 0.35, 50.0).any() == crosses


def test_a_spin_in_place_is_a_turn():
    track = driven(np.zeros(60))
    spin = np.concatenate([np.zeros(30), np.linspace(0.0, 2 * np.pi, 30)])
    still = np.minimum(np.arange(60.0), 29.0)
    spun = Trajectory(track.time, still, 0 * still, 0 * still, 0 * still, 0 * still, np.mod(spin, 2 * np.pi))
    assert is_turning(spun, 0.35, 50.0)[30:].all()
    assert heading_spread(spun) == pytest.approx(2 * np.pi)


def test_heading_that_passes_north_is_no_jump():
    yaw = np.mod(np.linspace(-0.05, 0.05, 50), 2 * np.pi)
    x, zero = np.arange(50.0), np.zeros(50)
    assert not is_turning(Trajectory(x, x, zero, zero, zero, zero, yaw), 0.35, 50.0).any()


curvatures = st.lists(st.sampled_from([0.0, 0.0, 0.0, 0.01, 0.03, 0.06, -0.05]), min_size=1, max_size=12)


@settings(max_examples=50, deadline=None)
@given(curvatures)
def test_pieces_are_the_whole_track_in_order_and_the_kind_changes_at_every_cut(parts):
    track = driven(np.repeat(parts, 25))
    pieces, turning = straight_and_turning(track, 0.35, 50.0), is_turning(track, 0.35, 50.0)
    assert (pieces[0][0], pieces[-1][1]) == (0, len(track))
    assert all(a[1] == b[0] for a, b in pairwise(pieces))
    assert all(len(set(turning[first:end])) == 1 for first, end in pieces)
    assert all(turning[a[0]] != turning[b[0]] for a, b in pairwise(pieces))


@settings(max_examples=50, deadline=None)
@given(curvatures, st.floats(0.1, 1.0), st.floats(5.0, 100.0))
def test_a_turn_is_what_its_definition_says(parts, min_turn, min_radius):
    track, reach = driven(np.repeat(parts, 10)), turn_reach(min_turn, min_radius)
    s, heading = track.distance, np.unwrap(track.yaw)
    near = np.abs(s[:, None] - s[None]) <= reach
    # what lies at the very edge of the reach is a matter of rounding
    if np.any(np.abs(np.abs(s[:, None] - s[None]) - reach) < 1e-9):
        return
    spread = np.array([np.ptp(heading[row]) for row in near])
    if np.any(np.abs(spread - min_turn) < 1e-9):
        return
    np.testing.assert_array_equal(is_turning(track, min_turn, min_radius), spread > min_turn)
