"""What neighbours add to a submap: where it lies, how it is weighted, and that no ping serves both sides of a pair."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.frames import planar_pose
from frontend.overlap import stack_layers
from frontend.relief import Relief, extract_relief
from frontend.surroundings import lay_beside, meeting_ping, neighbours
from frontend.verification import verify
from tests.frontend.seafloor_scenes import PINGS_A_SUBMAP, cut_submap, rough_seafloor


def at(planar, number):
    """A submap whose pose is all that matters."""
    rng = np.random.default_rng(number)
    return cut_submap(rough_seafloor(rng), planar, rng, number)


def wavy(origin, n=(31, 41), spacing=1.0, lift=0.0):
    """A relief whose every raster is a plane in its frame's coordinates."""
    x, y = np.meshgrid(origin[0] + spacing * np.arange(n[1]), origin[1] + spacing * np.arange(n[0]))
    plane = 0.1 * x - 0.2 * y
    return Relief(plane, np.full(x.shape, 0.5), 2 * plane, plane + lift, np.full(x.shape, 0.3), spacing, origin)


@pytest.fixture(scope="module")
def track():
    """Nine submaps along a line, each sharing half its pings with the next."""
    rng = np.random.default_rng(0)
    floor = rough_seafloor(rng)
    half = PINGS_A_SUBMAP // 2
    submaps = [cut_submap(floor, (60.0 + 20.0 * k, 150.0, 0.0), rng, k) for k in range(9)]
    return [replace(s, first_ping=half * k, end_ping=half * (k + 2)) for k, s in enumerate(submaps)]


def test_windows_that_overlap_by_half_have_one_neighbour_on_each_side(track):
    everything = (0, track[-1].end_ping)
    assert neighbours(track, 2, everything) == range(1, 4)
    assert neighbours(track, 0, everything) == range(2)
    assert neighbours(track, 8, everything) == range(7, 9)


def test_windows_that_overlap_by_more_have_more(track):
    denser = [replace(s, first_ping=50 * k, end_ping=50 * k + PINGS_A_SUBMAP) for k, s in enumerate(track)]
    assert neighbours(denser, 4, (0, 10_000)) == range(1, 8)


def test_a_submap_that_shares_no_ping_stands_alone(track):
    apart = track[::2]
    assert neighbours(apart, 1, (0, 10_000)) == range(1, 2)


@given(st.integers(0, 8), st.integers(0, 8), st.integers(10, 300))
def test_two_sides_share_no_ping(track, a, b, step):
    track = [replace(s, first_ping=step * k, end_ping=step * k + PINGS_A_SUBMAP) for k, s in enumerate(track)]
    target, source = min(a, b), max(a, b)
    if track[target].end_ping > track[source].first_ping:
        return
    middle = meeting_ping(track[target], track[source])
    assert track[target].end_ping <= middle <= track[source].first_ping
    near, far = neighbours(track, target, (0, middle)), neighbours(track, source, (middle, 10_000))
    assert target in near
    assert source in far
    assert max(track[k].end_ping for k in near) <= min(track[k].first_ping for k in far)


def test_a_submap_that_stands_alone_keeps_its_relief(track):
    submaps = track
    reliefs = dict.fromkeys(range(5), wavy((0.0, 0.0)))
    assert lay_beside(submaps, reliefs, 2, range(2, 3)) is reliefs[2]


def test_a_neighbours_raster_lies_where_dead_reckoning_says():
    """Two frames, one turned by 90 degrees and 30 m on: a plane in the world is the same plane in both."""
    submaps = [at((100.0, 100.0, 0.0), 0), at((130.0, 100.0, np.pi / 2), 1)]
    own = wavy((-20.0, -15.0))
    x, y = np.meshgrid(-15.0 + np.arange(31), -20.0 + np.arange(41))
    world_x, world_y = 30.0 - y, x  # of the second frame's cells, in the first
    plane = 0.1 * world_x - 0.2 * world_y
    other = Relief(plane, np.ones_like(plane), 2 * plane, plane + 7.0, np.full(plane.shape, 0.3), 1.0, (-15.0, -20.0))
    both = lay_beside(submaps, {0: own, 1: other}, 0, range(2))
    known = both.weight > 0
    rows, columns = np.nonzero(known)
    x, y = both.origin[0] + columns, both.origin[1] + rows
    assert x.max() > 45.0  # beyond its own grid, which ends at 20 m
    np.testing.assert_allclose(both.z[known], 0.1 * x - 0.2 * y, atol=1e-9)
    np.testing.assert_allclose(both.reflectivity[known], 0.2 * x - 0.4 * y, atol=1e-9)
    # the neighbour's offset of 7 m is its gauge
    np.testing.assert_allclose(both.height[known], 0.1 * x - 0.2 * y, atol=1e-8)


def test_where_both_know_a_cell_the_trusted_one_counts_more():
    submaps = [at((100.0, 100.0, 0.0), 0), at((100.0, 100.0, 0.0), 1)]
    own, other = wavy((-20.0, -15.0)), wavy((-20.0, -15.0))
    own = replace(own, z=np.zeros_like(own.z), weight=np.full(own.z.shape, 0.2))
    other = replace(other, z=np.ones_like(own.z), weight=np.full(own.z.shape, 0.6))
    both = lay_beside(submaps, {0: own, 1: other}, 0, range(2))
    np.testing.assert_allclose(both.z[both.weight > 0], 0.75)
    np.testing.assert_allclose(both.weight[both.weight > 0], 0.8)


def test_unknown_cells_stay_unknown():
    submaps = [at((100.0, 100.0, 0.0), 0), at((220.0, 100.0, 0.0), 1)]
    both = lay_beside(submaps, dict.fromkeys(range(2), wavy((-20.0, -15.0))), 0, range(2))
    between = both.weight[:, 60:80]
    assert not between.any()
    assert both.weight[:-1, :40].all()  # the last cell has no next one to interpolate with
    assert (both.sigma[:, 60:80] == 1.0).all()


def test_with_its_surroundings_a_crossing_is_more_significant():
    """A crossing by a line whose middle submap covers a corner of the other's: the neighbours cover the rest."""
    rng = np.random.default_rng(3)
    floor = rough_seafloor(rng)
    along = [cut_submap(floor, (70.0 + 40.0 * k, 130.0, 0.0), rng, k) for k in range(4)]
    across = [cut_submap(floor, (150.0, 70.0 + 40.0 * k, np.pi / 2), rng, 10 + k) for k in range(4)]
    submaps = [*along, *across]
    reliefs = {k: extract_relief(submap) for k, submap in enumerate(submaps)}
    T = planar_pose(80.0, -20.0, np.pi / 2)  # of the second across seen from the first along
    alone = verify(stack_layers(reliefs[0]), stack_layers(reliefs[5]), T)
    target, source = lay_beside(submaps, reliefs, 0, range(3)), lay_beside(submaps, reliefs, 5, range(4, 8))
    together = verify(stack_layers(target), stack_layers(source), T)
    assert together.overlap_area > 2 * alone.overlap_area
    assert together.significance > alone.significance + 3.0
    np.testing.assert_allclose(together.T_target_source[:2], T[:2], atol=1.0)
