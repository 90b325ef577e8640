from dataclasses import replace

import numpy as np
import pytest

from backend.drift_model import DeadReckoningConfig
from frontend import registration as module
from frontend.frames import invert, planar_parameters, planar_pose
from frontend.overlap import lay_over, stack_layers
from frontend.registration import RegistrationConfig, register
from frontend.relief import Relief, extract_relief
from frontend.sampling import normal_equations
from tests.frontend.seafloor_scenes import Seafloor, cut_submap, rough_seafloor

TARGET = (150.0, 150.0, 0.4)
# nothing added to what residuals say
BARE = RegistrationConfig(sigma_factor=1.0, sigma_factor_yaw=1.0, min_sigma=0.0, min_sigma_yaw=0.0)


def two_passes(seed, relative, error=0.05, seafloor=None):
    rng = np.random.default_rng(seed)
    seafloor = seafloor or rough_seafloor(rng)
    a = cut_submap(seafloor, TARGET, rng, 0, error)
    b = cut_submap(seafloor, planar_parameters(planar_pose(*TARGET) @ planar_pose(*relative)), rng, 1, error)
    return a, b


def layers_of(submap):
    return stack_layers(extract_relief(submap))


def error_of(T_target_source, relative):
    x, y, yaw = planar_parameters(invert(planar_pose(*relative)) @ T_target_source)
    return np.hypot(x, y), abs(yaw)


@pytest.mark.parametrize("turn", [0.0, 0.5, np.pi / 2, np.pi])
def test_a_start_a_cell_and_two_degrees_off_comes_back_to_the_truth(turn):
    relative = (6.0, -9.0, turn)
    a, b = two_passes(1, relative, error=0.02)
    start = planar_pose(6.8, -8.4, turn + 0.03)
    shift, yaw = error_of(register(layers_of(a), layers_of(b), start).T_target_source, relative)
    # heights in error by 0.02 m over slopes of 0.1 and some hundred independent places leave centimetres
    assert shift < 0.1
    assert yaw < 0.004


def test_errors_are_as_large_as_the_sigmas_say():
    """Mean squared error over variance of x, y and yaw for passes of different headings, 3 degrees of freedom each."""
    squares = []
    for seed in range(16):
        relative = (5.0, 8.0, [0.0, 0.8, np.pi / 2, np.pi][seed % 4])
        a, b = two_passes(seed, relative, error=0.06)
        registration = register(layers_of(a), layers_of(b), planar_pose(5.5, 8.5, relative[2] + 0.01), BARE)
        x, y, yaw = planar_parameters(registration.T_target_source)
        error = np.array([x - 5.0, y - 8.0, np.angle(np.exp(1j * (yaw - relative[2])))])
        squares.append(np.mean((error / registration.sigmas[[3, 4, 2]]) ** 2))
    # chi-square of 48 degrees of freedom over 48 lies within 0.5 and 1.7 with 99.8 %; these passes lack the drift
    # inside windows of real dives, for which the default sigmas are wider
    assert 0.5 < np.mean(squares) < 1.7


def test_the_factors_widen_sigmas_before_their_floors_the_yaw_by_its_own():
    relative = (5.0, 8.0, 0.8)
    layers = [layers_of(s) for s in two_passes(2, relative)]
    start, config = planar_pose(*relative), RegistrationConfig(sigma_factor=3.0, sigma_factor_yaw=2.0)
    bare = register(*layers, start, BARE).sigmas[2:5]
    floors = np.array([config.min_sigma_yaw, config.min_sigma, config.min_sigma])
    expected = np.hypot([2.0, 3.0, 3.0] * bare, floors)
    assert register(*layers, start, config).sigmas[2:5] == pytest.approx(expected, rel=1e-12)


def test_noise_makes_the_sigmas_grow():
    relative = (5.0, 8.0, 0.8)
    low, high = (
        register(*(layers_of(s) for s in two_passes(2, relative, error)), planar_pose(*relative)).sigmas
        for error in (0.02, 0.15)
    )
    assert (high[2:5] > 1.2 * low[2:5]).all()


def test_a_valley_fixes_the_place_across_but_not_along():
    """Ridges along the world's x, seen by two passes along x: nothing says how far along."""
    rng = np.random.default_rng(0)
    ridges = Seafloor(np.tile(rough_seafloor(rng).z[:, 150:151], (1, 300)), np.zeros((300, 300)))
    a, b = (cut_submap(ridges, pose, rng, error=0.02) for pose in ((150.0, 150.0, 0.0), (154.0, 156.0, 0.0)))
    sigmas = register(layers_of(a), layers_of(b), planar_pose(4.0, 6.0, 0.0)).sigmas
    assert sigmas[3] > 5 * sigmas[4]


