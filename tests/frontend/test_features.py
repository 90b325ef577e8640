from dataclasses import replace

import numpy as np
import pytest

from frontend.features import FeatureConfig, Features, describe, describe_relief, find_keypoints
from frontend.frames import invert, planar_pose, transform
from frontend.heightfield import Heightfield
from frontend.open3d_loader import load_open3d
from frontend.relief import extract_relief
from frontend.submaps import surface_normals
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor


def rough_submap(seed=0, error=0.03, pose=(150.0, 150.0, 0.3)):
    rng = np.random.default_rng(seed)
    return cut_submap(rough_seafloor(rng), pose, rng, error=error)


def test_descriptors_are_three_histograms_that_sum_to_two_hundred_each():
    features = describe(rough_submap())
    assert len(features) > 100
    assert features.descriptors.shape == (len(features), 33)
    assert features.keypoints.shape == features.normals.shape == (len(features), 3)
    assert features.descriptors.reshape(-1, 3, 11).sum(axis=2) == pytest.approx(200.0, abs=1e-6)


def test_descriptors_are_open3ds_of_the_exaggerated_relief():
    """All cells as support and all of open3d's own points: the values are its own."""
    submap, config = rough_submap(), FeatureConfig(lattice=1.0)
    relief, features = extract_relief(submap), describe(submap, config)
    surface = Heightfield(np.where(relief.is_trusted, 4.0 * relief.z, np.nan), 1.0, relief.origin)
    x, y = np.meshgrid(surface.x, surface.y)
    o3d = load_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.stack([x, y, surface.z], -1)[relief.is_trusted]))
    cloud.normals = o3d.utility.Vector3dVector(surface_normals(surface)[relief.is_trusted])
    search = o3d.geometry.KDTreeSearchParamHybrid(radius=8.0, max_nn=300)
    everything = np.asarray(o3d.pipelines.registration.compute_fpfh_feature(cloud, search).data).T
    points = np.asarray(cloud.points)[:, :2]
    rows = [int(np.flatnonzero((points == keypoint[:2]).all(axis=1))[0]) for keypoint in features.keypoints[:40]]
    assert features.descriptors[:40] == pytest.approx(everything[rows], abs=1e-9)


def test_two_radii_stand_side_by_side_as_each_alone():
    submap = rough_submap()
    both = describe(submap, FeatureConfig(radius=8.0, wide_radius=16.0)).descriptors
    alone = [describe(submap, FeatureConfig(radius=radius)).descriptors for radius in (8.0, 16.0)]
    np.testing.assert_array_equal(both, np.concatenate(alone, axis=1))


def test_crests_of_ripples_look_alike_and_are_left_out_where_a_lone_boulder_is_not():
    y, x = np.mgrid[-40.0:41.0, -40.0:41.0]
    ripples = 0.3 * np.sin(2 * np.pi * x / 10.0)
    boulder = 1.5 * np.exp(-((x - 5.0) ** 2 + (y - 8.0) ** 2) / 8.0)
    noise = np.random.default_rng(2).normal(0, 0.01, x.shape)
    submap = rough_submap()
    surface = Heightfield(ripples + boulder + noise, 1.0, (-40.0, -40.0))
    flat = np.zeros(x.shape)
    submap = replace(submap, surface=surface, sigma=flat + 0.05, log_reflectivity=flat, is_shadow=flat > 0)
    every, distinct = describe(submap), describe(submap, FeatureConfig(least_distinct=0.3))
    assert len(distinct) < 0.7 * len(every)
    near = np.hypot(*(distinct.keypoints[:, :2] - [5.0, 8.0]).T)
    assert near.min() < 3.0


def test_describing_twice_gives_the_same_bytes_whatever_the_threads():
    submap, o3d = rough_submap(), load_open3d()
    first, n_threads = describe(submap), o3d.utility.get_max_threads()
    o3d.utility.set_max_threads(1)
    second = describe(submap)
    o3d.utility.set_max_threads(n_threads)
    assert first.descriptors.tobytes() == second.descriptors.tobytes()
    assert first.keypoints.tobytes() == second.keypoints.tobytes()


def test_keypoints_lie_on_the_reconstructed_surface():
    submap = rough_submap()
    keypoints = describe(submap).keypoints
    assert submap.surface.sample(keypoints[:, 0], keypoints[:, 1]) == pytest.approx(keypoints[:, 2])


