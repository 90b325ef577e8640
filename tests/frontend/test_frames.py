"""Frames: what roll, pitch, yaw, heading and the transforms do to a vector, by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from frontend.frames import (
    attitude_from_nautical,
    attitude_from_rotation,
    heading_from_yaw,
    invert,
    level,
    planar_parameters,
    planar_pose,
    pose,
    rotation_world_body,
    transform,
    wrap_angle,
    yaw_from_heading,
)

FORWARD, PORT, UP = np.eye(3)
STARBOARD = -PORT
# A product of three rotations of doubles is exact to a few units in the last place.
EXACT = 1e-14

angles = st.floats(-10.0, 10.0)
lengths = st.floats(-1e4, 1e4)
poses = st.builds(
    lambda x, y, z, roll, pitch, yaw: pose([x, y, z], rotation_world_body(roll, pitch, yaw)),
    *[lengths] * 3,
    *[angles] * 3,
)


def test_yaw_zero_looks_east_and_a_quarter_turn_looks_north() -> None:
    np.testing.assert_allclose(rotation_world_body(0, 0, 0) @ FORWARD, [1, 0, 0], atol=EXACT)
    np.testing.assert_allclose(rotation_world_body(0, 0, np.pi / 2) @ FORWARD, [0, 1, 0], atol=EXACT)
    np.testing.assert_allclose(rotation_world_body(0, 0, np.pi / 2) @ PORT, [-1, 0, 0], atol=EXACT)


def test_positive_pitch_lowers_the_nose() -> None:
    np.testing.assert_allclose(
        rotation_world_body(0, np.radians(30), 0) @ FORWARD, [np.sqrt(3) / 2, 0, -0.5], atol=EXACT
    )


def test_positive_roll_lowers_starboard_and_lifts_port() -> None:
    R = rotation_world_body(np.radians(30), 0, 0)
    np.testing.assert_allclose(R @ STARBOARD, [0, -np.sqrt(3) / 2, -0.5], atol=EXACT)
    np.testing.assert_allclose(R @ PORT, [0, np.sqrt(3) / 2, 0.5], atol=EXACT)


@given(angles, angles, angles)
def test_a_rotation_is_yaw_after_pitch_after_roll(roll: float, pitch: float, yaw: float) -> None:
    judge = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    np.testing.assert_allclose(rotation_world_body(roll, pitch, yaw), judge, atol=EXACT)


# A pitch of a quarter turn leaves roll and yaw undetermined.
@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_attitude_comes_back_from_its_rotation(roll: float, pitch: float, yaw: float) -> None:
    again = attitude_from_rotation(rotation_world_body(roll, pitch, yaw))
    # 1 / cos(1.5) = 14 times the rounding of the matrix
    np.testing.assert_allclose(again, [roll, pitch, yaw], atol=1e-13)


def test_a_vertical_nose_has_a_pitch_and_no_nan() -> None:
    _, pitch, _ = attitude_from_rotation(rotation_world_body(0.0, np.pi / 2, 0.3))
    assert pitch == pytest.approx(np.pi / 2, abs=1e-7)  # arcsin is flat there: half the digits are left


def test_rotations_of_many_pings_are_those_of_each() -> None:
    rng = np.random.default_rng(1)
    roll, pitch, yaw = rng.uniform(-1, 1, (3, 4, 5))
    many = rotation_world_body(roll, pitch, yaw)
    assert many.shape == (4, 5, 3, 3)
    np.testing.assert_array_equal(many[2, 3], rotation_world_body(roll[2, 3], pitch[2, 3], yaw[2, 3]))
    assert rotation_world_body(0.1, pitch, 0.0).shape == (4, 5, 3, 3)


@given(poses)
def test_a_transform_and_its_inverse_cancel(T: np.ndarray) -> None:
    # rounding of coordinates of 10 km
    np.testing.assert_allclose(T @ invert(T), np.eye(4), atol=1e-11)
    np.testing.assert_allclose(invert(T) @ T, np.eye(4), atol=1e-11)


@given(poses, poses, lengths, lengths, lengths)
def test_inner_names_cancel(T_a_b: np.ndarray, T_b_c: np.ndarray, x: float, y: float, z: float) -> None:
    point_c = np.array([x, y, z])
    through = transform(T_a_b, transform(T_b_c, point_c))
    np.testing.assert_allclose(transform(T_a_b @ T_b_c, point_c), through, atol=1e-10)


def test_a_transform_takes_source_points_to_the_target() -> None:
    # the source lies 3 m east of the target and looks north: 1 m ahead of it is (3, 1)
    T_target_source = planar_pose(3.0, 0.0, np.pi / 2, z=2.0)
    np.testing.assert_allclose(transform(T_target_source, [1.0, 0.0, 0.0]), [3.0, 1.0, 2.0], atol=EXACT)


def test_points_of_any_shape_are_taken_over() -> None:
    points = np.arange(24.0).reshape(2, 4, 3)
    T = planar_pose(1.0, -2.0, 0.4)
    moved = transform(T, points)
    assert moved.shape == points.shape
    np.testing.assert_array_equal(moved[1, 2], transform(T, points[1, 2]))


def test_many_poses_invert_like_each() -> None:
    rng = np.random.default_rng(2)
    T = pose(rng.normal(size=(5, 3)), rotation_world_body(*rng.uniform(-1, 1, (3, 5))))
    np.testing.assert_allclose(T @ invert(T), np.broadcast_to(np.eye(4), (5, 4, 4)), atol=EXACT)


@given(lengths, lengths, st.floats(-3.14, 3.14))
def test_planar_parameters_come_back(x: float, y: float, yaw: float) -> None:
    assert planar_parameters(planar_pose(x, y, yaw)) == pytest.approx((x, y, yaw), abs=1e-12)


@given(poses)
def test_a_level_frame_keeps_place_and_heading_and_stands_upright(T_world_body: np.ndarray) -> None:
    T = level(T_world_body)
    np.testing.assert_array_equal(T[:3, 3], T_world_body[:3, 3])
    np.testing.assert_allclose(T[:3, 2], [0, 0, 1], atol=EXACT)
    forward = T_world_body[:2, 0] / np.linalg.norm(T_world_body[:2, 0])
    np.testing.assert_allclose(T[:2, 0], forward, atol=1e-12)


@pytest.mark.parametrize(("heading", "yaw"), [(0, 90), (90, 0), (180, -90), (270, -180), (45, 45), (360, 90)])
def test_headings_of_the_compass_rose(heading: float, yaw: float) -> None:
    assert np.degrees(yaw_from_heading(np.radians(heading))) == pytest.approx(yaw, abs=1e-12)


@given(st.floats(0.0, 6.283))
def test_a_heading_comes_back_from_its_yaw(heading: float) -> None:
    error = wrap_angle(heading_from_yaw(yaw_from_heading(heading)) - heading)
    assert abs(error) < 1e-14


@given(st.floats(-1e3, 1e3))
def test_wrapped_angles_are_the_same_direction(angle: float) -> None:
    wrapped = float(wrap_angle(angle))
    assert -np.pi <= wrapped < np.pi
    # rounding of an angle of 1000
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-12)


def test_half_a_turn_is_minus_half_a_turn() -> None:
    assert wrap_angle(np.pi) == -np.pi


def test_a_nautical_nose_up_lifts_the_nose() -> None:
    roll, pitch, yaw = attitude_from_nautical(0.0, np.radians(10), np.radians(90))
    assert (rotation_world_body(roll, pitch, yaw) @ FORWARD)[2] == pytest.approx(np.sin(np.radians(10)))


def test_a_nautical_starboard_roll_lowers_the_starboard_transducer() -> None:
    roll, pitch, yaw = attitude_from_nautical(np.radians(10), 0.0, 0.0)
    T_world_body = pose([0.0, 0.0, -20.0], rotation_world_body(roll, pitch, yaw))
    # half a metre to starboard of a vehicle that heads north: east of it, and lower
    east, north, up = transform(T_world_body, 0.5 * STARBOARD)
    assert (east, north) == pytest.approx((0.5 * np.cos(np.radians(10)), 0.0))
    assert up == pytest.approx(-20.0 - 0.5 * np.sin(np.radians(10)))


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(0.0, 6.28))
def test_nautical_angles_are_the_rotation_of_ned_and_starboard_down_axes(roll: float, pitch: float, h: float) -> None:
    ned_from_frd = Rotation.from_euler("ZYX", [h, pitch, roll]).as_matrix()
    enu_from_ned = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    frd_from_flu = np.diag([1, -1, -1])
    judge = enu_from_ned @ ned_from_frd @ frd_from_flu
    np.testing.assert_allclose(rotation_world_body(*attitude_from_nautical(roll, pitch, h)), judge, atol=EXACT)


def test_inputs_are_not_changed() -> None:
    roll = np.array([0.1, 0.2])
    attitude_from_nautical(roll, roll, roll)[0][0] = 9.0
    wrap_angle(roll)
    np.testing.assert_array_equal(roll, [0.1, 0.2])