def test_the_normal_equations_are_those_of_numpy():
    relative = (5.0, 8.0, 0.8)
    a, b = (layers_of(s) for s in two_passes(2, relative))
    overlap, config = lay_over(a, b, relative), RegistrationConfig()
    (J, J_source), weight = module._jacobians(overlap, 0.8), module._weights(overlap, config)
    frame = (*a.relief.origin, a.relief.spacing)
    H, H_common, g = normal_equations(a.shape, b.shape_cells, frame, relative, config.tuning)
    assert pytest.approx(J.T @ (weight[:, None] * J), rel=1e-9) == H
    assert pytest.approx(J.T @ (weight[:, None] * J_source), rel=1e-9) == H_common
    assert pytest.approx(J.T @ (weight * (overlap.z_source - overlap.z_target)), rel=1e-9) == g


def test_the_jacobian_is_the_change_of_the_target_with_the_pose():
    """On a tilted plane the bilinear samples are exact, so differences over a step are the derivative."""
    z, ones = np.add.outer(0.1 * np.arange(30.0), 0.2 * np.arange(30.0)), np.ones((30, 30))
    plane = Relief(z, ones, z, z, ones, 1.0, (0.0, 0.0))
    a, b, pose, step = stack_layers(plane), stack_layers(plane), np.array([3.0, -2.0, 0.1]), 1e-6
    overlap = lay_over(a, b, tuple(pose))
    (J, _) = module._jacobians(overlap, pose[2])
    for k in range(3):
        moved = lay_over(a, b, tuple(pose + step * np.eye(3)[k]))
        assert len(moved.x) == len(overlap.x)
        assert (moved.z_target - overlap.z_target) / step == pytest.approx(
            J[:, k], abs=1e-4
        )  # second order: half a step


def test_offset_and_tilt_between_the_heights_are_found():
    a, _ = two_passes(4, (0.0, 0.0, 0.0), error=0.02)
    z = a.surface.z - 1.5 + 0.01 * a.surface.x[None, :] - 0.005 * a.surface.y[:, None]
    b = replace(a, surface=replace(a.surface, z=z))
    registration = register(layers_of(a), layers_of(b), np.eye(4))
    assert registration.T_target_source[2, 3] == pytest.approx(1.5, abs=1e-3)
    # the prior on the tilt draws it in by a little
    assert registration.tilt == pytest.approx([-0.01, 0.005], abs=1e-4)
    assert registration.height_residual < 0.01


def test_heights_in_error_by_their_sigmas_leave_a_residual_of_one():
    a, b = two_passes(5, (5.0, 5.0, np.pi), error=0.1)
    assert register(layers_of(a), layers_of(b), planar_pose(5.0, 5.0, np.pi)).height_residual == pytest.approx(
        1, abs=0.3
    )


def test_another_place_leaves_a_larger_residual():
    rng = np.random.default_rng(6)
    seafloor = rough_seafloor(rng)
    a, b = (cut_submap(seafloor, pose, rng, error=0.05) for pose in ((90.0, 90.0, 0.0), (210.0, 210.0, 0.0)))
    assert register(layers_of(a), layers_of(b), np.eye(4)).height_residual > 2


def test_no_step_is_longer_than_its_limit():
    a, b = two_passes(7, (5.0, 5.0, 0.0))
    config = RegistrationConfig(n_iterations=1, max_step=0.25, max_turn=0.001)
    start = planar_pose(9.0, 5.0, 0.05)
    x, y, yaw = planar_parameters(register(layers_of(a), layers_of(b), start, config).T_target_source)
    assert np.hypot(x - 9.0, y - 5.0) <= 0.25 + 1e-9
    assert abs(yaw - 0.05) <= 0.001 + 1e-12


def test_submaps_that_do_not_meet_stay_where_they_are_with_infinite_sigmas():
    a, b = two_passes(8, (5.0, 5.0, 0.0))
    start = planar_pose(500.0, 0.0, 0.3)
    registration = register(layers_of(a), layers_of(b), start)
    assert registration.T_target_source == pytest.approx(start)
    assert np.isinf(registration.sigmas[2:5]).all()
    assert np.isnan(registration.height_residual)


def test_flat_floor_fixes_nothing():
    flat = Seafloor(np.zeros((300, 300)), np.zeros((300, 300)))
    a, b = two_passes(9, (5.0, 5.0, 0.0), error=0.0, seafloor=flat)
    start = planar_pose(5.0, 5.0, 0.0)
    registration = register(layers_of(a), layers_of(b), start)
    assert registration.T_target_source[:2] == pytest.approx(start[:2])
    assert np.isinf(registration.sigmas[3:5]).all()


def test_the_transform_is_level():
    a, b = two_passes(10, (5.0, 5.0, 1.0))
    T = register(layers_of(a), layers_of(b), planar_pose(5.2, 5.0, 1.0)).T_target_source
    assert T[2, :3].tolist() == [0, 0, 1]
    assert T[:2, 2].tolist() == [0, 0]


def test_windows_shear_by_a_usual_mounting_where_nobody_says_how_much():
    shears = [RegistrationConfig(misalignment=m).shear for m in (None, 0.0, 0.002)]
    assert shears == [DeadReckoningConfig().velocity_misalignment_sd, 0.0, 0.002]
