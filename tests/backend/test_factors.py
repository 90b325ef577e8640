import gtsam
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from backend.factors import UnaryKnowledge, first_pose_factor, pose_values, poses_of, unary_factors
from backend.poses import as_poses


def pose(x=0.0, y=0.0, z=0.0, angles=(0.0, 0.0, 0.0)):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("ZYX", angles).as_matrix(), [x, y, z]
    return T


def error(factors, T):
    values = gtsam.Values()
    values.insert(0, gtsam.Pose3(T))
    return sum(factor.error(values) for factor in factors)


MEASURED = pose(1e4, -2e4, -3000.0, (2.0, 0.1, -0.2))
KNOWN = unary_factors(MEASURED, UnaryKnowledge(0, depth_sd=0.1, tilt_sd=0.01))


def test_depth_and_tilt_are_met_by_what_was_measured():
    assert error(KNOWN, MEASURED) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("moved", [{"x": 1.1e4}, {"y": -2.2e4}, {"angles": (-1.0, 0.1, -0.2)}])
def test_x_y_and_yaw_stay_free(moved):
    T = pose(**({"x": 1e4, "y": -2e4, "z": -3000.0, "angles": (2.0, 0.1, -0.2)} | moved))
    assert error(KNOWN, T) < 1e-5  # 2 km off are 2e-3 sigmas of what a depth does not tell


@pytest.mark.parametrize(
    ("moved", "expected"),
    [({"z": -2999.8}, 2.0), ({"angles": (2.0, 0.12, -0.2)}, 2.0), ({"angles": (2.0, 0.1, -0.22)}, 2.0)],
)
def test_two_sigmas_of_depth_pitch_or_roll_cost_two(moved, expected):
    T = pose(**({"x": 1e4, "y": -2e4, "z": -3000.0, "angles": (2.0, 0.1, -0.2)} | moved))
    # a turn by pitch under a roll of 0.2 rad turns the vertical by its cosine
    assert error(KNOWN, T) == pytest.approx(expected, rel=0.05)


def test_the_first_pose_has_its_sigmas_along_the_worlds_axes():
    T = pose(angles=(np.pi / 2, 0.0, 0.0))
    held = [first_pose_factor(T, np.array([1.0, 1.0, 1.0, 0.1, 10.0, 1.0]))]
    assert error(held, pose(x=0.2, angles=(np.pi / 2, 0.0, 0.0))) == pytest.approx(2.0)
    assert error(held, pose(y=0.2, angles=(np.pi / 2, 0.0, 0.0))) == pytest.approx(0.0002)


def test_poses_go_through_gtsam_unchanged():
    rng = np.random.default_rng(0)
    T = np.stack([pose(*rng.normal(size=3), rng.normal(size=3)) for _ in range(5)])
    assert np.array_equal(poses_of(pose_values(as_poses(T, "T"))), T)
