import numpy as np
import pytest

from frontend.comparison import Places
from frontend.frames import invert, planar_parameters, planar_pose
from frontend.loop_closures import LoopClosureConfig
from sssslam.map_agreement import MapAgreement
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor

RELATIVE = planar_pose(10.0, -15.0, 0.6)


@pytest.fixture(scope="module")
def submaps():
    rng = np.random.default_rng(0)
    seafloor, start = rough_seafloor(rng), planar_pose(150.0, 150.0, 0.2)
    places = (planar_parameters(start), planar_parameters(start @ RELATIVE))
    return [cut_submap(seafloor, place, rng, k, 0.06) for k, place in enumerate(places)]


def bodies(submaps, T_levels):
    return invert(submaps[0].T_submap_body) @ T_levels @ submaps[1].T_submap_body


def test_maps_agree_at_the_true_place_and_not_beside_it(submaps):
    agreement = MapAgreement(submaps, LoopClosureConfig())
    assert agreement(0, 1, bodies(submaps, RELATIVE)) > 6.0
    # beside it they are like unrelated floors: one standard deviation about zero
    assert abs(agreement(0, 1, bodies(submaps, planar_pose(-10.0, 5.0, 0.6)))) < 4.0


def test_maps_that_do_not_overlap_have_no_agreement(submaps):
    assert np.isnan(MapAgreement(submaps, LoopClosureConfig())(0, 1, planar_pose(500.0, 0.0, 0.0)))


def test_what_the_front_end_has_made_ready_gives_the_same_agreement(submaps, monkeypatch):
    config, between = LoopClosureConfig(), bodies(submaps, RELATIVE)
    places = Places(submaps, config.relief, config.search)
    places.sides(0, 1)
    expected = MapAgreement(submaps, config)(0, 1, between)
    monkeypatch.setattr("frontend.comparison.extract_relief", None)  # nothing is worked out again
    assert MapAgreement(submaps, config, places)(0, 1, between) == expected
