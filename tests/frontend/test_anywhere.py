"""Places recognised by appearance alone: two dives over one seafloor, neither knowing where the other was."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.acceptance import AcceptanceConfig
from frontend.anywhere import anywhere
from frontend.features import describe
from frontend.frames import invert, planar_parameters, planar_pose
from frontend.loop_closures import recognise_pairs
from frontend.pairs import PairConfig, PairFinder
from frontend.relief import extract_relief
from tests.frontend.seafloor_scenes import PINGS_A_SUBMAP, Seafloor, cut_submap, rippled_seafloor, rough_seafloor

FIRST_DIVE = [(100.0, 100.0, 0.1), (300.0, 100.0, 0.4), (500.0, 120.0, -0.3), (120.0, 400.0, 1.0), (400.0, 420.0, 2.0)]
SECOND_DIVE = [(305.0, 92.0, 2.2), (112.0, 405.0, -1.6), (250.0, 250.0, 0.7)]  # two places again, and one that is new


def two_dives(seafloor, error, seed):
    """Submaps of both, the second dive believed to be kilometres away and on other headings."""
    rng = np.random.default_rng(seed)
    submaps = [cut_submap(seafloor, pose, rng, k, error) for k, pose in enumerate(FIRST_DIVE + SECOND_DIVE)]
    lost = [
        replace(s, T_world_submap_dr=planar_pose(5000.0 + 300.0 * k, -4000.0, rng.uniform(-np.pi, np.pi)))
        for k, s in enumerate(submaps[len(FIRST_DIVE) :])
    ]
    return submaps[: len(FIRST_DIVE)] + lost


def recognised(submaps, n_anywhere=2):
    features = [describe(submap) for submap in submaps]
    finder = PairFinder(PairConfig(n_anywhere=n_anywhere))
    distance = np.arange(PINGS_A_SUBMAP * len(submaps)) * 0.4
    covariance = np.diag([1e-4, 1e-4, 1e-3, 25.0, 25.0, 1e-2])
    pairs = []
    for source, (submap, known) in enumerate(zip(submaps, features, strict=True)):
        partners = finder.add(submap, known, distance, lambda _target, _source: covariance)
        pairs += [(int(target), source) for target in partners.anywhere if source >= len(FIRST_DIVE)]
    return list(recognise_pairs(pairs, submaps, features, lambda _target, _source: covariance))


def test_the_places_of_another_dive_are_found_and_right():
    closures = recognised(two_dives(rough_seafloor(np.random.default_rng(0), size=600), 0.05, 1))
    accepted = {(c.target, c.source): c for c in closures if c.accepted}
    assert set(accepted) == {(1, 5), (3, 6)}
    for (target, source), closure in accepted.items():
        poses = FIRST_DIVE + SECOND_DIVE
        T_true = invert(planar_pose(*poses[target])) @ planar_pose(*poses[source])
        x, y, yaw = planar_parameters(invert(T_true) @ closure.T_target_source)
        assert np.hypot(x, y) < 1.0  # a cell
        assert abs(yaw) < np.radians(2)
    assert all(closure.is_from_appearance for closure in closures)


@pytest.mark.parametrize("wavelength", [16.0])
def test_nothing_is_recognised_on_ripples(wavelength):
    closures = recognised(two_dives(rippled_seafloor(600, wavelength), 0.03, 2))
    assert closures
    assert not any(closure.accepted for closure in closures)


def test_nothing_is_recognised_on_flat_floor():
    flat = Seafloor(np.zeros((600, 600)), np.zeros((600, 600)))
    closures = recognised(two_dives(flat, 0.05, 3))
    assert closures
    assert not any(closure.accepted for closure in closures)


def test_no_other_place_is_recognised_on_rough_floor():
    """A second dive beside the first: no submap shows what another does."""
    rng = np.random.default_rng(4)
    submaps = two_dives(rough_seafloor(rng, size=600), 0.05, 5)
    elsewhere = rough_seafloor(rng, size=600)
    submaps[5:] = [
        replace(cut_submap(elsewhere, pose, rng, 5 + k, 0.05), T_world_submap_dr=submaps[5 + k].T_world_submap_dr)
        for k, pose in enumerate(SECOND_DIVE)
    ]
    closures = recognised(submaps)
    assert closures
    assert not any(closure.accepted for closure in closures)


def test_the_gate_holds_every_heading_and_shift_that_overlaps_by_a_quarter():
    rng = np.random.default_rng(6)
    a, b = (extract_relief(cut_submap(rough_seafloor(rng), (150.0, 150.0, 0.0), rng)) for _ in range(2))
    prior = anywhere(a, b)  # 80 m by 100 m
    for yaw in np.linspace(-np.pi, np.pi, 9):
        assert prior.admits(planar_pose(*a.centre, yaw))
        assert prior.admits(planar_pose(a.centre[0], a.centre[1] + 72.0, yaw))
        assert prior.admits(planar_pose(a.centre[0] - 58.0, a.centre[1], yaw))


def test_true_pairs_are_as_much_rarer_as_there_are_places():
    config = AcceptanceConfig(min_lead_anywhere=2.0)
    strict = config.anywhere(50)
    assert strict.probability.share == pytest.approx(config.probability.share / 50)
    assert strict.min_lead == 2.0
    assert config.anywhere(0).probability == config.probability
    assert strict.min_overlap == config.min_overlap
