"""Marks of the sonar along the track: found, taken out, and not mistaken for a place."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import KDTree

from frontend.footprints import distance_from_track, evenness, without_profile
from frontend.frames import planar_pose
from frontend.overlap import stack_layers
from frontend.relief import extract_relief
from frontend.submaps import Submap
from frontend.verification import significance_at
from tests.frontend.seafloor_scenes import Seafloor, cut_submap

FLAT = Seafloor(np.zeros((300, 300)), np.zeros((300, 300)))
RADIUS = 45.0


def pass_over_mud(seed: int = 0) -> Submap:
    """A pass over floor without relief: all that is seen is error."""
    submap = cut_submap(FLAT, (150.0, 150.0, 0.0), np.random.default_rng(seed), error=0.02)
    return replace(submap, track=np.linspace([-40.0, 0.0, 0.0], [40.0, 0.0, 0.0], 200))


def in_a_turn(submap: Submap) -> Submap:
    """The same submap, flown on a circle to port."""
    angle = np.linspace(-0.9, 0.9, 200)
    circle = np.stack([RADIUS * np.sin(angle), RADIUS * (1 - np.cos(angle)), 0 * angle], axis=1)
    return replace(submap, track=circle)


def with_ridges(submap: Submap, height: float = 0.15) -> Submap:
    """The same submap with a ridge 5 m to each side of its track, as a wrong beam pattern raises them."""
    ridge = height * np.exp(-((np.abs(distance_from_track(submap)) - 5.0) ** 2))
    return replace(submap, surface=replace(submap.surface, z=submap.surface.z + ridge))


def test_the_distance_from_a_straight_track_is_y():
    submap = pass_over_mud()
    y = submap.surface.y[:, None] * np.ones_like(submap.surface.x)
    assert distance_from_track(submap) == pytest.approx(y, abs=1e-9)


def test_the_distance_from_a_circle_is_that_from_its_line_and_positive_inside_a_turn_to_port():
    submap = in_a_turn(pass_over_mud())
    x, y = np.meshgrid(submap.surface.x, submap.surface.y)
    beside = (np.abs(np.arctan2(x, RADIUS - y)) < 0.85) & (y < RADIUS)
    expected = RADIUS - np.hypot(x, y - RADIUS)
    assert distance_from_track(submap)[beside] == pytest.approx(expected[beside], abs=0.05)


def test_the_distance_is_counted_at_the_ping_that_a_tree_finds_nearest():
    submap = pass_over_mud()
    track = np.cumsum(np.random.default_rng(3).normal(0.0, 2.0, (150, 3)), axis=0)
    points = np.stack(np.meshgrid(submap.surface.x, submap.surface.y), axis=-1)
    _, nearest = KDTree(track[:, :2]).query(points)
    course, away = np.gradient(track[:, :2], axis=0)[nearest], points - track[nearest, :2]
    left = course[..., 0] * away[..., 1] - course[..., 1] * away[..., 0]
    expected = left / np.hypot(course[..., 0], course[..., 1])
    assert distance_from_track(replace(submap, track=track)) == pytest.approx(expected, abs=1e-9)  # rounding of 100 m


@pytest.mark.parametrize("n_pings", [0, 1])
def test_without_a_track_there_is_no_distance_and_nothing_is_taken_out(n_pings):
    submap = replace(pass_over_mud(), track=np.zeros((n_pings, 3)))
    distance, z = distance_from_track(submap), submap.surface.z
    assert np.isnan(distance).all()
    assert np.array_equal(without_profile(z, np.ones_like(z), distance, 1.0), z)
    assert np.array_equal(evenness(z, np.ones_like(z), distance, 1.0), np.ones_like(z))


@given(st.integers(0, 999), st.floats(0.1, 10.0))
def test_what_is_a_broken_line_over_the_distance_goes_and_the_rest_does_not_feel_it(seed, height):
    rng = np.random.default_rng(seed)
    distance, values = rng.uniform(-20.0, 20.0, (50, 60)), rng.normal(size=(50, 60))
    weight = rng.uniform(0.0, 1.0, (50, 60))
    mark = height * np.interp(distance, np.arange(-21.0, 22.0), rng.normal(size=43))
    rest, alone = (without_profile(a, weight, distance, 1.0) for a in (values + mark, values))
    assert rest == pytest.approx(alone, abs=1e-6 * height)
    assert np.abs(alone - values).max() < 3.0  # a mean of some seventy values a node


def test_a_strip_of_marks_is_uneven_and_a_strip_with_a_boulder_is_not():
    rng, distance = np.random.default_rng(1), np.arange(-20.0, 20.0)[:, None] * np.ones(80)
    values = rng.normal(size=distance.shape)
    values[10], values[30, 40:45] = 10 * values[10], 30.0
    even = evenness(values, np.ones_like(values), distance, 1.0)
    assert even[10].max() < 0.1
    assert even[30].min() > 0.8
    assert np.median(even) == 1.0


@pytest.mark.parametrize("flown", [lambda submap: submap, in_a_turn])
def test_ridges_along_the_track_do_not_make_two_passes_over_mud_alike(flown):
    here, there = (with_ridges(flown(pass_over_mud(seed))) for seed in (1, 2))
    alike = [
        significance_at(*(stack_layers(extract_relief(s)) for s in pair), planar_pose(0.0, 0.0, 0.0))[0]
        for pair in ((here, there), [replace(s, track=np.empty((0, 3))) for s in (here, there)])
    ]
    assert alike[1] > 4.0  # without a track nobody can tell; straight ridges repeat as well, which takes a part of them
    assert alike[0] < 3.0
