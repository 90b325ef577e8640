"""Patches of the seafloor, and the passes that look at each."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from frontend.patches import patches
from frontend.trajectory import Trajectory
from frontend.windows import Window

REACH = 40.0  # slant range [m]: patches of 60 m


def track_through(corners: list[tuple[float, float]], step: float = 1.0) -> Trajectory:
    """Pings a metre apart from corner to corner, heading where the track goes."""
    ends = [(np.array(start), np.array(end)) for start, end in pairwise(corners)]
    legs = [a + (b - a) * np.arange(0.0, 1.0, step / np.hypot(*(b - a)))[:, None] for a, b in ends]
    yaw = np.concatenate(
        [np.full(len(leg), np.arctan2(*(b - a)[::-1])) for leg, (a, b) in zip(legs, ends, strict=True)]
    )
    x, y = np.concatenate(legs).T
    zero = np.zeros_like(x)
    return Trajectory(np.arange(len(x)) * 0.5, x, y, zero - 30.0, zero, zero, yaw)


def whole(track: Trajectory) -> list[Window]:
    return [Window(0, 0, len(track), len(track) // 2)]


def test_two_passes_over_a_place_are_in_one_patch_and_the_turn_between_them_is_not() -> None:
    track = track_through([(0.0, 10.0), (300.0, 10.0), (300.0, 40.0), (0.0, 40.0)])
    found = patches(track, whole(track), REACH, 4000)
    middle = next(p for p in found if abs(track.x[p[0].anchor_ping] - 90.0) < 20.0)
    assert len(middle) == 2
    headings = {round(float(np.cos(track.yaw[window.anchor_ping]))) for window in middle}
    assert headings == {1, -1}
    assert all(np.ptp(track.y[window.first_ping : window.end_ping]) == 0.0 for window in middle)


@given(
    st.lists(st.tuples(st.floats(-300, 300), st.floats(-300, 300)), min_size=2, max_size=5, unique_by=lambda p: p[0])
)
def test_every_usable_ping_is_in_a_patch_near_it(corners: list[tuple[float, float]]) -> None:
    track = track_through([(0.0, 0.0), *((x + 1e3 * (k + 1), y) for k, (x, y) in enumerate(corners))], step=5.0)
    count = np.zeros(len(track), dtype=np.int64)
    for passes in patches(track, whole(track), REACH, 4000):
        seen = [ping for window in passes for ping in range(window.first_ping, window.end_ping)]
        assert len(seen) == len(set(seen))
        count[seen] += 1
        place = track.positions[seen, :2]
        assert np.ptp(place, axis=0).max() <= 4 * 1.5 * REACH  # twice the circle about a square, along and across
    inner = np.ones(len(track), dtype=np.bool_)
    inner[[0, 1, -2, -1]] = False  # a run of fewer than three pings is no pass
    turns = np.abs(np.diff(track.yaw, prepend=track.yaw[0])) > 0
    for ping in np.flatnonzero(turns):
        inner[max(ping - 3, 0) : ping + 3] = False
    assert (count[inner] > 0).all()


def test_pings_of_no_window_are_left_out() -> None:
    track = track_through([(0.0, 10.0), (300.0, 10.0)])
    windows = [Window(0, 0, 100, 50), Window(1, 200, 300, 250)]
    seen = {
        k for passes in patches(track, windows, REACH, 4000) for w in passes for k in range(w.first_ping, w.end_ping)
    }
    assert seen == {*range(100), *range(200, 300)}


def test_a_patch_has_no_more_pings_than_it_may_and_keeps_its_longest_passes() -> None:
    back_and_forth = [(-40.0, float(y)) if y % 2 else (40.0, float(y)) for y in range(20)]
    track = track_through(back_and_forth)
    found = patches(track, whole(track), REACH, 300)
    assert found
    for passes in found:
        lengths = [window.n_pings for window in passes]
        assert sum(lengths) <= 300
        assert lengths == sorted(lengths, reverse=True)


def test_a_vehicle_that_stands_still_gives_one_patch_of_as_many_pings_as_it_may_have() -> None:
    n, zero = 5000, np.zeros(5000)
    track = Trajectory(np.arange(n) * 0.5, zero + 3.0, zero + 3.0, zero - 30.0, zero, zero, zero)
    ((only,),) = patches(track, whole(track), REACH, 300)
    assert only.n_pings == 300
