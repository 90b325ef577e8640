import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from frontend.frames import planar_pose
from frontend.loop_closures import LoopClosureConfig
from frontend.open3d_loader import load_open3d
from frontend.refiners import CloudConfig, _level, refine_by_clouds
from frontend.registration import RegistrationConfig, register
from tests.frontend.test_registration import error_of, layers_of, two_passes

REFINERS = ["relief", "small_gicp", "kiss_icp", "open3d_icp"]
RELATIVE = (6.0, -9.0, np.pi)
START = planar_pose(6.5, -8.5, np.pi + np.radians(2))  # 0.7 m and 2 degrees off


@pytest.fixture(scope="module")
def passes():
    return tuple(layers_of(submap) for submap in two_passes(1, RELATIVE))


@pytest.mark.parametrize("refiner", REFINERS)
def test_every_refiner_brings_a_start_to_the_truth_twice_the_same(passes, refiner):
    config = RegistrationConfig(refiner=refiner)
    found = [register(*passes, START, config) for _ in range(2)]
    shift, yaw = error_of(found[0].T_target_source, RELATIVE)
    # a third of a cell and what that is at the edge of a submap: well inside what counts as true
    assert shift < 0.3
    assert yaw < np.radians(1)
    assert found[0].T_target_source.tobytes() == found[1].T_target_source.tobytes()
    assert found[0].T_target_source[2, :2].tolist() == [0.0, 0.0]  # no roll, no pitch


@pytest.mark.parametrize("refiner", REFINERS[1:])
def test_where_nothing_overlaps_the_start_comes_back(passes, refiner):
    far = planar_pose(500.0, 0.0, 0.3)
    assert refine_by_clouds(passes, far, refiner, CloudConfig()) == pytest.approx((500.0, 0.0, 0.3))


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3))
def test_a_level_transform_is_read_as_it_is(x, y, yaw):
    found = _level(planar_pose(x, y, yaw, z=7.0), np.array([11.0, -4.0]))
    assert found == pytest.approx((x, y, yaw), abs=1e-9)  # rounding of a product


def test_roll_and_pitch_turn_about_the_middle_of_the_overlap():
    T, middle = planar_pose(3.0, 4.0, 0.5), np.array([20.0, 30.0])
    tilted = T.copy()
    tilted[:3, :3] = T[:3, :3] @ Rotation.from_euler("xy", [0.05, -0.04]).as_matrix()
    x, y, yaw = _level(tilted, middle)
    goes_to = (planar_pose(x, y, yaw) @ [*middle, 0.0, 1.0])[:2]
    assert goes_to == pytest.approx((tilted @ [*middle, 0.0, 1.0])[:2], abs=1e-9)
    assert yaw == pytest.approx(0.5, abs=2e-3)  # the product of the two tilts


def test_a_refiner_that_is_not_known_is_refused():
    with pytest.raises(ValueError, match="'relief', 'small_gicp', 'kiss_icp' or 'open3d_icp'"):
        LoopClosureConfig.model_validate({"registration": {"refiner": "magic"}})


def test_open3d_is_left_with_as_many_threads_as_it_had(passes):
    o3d = load_open3d()
    before = o3d.utility.get_max_threads()
    refine_by_clouds(passes, START, "open3d_icp", CloudConfig())
    assert o3d.utility.get_max_threads() == before
