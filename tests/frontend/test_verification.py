import numpy as np
import pytest

from frontend.frames import invert, planar_parameters, planar_pose
from frontend.overlap import stack_layers
from frontend.relief import Relief, extract_relief
from frontend.verification import joint_area, preview, significance_at, verify
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor

RELATIVE = (10.0, -15.0, 0.6)


def layers(seed, relative=RELATIVE, error=0.06):
    rng = np.random.default_rng(seed)
    seafloor = rough_seafloor(rng)
    start = planar_pose(150.0, 150.0, 0.2)
    poses = (planar_parameters(start), planar_parameters(start @ planar_pose(*relative)))
    return [stack_layers(extract_relief(cut_submap(seafloor, p, rng, k, error))) for k, p in enumerate(poses)]


def test_the_true_place_is_far_above_chance_and_its_reflectivity_agrees():
    v = verify(*layers(0), planar_pose(10.7, -14.4, 0.62))
    x, y, yaw = planar_parameters(invert(planar_pose(*RELATIVE)) @ v.T_target_source)
    assert np.hypot(x, y) < 0.6
    assert abs(yaw) < 0.015
    assert v.significance > 6
    assert v.correlation > 0.4
    assert v.reflectivity_significance > 3
    assert 0.5 < v.overlap < 0.9
    assert v.height_residual < 2


def test_a_wrong_place_is_what_chance_gives():
    v = verify(*layers(0), planar_pose(-10.0, 5.0, 0.6))
    assert v.significance < 4
    assert v.reflectivity_significance < 3
    assert v.height_residual > 2


def test_relief_and_reflectivity_of_unrelated_floors_stay_within_chance():
    values = []
    for seed in range(6):
        target, _ = layers(seed)
        _, source = layers(seed + 50)
        v = verify(target, source, planar_pose(*RELATIVE))
        values.append((v.significance, v.reflectivity_significance))
    # the refinement climbs the nearest hill: up to two standard deviations above a plain draw of six
    assert np.abs(values).max() < 4.5


def test_no_overlap_says_so():
    v = verify(*layers(0), planar_pose(300.0, 0.0, 0.0))
    assert v.overlap == 0
    assert v.correlation == 0
    assert v.significance == 0
    assert np.isinf(v.sigmas[3])


def test_the_joint_area_is_the_geometric_mean():
    target, source = (part.relief for part in layers(1))
    assert joint_area(target, source) == pytest.approx(np.sqrt(target.correlation_area * source.correlation_area))


def test_swapping_the_submaps_inverts_the_transform():
    target, source = layers(2)
    forward = verify(target, source, planar_pose(*RELATIVE))
    backward = verify(source, target, invert(planar_pose(*RELATIVE)))
    x, y, yaw = planar_parameters(forward.T_target_source @ backward.T_target_source)
    assert np.hypot(x, y) < 3 * np.hypot(*forward.sigmas[3:5])
    assert abs(yaw) < 3 * forward.sigmas[2]


def test_areas_are_those_of_the_overlap_and_of_the_relief():
    target, source = layers(3)
    v = verify(target, source, planar_pose(*RELATIVE))
    smaller = min(target.relief.area, source.relief.area)
    assert v.overlap_area == pytest.approx(v.overlap * smaller)
    assert v.correlation_area == joint_area(target.relief, source.relief)


def test_a_preview_comes_to_rest_near_the_refined_place_and_is_as_significant():
    target, source = layers(0)
    start = planar_pose(10.7, -14.4, 0.62)
    rough, fine = preview(target, source, start), verify(target, source, start)
    x, y, yaw = planar_parameters(invert(fine.T_target_source) @ rough.T_target_source)
    assert np.hypot(x, y) < 0.5  # half a cell
    assert abs(yaw) < 0.01
    assert rough.significance == pytest.approx(fine.level, rel=0.1)


def test_boulders_that_coincide_are_worth_half_of_what_the_area_of_their_floor_says():
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:80, 0:80].astype(float)
    boulders = sum(3 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / 4) for u, v in ((20, 30), (55, 25), (40, 60)))
    a, b = (
        stack_layers(Relief(z, np.ones_like(z), 0 * z, z, np.ones_like(z), 1.0, (0.0, 0.0)))
        for z in boulders + rng.normal(0, 0.2, (2, 80, 80))
    )
    v = verify(a, b, planar_pose(0.0, 0.0, 0.0))
    by_area = np.arctanh(v.correlation) * np.sqrt(v.overlap_area / joint_area(a.relief, b.relief) - 3)
    assert by_area > 15  # unrelated floors but for three boulders of some ten cells each
    assert v.significance < 0.6 * by_area
    assert significance_at(a, b, v.T_target_source) == pytest.approx((v.level, v.overlap_area))
