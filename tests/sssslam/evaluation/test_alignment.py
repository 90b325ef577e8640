"""Tests of the rigid alignment."""

import numpy as np
import pytest
from evo.core.geometry import umeyama_alignment
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sssslam.evaluation.alignment import aligned, rigid_alignment


@given(st.floats(-3.1, 3.1), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.integers(0, 1000))
def test_a_rigid_motion_in_the_plane_is_found(angle: float, x: float, y: float, seed: int) -> None:
    points = np.random.default_rng(seed).normal(0.0, 30.0, (12, 2))
    c, s = np.cos(angle), np.sin(angle)
    moved = points @ np.array([[c, -s], [s, c]]).T + [x, y]
    rotation, translation = rigid_alignment(points, moved)
    np.testing.assert_allclose(rotation, [[c, -s], [s, c]], atol=1e-9)
    np.testing.assert_allclose(translation, [x, y], atol=1e-6)


def test_evo_finds_the_same_motion_of_noisy_points_in_space() -> None:
    rng = np.random.default_rng(4)
    points = rng.normal(0.0, 20.0, (50, 3))
    turned = Rotation.from_euler("xyz", [0.3, -0.2, 2.0]).apply(points)
    points_ref = turned + np.array([5.0, 6.0, 7.0]) + rng.normal(0.0, 1.0, (50, 3))
    rotation, translation = rigid_alignment(points, points_ref)
    theirs = umeyama_alignment(points.T, points_ref.T, with_scale=False)
    np.testing.assert_allclose(rotation, theirs[0], atol=1e-12)
    np.testing.assert_allclose(translation, theirs[1], atol=1e-10)


def test_a_mirror_is_not_taken_for_a_rotation() -> None:
    points = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])
    rotation, _ = rigid_alignment(points, points * [1.0, -1.0])
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    residual = np.linalg.norm(aligned(points, points * [1.0, -1.0]) - points * [1.0, -1.0])
    centred = points - points.mean(axis=0)
    for angle in np.linspace(-np.pi, np.pi, 100):
        c, s = np.cos(angle), np.sin(angle)
        turned = centred @ np.array([[c, s], [-s, c]])
        assert residual <= np.linalg.norm(turned - centred * [1.0, -1.0]) + 1e-9


@pytest.mark.parametrize("d", [2, 3])
def test_points_that_coincide_are_shifted_only(d: int) -> None:
    moved = aligned(np.ones((5, d)), np.full((5, d), 4.0))
    np.testing.assert_allclose(moved, 4.0, atol=1e-12)
    assert np.linalg.det(rigid_alignment(np.ones((5, d)), np.full((5, d), 4.0))[0]) == pytest.approx(1.0)


def test_a_longer_track_is_not_shrunk() -> None:
    line = np.column_stack([np.linspace(-1.0, 1.0, 5), np.zeros(5)])
    np.testing.assert_allclose(aligned(2.0 * line, line), 2.0 * line, atol=1e-12)
