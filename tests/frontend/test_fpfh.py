import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frontend.fpfh import fpfh
from frontend.open3d_loader import load_open3d


def surface(rng, shape, share=1.0):
    """Heights with unrelated normals, and which cells are points."""
    normals = rng.normal(size=(*shape, 3))
    normals[..., 2] = np.abs(normals[..., 2]) + 0.1
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return rng.normal(size=shape), normals, rng.uniform(size=shape) < share


def of_open3d(z, normals, is_point, spacing, radius):
    """Open3D's descriptors of all points."""
    o3d = load_open3d()
    rows, columns = np.nonzero(is_point)
    cloud = o3d.geometry.PointCloud(
        o3d.utility.Vector3dVector(np.column_stack([spacing * columns, spacing * rows, z[is_point]]))
    )
    cloud.normals = o3d.utility.Vector3dVector(normals[is_point])
    search = o3d.geometry.KDTreeSearchParamHybrid(radius=radius, max_nn=1000)
    return np.asarray(o3d.pipelines.registration.compute_fpfh_feature(cloud, search).data).T


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.5, 2.0), st.floats(1.1, 5.0), st.floats(0.3, 1.0))
def test_descriptors_are_open3ds(seed, spacing, radius, share):
    z, normals, is_point = surface(np.random.default_rng(seed), (11, 13), share)
    ours = fpfh(z, normals, (is_point, is_point), spacing, radius)
    # rounding of sums of 200 in another order; no angle of these lies on the edge of a bin
    assert ours == pytest.approx(of_open3d(z, normals, is_point, spacing, radius), abs=1e-9)


def test_a_neighbour_at_the_very_radius_is_out_of_reach_as_for_open3d():
    z, normals, is_point = surface(np.random.default_rng(1), (7, 7))
    z[:] = 0.0
    ours = fpfh(z, normals, (is_point, is_point), 1.0, 2.0)
    assert ours == pytest.approx(of_open3d(z, normals, is_point, 1.0, 2.0), abs=1e-9)
    assert fpfh(z, normals, (is_point, is_point), 1.0, 1.0).tolist() == np.zeros((49, 33)).tolist()


def test_a_plane_falls_into_the_middle_bins():
    normals = np.zeros((9, 9, 3))
    normals[..., 2] = 1.0
    everywhere = np.ones((9, 9), dtype=bool)
    middle = np.zeros(33)
    middle[[5, 16, 27]] = 200.0  # no angle at all: half way from -1 to 1, and from -pi to pi
    descriptors = fpfh(np.zeros((9, 9)), normals, (everywhere, everywhere), 1.0, 3.0)
    assert descriptors == pytest.approx(np.tile(middle, (81, 1)))


def test_those_wanted_are_described_as_among_all():
    z, normals, is_point = surface(np.random.default_rng(4), (15, 12), 0.8)
    wanted = is_point & (np.arange(12) % 3 == 0)
    every = fpfh(z, normals, (is_point, is_point), 1.0, 3.5)
    assert np.array_equal(fpfh(z, normals, (is_point, wanted), 1.0, 3.5), every[wanted[is_point]])


def test_a_descriptor_does_not_depend_on_where_north_is():
    z, normals, is_point = surface(np.random.default_rng(5), (9, 9))
    turned = np.rot90(normals) @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    middle = np.zeros((9, 9), dtype=bool)
    middle[4, 4] = True
    first = fpfh(z, normals, (is_point, middle), 1.0, 3.5)
    assert fpfh(np.rot90(z), turned, (is_point, middle), 1.0, 3.5) == pytest.approx(first, abs=1e-9)


def test_a_point_alone_and_no_point_at_all():
    z, normals, is_point = surface(np.random.default_rng(6), (5, 5))
    alone = np.zeros((5, 5), dtype=bool)
    alone[2, 2] = True
    assert not fpfh(z, normals, (alone, alone), 1.0, 4.0).any()
    assert fpfh(z, normals, (is_point, np.zeros((5, 5), dtype=bool)), 1.0, 4.0).shape == (0, 33)


def test_a_cell_that_is_no_point_cannot_be_described():
    z, normals, is_point = surface(np.random.default_rng(7), (5, 5))
    with pytest.raises(ValueError, match="cells to describe must be points, got 25 that are none"):
        fpfh(z, normals, (np.zeros((5, 5), dtype=bool), is_point), 1.0, 4.0)
