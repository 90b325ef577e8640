from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frontend.coverage import coverage_of, possible_overlap
from frontend.features import Features
from frontend.frames import planar_pose
from frontend.heightfield import Heightfield
from frontend.pairs import PairConfig, PairFinder, pairs_to_compare, predicted_transform
from frontend.priors import Prior
from frontend.submaps import Submap
from frontend.trajectory import Trajectory


def square_submap(number, x, y, yaw=0.0, first_ping=None):
    """80 m by 80 m of floor about (x, y), 100 pings long."""
    first = 100 * number if first_ping is None else first_ping
    z = np.zeros((81, 81))
    surface = Heightfield(z, 1.0, (-40.0, -40.0))
    T = planar_pose(x, y, yaw)
    return Submap(number, first, first + 100, first + 50, 0.0, T, np.eye(4), surface, z, z, z > 0)


def track(n, step=0.8):
    zero = np.zeros(n)
    return Trajectory(np.arange(float(n)), step * np.arange(n), zero, zero, zero, zero, zero)


def covariance(sigma):
    return lambda _target, _source: np.diag([1e-4, 1e-4, 1e-3, sigma**2, sigma**2, 1e-2])


def test_submaps_over_one_place_are_a_pair_with_the_earlier_as_target():
    submaps = [square_submap(0, 0.0, 0.0), square_submap(1, 500.0, 0.0), square_submap(5, 0.0, 0.0)]
    assert pairs_to_compare(submaps, track(600), covariance(5.0)) == [(0, 2)]


def test_neighbours_along_the_track_are_no_pair():
    """Windows of 79.2 m; anchors 160 m apart are more than two lengths away, 158 m are not."""
    far = [square_submap(0, 0.0, 0.0), square_submap(1, 0.0, 0.0, first_ping=200)]
    near = [square_submap(0, 0.0, 0.0), square_submap(1, 0.0, 0.0, first_ping=197)]
    assert pairs_to_compare(far, track(400), covariance(5.0)) == [(0, 1)]
    assert pairs_to_compare(near, track(400), covariance(5.0)) == []


def test_submaps_that_share_a_ping_are_no_pair_however_long_the_way():
    submaps = [square_submap(0, 0.0, 0.0), square_submap(1, 0.0, 0.0, first_ping=99)]
    assert pairs_to_compare(submaps, track(300), covariance(5.0), PairConfig(min_separation=0.1)) == []


def test_a_vehicle_that_stood_still_in_between_is_no_further_along_the_track():
    submaps = [square_submap(0, 0.0, 0.0), square_submap(9, 0.0, 0.0)]
    distance = np.concatenate([np.arange(100.0), np.full(800, 100.0), 100.0 + np.arange(100.0)])
    zero = np.zeros(1000)
    still = Trajectory(np.arange(1000.0), distance, zero, zero, zero, zero, zero)
    assert pairs_to_compare(submaps, still, covariance(5.0)) == []


@pytest.mark.parametrize(
    ("gap", "sigma", "expected"), [(60, 0.5, True), (75, 0.5, False), (110, 20.0, True), (110, 5.0, False)]
)
def test_pairs_reach_as_far_as_the_gate(gap, sigma, expected):
    """Squares of 80 m overlap by 20 % up to 64 m apart, and as much further as the gate is wide (3.8 sigmas)."""
    submaps = [square_submap(0, 0.0, 0.0), square_submap(5, float(gap), 0.0)]
    assert bool(pairs_to_compare(submaps, track(600), covariance(sigma))) == expected


def test_the_heading_of_the_submaps_does_not_matter():
    submaps = [square_submap(0, 0.0, 0.0, 0.4), square_submap(5, 10.0, 0.0, 2.9)]
    assert pairs_to_compare(submaps, track(600), covariance(5.0)) == [(0, 1)]


def test_a_submap_of_which_nothing_is_known_is_in_no_pair():
    empty = square_submap(5, 0.0, 0.0)
    empty = replace(empty, surface=replace(empty.surface, z=np.full((81, 81), np.nan)))
    assert pairs_to_compare([square_submap(0, 0.0, 0.0), empty], track(600), covariance(5.0)) == []


def test_no_submaps_give_no_pairs():
    assert pairs_to_compare([], track(2), covariance(5.0)) == []


def test_the_predicted_transform_takes_source_points_to_the_target():
    a, b = square_submap(0, 3.0, 1.0, np.pi / 2), square_submap(1, 3.0, 5.0, np.pi / 2)
    assert predicted_transform(a, b) == pytest.approx(planar_pose(4.0, 0.0, 0.0), abs=1e-12)