@pytest.mark.parametrize("turn", [0.0, 0.7, np.pi / 2, np.pi])
def test_keypoints_repeat_across_headings(turn):
    rng = np.random.default_rng(1)
    seafloor = rough_seafloor(rng)
    T = planar_pose(150.0, 150.0, 0.1) @ planar_pose(3.0, 2.0, turn)
    a = cut_submap(seafloor, (150.0, 150.0, 0.1), rng, error=0.02)
    b = cut_submap(seafloor, (T[0, 3], T[1, 3], 0.1 + turn), rng, error=0.02)
    in_a = transform(invert(planar_pose(150.0, 150.0, 0.1)) @ T, describe(b).keypoints)
    inside = (np.abs(in_a[:, 0]) < 30) & (np.abs(in_a[:, 1]) < 30)
    gaps = np.hypot(*(describe(a).keypoints[:, None, :2] - in_a[None, inside, :2]).transpose(2, 0, 1)).min(axis=0)
    # by chance, 500 keypoints on 8000 m^2 have one within 1.5 m of 36 % of all places
    assert np.mean(gaps < 1.5) > 0.6


def test_shadowed_unknown_and_uncertain_cells_hold_no_keypoint():
    submap = rough_submap()
    shadow, sigma, z = submap.is_shadow.copy(), submap.sigma.copy(), submap.surface.z.copy()
    shadow[20:40, 20:40], sigma[50:70, 20:40], z[20:40, 50:70] = True, 1.0, np.nan
    x, y = np.meshgrid(submap.surface.x, submap.surface.y)
    left_out = shadow | (sigma == 1.0) | np.isnan(z)
    hidden = {(a, b) for a, b in zip(x[left_out], y[left_out], strict=True)}
    features = describe(replace(submap, is_shadow=shadow, sigma=sigma, surface=replace(submap.surface, z=z)))
    assert not hidden & {(a, b) for a, b in features.keypoints[:, :2]}
    assert len(features) > 50


@pytest.mark.parametrize("known", [0, 20])
def test_a_submap_with_next_to_nothing_known_has_no_features(known):
    submap = rough_submap()
    z = np.full_like(submap.surface.z, np.nan)
    z.flat[:known] = submap.surface.z.flat[:known]
    features = describe(replace(submap, surface=replace(submap.surface, z=z)))
    assert len(features) == 0
    assert features.descriptors.shape == (0, 33)


def test_a_flat_submap_has_no_features():
    submap = rough_submap()
    flat = replace(submap, surface=replace(submap.surface, z=np.full_like(submap.surface.z, -12.0)))
    assert len(describe(flat)) == 0


def test_keypoints_are_crests_and_hollows_apart_from_stronger_ones():
    z = np.zeros((30, 30))
    z[10, 10], z[10, 13], z[20, 20], z[20, 22] = 1.0, 0.8, -1.0, 0.5
    usable = np.ones_like(z, dtype=bool)
    assert set(zip(*np.nonzero(find_keypoints(z, usable, 2.0)), strict=True)) == {
        (10, 10),
        (10, 13),
        (20, 20),
        (20, 22),
    }
    assert set(zip(*np.nonzero(find_keypoints(z, usable, 3.0)), strict=True)) == {(10, 10), (20, 20), (20, 22)}


def test_keypoints_do_not_depend_on_the_axes_of_the_grid():
    z = extract_relief(rough_submap()).z
    usable = np.ones_like(z, dtype=bool)
    turned = np.rot90(find_keypoints(np.rot90(z), np.rot90(usable), 3.0), -1)
    assert np.array_equal(find_keypoints(z, usable, 3.0), turned)


def test_a_cell_that_does_not_count_is_neither_keypoint_nor_rival():
    z = np.zeros((20, 20))
    z[10, 10], z[10, 11] = 1.0, 2.0
    usable = np.ones_like(z, dtype=bool)
    usable[10, 11] = False
    assert set(zip(*np.nonzero(find_keypoints(z, usable, 3.0)), strict=True)) == {(10, 10)}


def test_a_coarse_grid_still_has_a_neighbourhood():
    submap = rough_submap()
    coarse = replace(submap, surface=Heightfield(submap.surface.z, 5.0, (-200.0, -250.0)))
    features = describe(coarse)
    assert len(features) > 50
    assert features.descriptors.sum(axis=1) == pytest.approx(600.0, abs=1e-6)


def test_features_know_their_number():
    assert len(Features(np.zeros((3, 3)), np.zeros((3, 33)), np.zeros((3, 3)))) == 3


def test_describing_a_relief_is_describing_its_submap():
    submap = rough_submap()
    assert np.array_equal(describe_relief(extract_relief(submap)).descriptors, describe(submap).descriptors)
