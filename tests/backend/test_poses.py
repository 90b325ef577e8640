import gtsam
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from backend.poses import adjoint, as_poses, cross_matrix, invert, logarithm, sandwich, tangent_covariance

vectors = arrays(np.float64, 3, elements=st.floats(-3.0, 3.0))


def pose(rotation_vector, translation):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(rotation_vector).as_matrix(), translation
    return T


@given(vectors, vectors)
def test_logarithm_is_that_of_gtsam(rotation_vector, translation):
    T = pose(rotation_vector * 0.59, 10.0 * translation)  # at most 3.07 rad, short of the half turn
    # near a half turn both lose half of the digits in the rotation's axis
    np.testing.assert_allclose(logarithm(T[None])[0], gtsam.Pose3.Logmap(gtsam.Pose3(T)), rtol=0, atol=1e-6)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 0.99e-4, 1.01e-4, 1e-3])
def test_logarithm_of_small_turns_inverts_the_exponential_map(angle):
    xi = np.concatenate([angle * np.array([0.6, 0.0, 0.8]), [1.0, -2.0, 3.0]])
    np.testing.assert_allclose(logarithm(gtsam.Pose3.Expmap(xi).matrix()[None])[0], xi, rtol=1e-9, atol=1e-14)


@given(vectors, vectors)
def test_adjoint_is_that_of_gtsam(rotation_vector, translation):
    T = pose(rotation_vector, translation)
    np.testing.assert_allclose(adjoint(T), gtsam.Pose3(T).AdjointMap(), rtol=0, atol=1e-12)


@given(vectors, vectors)
def test_a_pose_times_its_inverse_is_the_identity(rotation_vector, translation):
    T = pose(rotation_vector, translation)
    np.testing.assert_allclose(T @ invert(T), np.eye(4), rtol=0, atol=1e-12)


@given(vectors, vectors)
def test_cross_matrix_times_a_vector_is_the_cross_product(a, b):
    np.testing.assert_allclose(cross_matrix(a) @ b, np.cross(a, b), rtol=0, atol=1e-12)


def test_sandwich_is_exactly_symmetric():
    rng = np.random.default_rng(0)
    mapped = sandwich(rng.normal(size=(5, 4, 6)), np.diag(rng.uniform(1, 2, 6)))
    assert np.array_equal(mapped, np.swapaxes(mapped, 1, 2))


def test_tangent_covariance_describes_errors_made_along_the_targets_axes():
    rng = np.random.default_rng(1)
    T, sigmas = pose([0.3, -0.2, 1.5], [5.0, 2.0, -1.0]), 1e-3 * np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    errors = sigmas * rng.normal(size=(20_000, 6))
    noisy = np.tile(T, (len(errors), 1, 1))
    noisy[:, :3, :3] = Rotation.from_rotvec(errors[:, :3]).as_matrix() @ T[:3, :3]
    noisy[:, :3, 3] += errors[:, 3:]
    sampled = np.cov(logarithm(invert(T) @ noisy).T)
    expected = tangent_covariance(T, np.diag(sigmas**2))
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # a sampled correlation of 20 000 draws has a standard deviation of 0.7 %, a variance of 1 %; four of them
    np.testing.assert_allclose(sampled / scale, expected / scale, rtol=0, atol=0.04)


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        (np.eye(4), r"track must be poses of shape \(K, 4, 4\), got shape \(4, 4\)"),
        (np.full((2, 4, 4), np.nan), "track must be finite: pose 0 is not"),
        (np.stack([np.eye(4), 2.0 * np.eye(4)]), "track must be rigid transforms: pose 1 is not"),
        (np.diag([1.0, 1.0, -1.0, 1.0])[None], "track must be rigid transforms: pose 0 is not"),
    ],
)
def test_what_is_no_pose_is_refused(poses, message):
    with pytest.raises(ValueError, match=message):
        as_poses(poses, "track")