class Together:
    """A prior that answers for many pairs at once, and says so when it is asked one by one."""

    def __init__(self, sigma):
        self.sigma = sigma

    def __call__(self, _target, _source):
        raise AssertionError("asked one by one")

    def many(self, targets, _source):
        return np.tile(covariance(self.sigma)(0, 0), (len(targets), 1, 1))


def test_a_prior_that_knows_many_pairs_is_asked_once():
    submaps = [square_submap(k, 30.0 * (k % 3), 0.0) for k in range(0, 12, 3)]
    one_by_one = pairs_to_compare(submaps, track(1200), covariance(5.0))
    assert one_by_one
    assert pairs_to_compare(submaps, track(1200), Together(5.0)) == one_by_one


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_what_is_left_out_at_a_glance_could_not_have_overlapped(seed):
    """Long, thin gates in any direction and submaps turned at will; the judge looks at every pair in full."""
    rng = np.random.default_rng(seed)
    submaps = [square_submap(3 * k, *rng.uniform(-150, 150, 2), rng.uniform(-np.pi, np.pi)) for k in range(8)]
    gates = []
    for sigmas, turn in zip(rng.uniform([1.0, 1.0], [5.0, 40.0], (8, 2)), rng.uniform(0, np.pi, 8), strict=True):
        R, C = planar_pose(0.0, 0.0, turn)[:2, :2], np.diag([1e-4, 1e-4, 1e-3, 0.0, 0.0, 1e-2])
        C[3:5, 3:5] = R @ np.diag(sigmas**2) @ R.T
        gates.append(C)
    config, covers = PairConfig(), [coverage_of(submap) for submap in submaps]
    expected = []
    for source in range(8):
        for target in range(source):
            prior = Prior(predicted_transform(submaps[target], submaps[source]), gates[target], config.gate)
            if possible_overlap(covers[target], covers[source], prior) >= config.min_overlap:
                expected.append((target, source))
    assert pairs_to_compare(submaps, track(2400), lambda target, _source: gates[target], config) == expected


def test_in_a_wide_gate_no_more_are_asked_about_than_partners_are_wanted():
    """Of 300 submaps on one place a few dozen answers give one its two partners."""
    asked = []

    def prior(target, source):
        asked.append((target, source))
        return covariance(20.0)(target, source)

    submaps = [square_submap(3 * k, 0.0, 0.0) for k in range(300)]
    pairs = pairs_to_compare(submaps, track(90000), prior, PairConfig(max_partners=2))
    assert sum(source == 299 for _, source in pairs) == 2
    assert sum(source == 299 for _, source in asked) < 100


def features_of(rng):
    histograms = rng.gamma(0.5, size=(150, 33))
    return Features(np.zeros((150, 3)), 200 * histograms, np.zeros((150, 3)))


def test_of_too_many_inside_the_gate_the_most_alike_are_compared():
    rng = np.random.default_rng(0)
    submaps = [square_submap(3 * k, 5.0 * k, 0.0) for k in range(12)]
    features = [features_of(rng) for _ in submaps]
    features[11] = replace(features[4], descriptors=features[4].descriptors + rng.normal(0, 1.0, (150, 33)))
    pairs = pairs_to_compare(submaps, track(4000), covariance(20.0), PairConfig(max_partners=2), features)
    assert (4, 11) in pairs
    assert all(sum(source == k for _, source in pairs) <= 2 for k in range(12))


def test_without_features_the_nearest_inside_the_gate_are_compared():
    submaps = [square_submap(3 * k, 5.0 * k, 0.0) for k in range(6)]
    pairs = pairs_to_compare(submaps, track(2000), covariance(20.0), PairConfig(max_partners=2))
    assert [target for target, source in pairs if source == 5] == [3, 4]


def test_places_outside_the_gate_are_partners_where_they_are_alike_and_asked_for():
    rng = np.random.default_rng(1)
    submaps = [square_submap(3 * k, 400.0 * k, 0.0) for k in range(8)]
    features = [features_of(rng) for _ in submaps]
    features[7] = replace(features[2], descriptors=features[2].descriptors + rng.normal(0, 1.0, (150, 33)))
    for n, expected in ((0, []), (1, [2])):
        finder = PairFinder(PairConfig(n_anywhere=n))
        found = [
            finder.add(s, f, track(4000).distance, covariance(5.0)) for s, f in zip(submaps, features, strict=True)
        ]
        assert found[7].in_gate.tolist() == []
        assert found[7].anywhere.tolist() == expected
    assert len(finder) == 8
