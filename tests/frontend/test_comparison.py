"""Places: what is compared for a submap, made once, and how sure an alignment is by the neighbours' floor."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.comparison import Places, is_of_neighbours, with_drift
from frontend.frames import planar_pose
from frontend.relief import ReliefConfig
from frontend.search import SearchConfig
from frontend.verification import verify
from tests.frontend.seafloor_scenes import PINGS_A_SUBMAP, cut_submap, rough_seafloor

HALF = PINGS_A_SUBMAP // 2
DRIFT = np.diag([1e-6, 1e-6, 4e-4, 0.5, 0.3, 0.01])  # [rad^2], [m^2] between neighbours


@pytest.fixture(scope="module")
def submaps():
    """Two lines that cross at a right angle, windows overlapping by half; the second line long after the first."""
    rng = np.random.default_rng(1)
    floor = rough_seafloor(rng)
    along = [cut_submap(floor, (70.0 + 40.0 * k, 130.0, 0.0), rng, k) for k in range(4)]
    across = [cut_submap(floor, (150.0, 70.0 + 40.0 * k, np.pi / 2), rng, 4 + k) for k in range(4)]
    starts = [HALF * k for k in range(4)] + [HALF * (12 + k) for k in range(4)]
    return [
        replace(s, first_ping=first, end_ping=first + 2 * HALF, anchor_ping=first + HALF)
        for s, first in zip([*along, *across], starts, strict=True)
    ]


@pytest.fixture
def places(submaps):
    return Places(submaps, ReliefConfig(), SearchConfig())


def test_a_place_is_made_once_for_all_its_partners(places):
    target, _ = places.sides(1, 5)
    again, _ = places.sides(1, 6)
    assert again is target


def test_both_sides_have_their_neighbours(places):
    target, source = places.sides(1, 5)
    assert target.members == range(3)
    assert source.members == range(4, 7)
    np.testing.assert_allclose(target.anchors, [[-40.0, 0.0], [0.0, 0.0], [40.0, 0.0]], atol=1e-9)


def test_sides_that_follow_one_another_share_no_ping(submaps, places):
    target, source = places.sides(0, 3)
    assert max(submaps[k].end_ping for k in target.members) <= min(submaps[k].first_ping for k in source.members)


def test_the_member_nearest_to_a_point_is_named(places):
    target, _ = places.sides(1, 5)
    assert target.member_at(np.array([3.0, 40.0])) == 1
    assert target.member_at(np.array([35.0, -20.0])) == 2


def aligned(places, target, source, T):
    sides = places.sides(target, source)
    return verify(sides[0].layers, sides[1].layers, T), sides


def test_where_the_neighbours_floor_decided_the_drift_to_it_is_added(places):
    # the second along and the second across meet 40 m ahead of both anchors
    T = planar_pose(40.0, -20.0, np.pi / 2)
    verification, sides = aligned(places, 1, 5, T)
    far = replace(verification, middle=np.array([40.0, 40.0]))
    surer, less_sure = (
        with_drift(v, sides, (1, 5), lambda _a, _b: DRIFT) for v in (replace(far, middle=np.array([0.0, 0.0])), far)
    )
    assert (surer.sigmas <= less_sure.sigmas).all()
    grown = less_sure.sigmas**2 - far.sigmas**2
    # of the source's side only: its middle is nearest to the third across, and 0 m from the target's own anchor
    np.testing.assert_allclose(grown, [0.0, 0.0, 4e-4, 0.4, 0.4, 0.0], atol=1e-12)


@pytest.mark.parametrize("yaw", [0.0, np.pi / 2, np.pi, 0.7])
def test_a_misalignment_shears_both_sides_by_the_distance_ahead_of_their_anchors(places, yaw):
    T, middle, m = planar_pose(4.0, -6.0, yaw), np.array([9.0, 5.0]), 0.02
    verification, sides = aligned(places, 1, 5, T)
    placed = replace(verification, T_target_source=T, middle=middle, sigmas=np.full(6, 0.1))
    sure, less_sure = (with_drift(placed, sides, (1, 5), lambda _a, _b: np.zeros((6, 6)), k) for k in (0.0, m))
    # both sides draw the same point aside, x ahead by m x to port: the shift that brings them together again
    there = (T @ [*middle, 0.0, 1.0])[:2]
    shear = np.array([[1.0, 0.0], [m, 1.0]])
    shift = shear @ there - T[:2, :2] @ shear @ middle - T[:2, 3]
    grown = less_sure.sigmas**2 - sure.sigmas**2
    np.testing.assert_allclose(grown, [0.0, 0.0, 0.0, *shift**2, 0.0], atol=1e-9)


def test_without_drift_between_neighbours_nothing_is_added(places):
    verification, sides = aligned(places, 1, 5, planar_pose(40.0, -20.0, np.pi / 2))
    same = with_drift(verification, sides, (1, 5), lambda _a, _b: np.zeros((6, 6)))
    np.testing.assert_allclose(same.sigmas, verification.sigmas)


def test_an_earlier_neighbour_is_asked_for_in_the_order_of_time(places):
    asked = []
    verification, sides = aligned(places, 2, 5, planar_pose(0.0, -20.0, np.pi / 2))
    behind = replace(verification, middle=np.array([-40.0, 0.0]))
    with_drift(behind, sides, (2, 5), lambda a, b: asked.append((a, b)) or DRIFT)
    assert asked
    assert all(a < b for a, b in asked)


def test_what_neighbours_of_both_have_seen_is_theirs_to_say(places):
    verification, sides = aligned(places, 1, 5, planar_pose(40.0, -20.0, np.pi / 2))
    own = replace(verification, middle=np.zeros(2))  # of the source; the target's next one is as near as itself
    theirs = replace(verification, middle=np.array([40.0, 0.0]))
    assert not is_of_neighbours(own, sides, (1, 5))
    assert is_of_neighbours(theirs, sides, (1, 5))


def test_only_the_last_places_asked_for_are_kept(places, monkeypatch):
    monkeypatch.setattr("frontend.comparison._MOST_PLACES", 2)
    first, second = places.sides(1, 5)
    assert places.sides(1, 5)[0] is first
    assert places.sides(1, 5)[1] is second
    places.sides(2, 6)
    again, _ = places.sides(1, 5)
    assert again is not first
    np.testing.assert_array_equal(again.layers.rasters, first.layers.rasters)
