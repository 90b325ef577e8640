import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from frontend import fpfh as module
from frontend.fpfh import N_BINS, fast_point_feature_histograms
from frontend.heightfield import Heightfield
from frontend.open3d_loader import load_open3d
from frontend.submaps import surface_normals

MIDDLE = [5, 16, 27]  # bins of three angles of 0


def rough(seed, shape=(14, 17), known=0.8):
    """Heights with gaps, their normals, and every third cell that is known."""
    rng = np.random.default_rng(seed)
    z = rng.normal(0.0, 0.5, shape)
    normals = np.dstack([rng.normal(0.0, 0.4, (*shape, 2)), np.ones(shape)])
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    is_known = rng.random(shape) < known
    return np.where(is_known, z, np.nan), normals, is_known & (rng.random(shape) < 1 / 3)


@pytest.mark.parametrize("spacing", [0.5, 1.0, 2.5])
def test_descriptors_are_open3ds(spacing):
    """Its points are every known cell, its neighbourhood in space; a few last digits are the order of sums."""
    z, normals, chosen = rough(1)
    descriptors = fast_point_feature_histograms(z, normals, chosen, spacing, 3.3 * spacing)
    x, y = np.meshgrid(spacing * np.arange(z.shape[1]), spacing * np.arange(z.shape[0]))
    known, o3d = np.isfinite(z), load_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.dstack([x, y, z])[known]))
    cloud.normals = o3d.utility.Vector3dVector(normals[known])
    search = o3d.geometry.KDTreeSearchParamHybrid(radius=3.3 * spacing, max_nn=1000)
    expected = np.asarray(o3d.pipelines.registration.compute_fpfh_feature(cloud, search).data).T[chosen[known]]
    assert descriptors.shape == (chosen.sum(), N_BINS)
    np.testing.assert_allclose(descriptors, expected, atol=1e-9)


def test_two_points_side_by_side_have_the_angles_of_their_normals():
    """Along x, the second normal turned by 0.9 about y: it is nearer to the line, from it the turn is 0.9."""
    z = np.zeros((1, 2))
    normals = np.array([[[0.0, 0.0, 1.0], [np.sin(0.9), 0.0, np.cos(0.9)]]])
    first, second = fast_point_feature_histograms(z, normals, np.ones((1, 2), dtype=bool), 1.0, 1.5)
    # from the second point the line is -x, along it its normal lies by -sin(0.9); v is y, w (-cos(0.9), 0, sin(0.9)),
    # and the first normal z has sin(0.9) of w, cos(0.9) of the second normal and nothing of v
    turn, tilt, along = (int(11 * share) for share in ((np.pi + 0.9) / (2 * np.pi), 0.5, (1 - np.sin(0.9)) / 2))
    expected = np.zeros(N_BINS)
    expected[[turn, 11 + tilt, 22 + along]] = 200.0
    np.testing.assert_allclose(first, expected)
    np.testing.assert_allclose(second, expected)


def test_a_level_plane_is_all_in_the_middle_bins():
    z, normals = np.zeros((9, 9)), np.tile([0.0, 0.0, 1.0], (9, 9, 1))
    descriptors = fast_point_feature_histograms(z, normals, np.ones((9, 9), dtype=bool), 1.0, 2.5)
    assert descriptors[:, MIDDLE] == pytest.approx(200.0)
    assert descriptors.sum() == pytest.approx(81 * 600.0)


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 3]))
@settings(max_examples=15, deadline=None)
def test_a_quarter_turn_of_the_floor_changes_no_descriptor(seed, quarters):
    z, normals, chosen = rough(seed)
    # rows run along y: turned by a quarter, x becomes y and y becomes -x
    turned = [np.rot90(a, -quarters) for a in (z, normals, chosen)]
    turned[1] = turned[1] @ Rotation.from_rotvec([0.0, 0.0, quarters * np.pi / 2]).as_matrix().T
    numbers = np.full(z.shape, -1)
    numbers[chosen] = np.arange(chosen.sum())
    order = np.rot90(numbers, -quarters)[turned[2]]
    before = fast_point_feature_histograms(z, normals, chosen, 1.0, 3.3)
    after = fast_point_feature_histograms(*turned, 1.0, 3.3)
    # of normals drawn at random no angle lies on the edge of a bin to sixteen digits, but two may by chance
    assert np.mean(np.abs(after - before[order]).max(axis=1) < 1e-9) > 0.95


def test_a_point_without_neighbours_has_an_empty_histogram():
    z = np.full((5, 5), np.nan)
    z[2, 2] = z[2, 4] = 0.0
    normals = np.tile([0.0, 0.0, 1.0], (5, 5, 1))
    assert not fast_point_feature_histograms(z, normals, np.isfinite(z), 1.0, 2.0).any()  # the radius itself is out
    assert fast_point_feature_histograms(z, normals, np.isfinite(z), 1.0, 2.1).any()


def test_points_straight_along_their_normal_count_as_without_angles():
    z, normals = np.zeros((1, 2)), np.tile([1.0, 0.0, 0.0], (1, 2, 1))
    descriptors = fast_point_feature_histograms(z, normals, np.ones((1, 2), dtype=bool), 1.0, 1.5)
    assert descriptors[:, MIDDLE] == pytest.approx(200.0)


def test_nothing_chosen_or_nothing_known_gives_no_descriptor():
    z, normals, chosen = rough(2)
    assert fast_point_feature_histograms(z, normals, np.zeros_like(chosen), 1.0, 3.0).shape == (0, N_BINS)
    unknown = np.full_like(z, np.nan)
    assert fast_point_feature_histograms(unknown, normals, chosen, 1.0, 3.0).shape == (0, N_BINS)


def test_inputs_are_left_as_they_were():
    given_ = rough(3)
    before = [a.copy() for a in given_]
    fast_point_feature_histograms(*given_, 1.0, 3.0)
    for a, b in zip(given_, before, strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_kernels_give_what_their_python_gives(monkeypatch):
    z = rough(4, (6, 7))[0]
    surface = Heightfield(np.where(np.isfinite(z), z, 0.0), 1.0, (0.0, 0.0))
    arguments = (surface.z, surface_normals(surface), np.isfinite(z), 1.0, 2.5)
    compiled = fast_point_feature_histograms(*arguments)
    for name in ("_bin", "_bins", "_squared_distance", "_count_pairs", "_blend"):
        kernel = getattr(module, name)
        monkeypatch.setattr(module, name, getattr(kernel, "py_func", kernel))
    np.testing.assert_allclose(fast_point_feature_histograms(*arguments), compiled, atol=1e-10)
