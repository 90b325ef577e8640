"""Slant range to seafloor, by triangles and against rays walked by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.frames import pose, rotation_world_body
from frontend.geometry import (
    PORT,
    STARBOARD,
    altitude_from_first_return,
    extended_ground_range,
    first_ray_angle,
    first_usable_return,
    off_nadir_angle,
    slant_to_ground_range,
    transducer_positions,
)
from frontend.recording import SonarGeometry
from tests.frontend.slant_equation import extended_slant_range

altitudes, small_angles = st.floats(1.0, 100.0), st.floats(-0.3, 0.3)
off_vertical = st.floats(0.0, 1.2)
_NEARLY_LEVEL = 1.5  # rad off the vertical; a ray beyond the horizon meets no floor


def test_a_three_four_five_triangle() -> None:
    np.testing.assert_allclose(slant_to_ground_range([5.0, 13.0], [3.0, 5.0]), [[4, np.sqrt(160)], [0, 12]])


def test_the_water_column_has_no_ground_range() -> None:
    assert np.isnan(slant_to_ground_range([2.0], [3.0])).all()


@given(altitudes, st.floats(0.0, 200.0))
def test_the_ground_range_behind_a_slant_range_comes_back(altitude: float, ground_range: float) -> None:
    slant_range = np.hypot(ground_range, altitude) * (1 + 1e-15)
    # near nadir the square root doubles the relative rounding and loses half the digits
    assert slant_to_ground_range([slant_range], [altitude])[0, 0] == pytest.approx(ground_range, abs=1e-4)


def test_pitch_lengthens_the_way_to_the_floor() -> None:
    # at 60 degrees of pitch a beam plane 3 m up meets the floor 6 m away; 10 m of slant range are 8 m across
    assert slant_to_ground_range([10.0], [3.0], [np.radians(60)])[0, 0] == pytest.approx(8.0)


@pytest.mark.parametrize("altitude", [0.0, -1.0, np.nan])
def test_an_altitude_that_is_not_positive_is_refused(altitude: float) -> None:
    with pytest.raises(ValueError, match="altitude must be positive, got"):
        slant_to_ground_range([5.0], [altitude])


def test_transducers_sit_at_the_end_of_their_arms() -> None:
    sonar = SonarGeometry(lever_arm_port=(1.0, 0.2, -0.1), lever_arm_starboard=(1.0, -0.2, -0.1))
    # a vehicle at (10, 20) that heads north: ahead is y, port is -x
    position = transducer_positions(pose([[10.0, 20.0, -5.0]], rotation_world_body(0, 0, [np.pi / 2])), sonar)
    assert position.shape == (1, 2, 3)
    np.testing.assert_allclose(position[0, PORT], [9.8, 21.0, -5.1])
    np.testing.assert_allclose(position[0, STARBOARD], [10.2, 21.0, -5.1])


def test_a_starboard_roll_lowers_the_starboard_transducer() -> None:
    sonar = SonarGeometry(lever_arm_port=(0.0, 0.2, 0.0), lever_arm_starboard=(0.0, -0.2, 0.0))
    position = transducer_positions(pose([[0.0, 0.0, 0.0]], rotation_world_body([0.1], 0, 0)), sonar)
    assert position[0, STARBOARD, 2] == pytest.approx(-0.2 * np.sin(0.1))
    assert position[0, PORT, 2] == pytest.approx(0.2 * np.sin(0.1))


def _ray(roll: float, pitch: float, angle: float, side: int) -> np.ndarray:
    """World direction of a ray at some angle off the body's nadir, outwards to a side."""
    outwards = 1.0 if side == PORT else -1.0
    body = np.array([0.0, outwards * np.sin(angle), -np.cos(angle)])
    return np.asarray(rotation_world_body(roll, pitch, 0.0) @ body)


@given(altitudes, small_angles, small_angles, off_vertical, st.sampled_from([PORT, STARBOARD]))
def test_a_ray_walked_to_the_floor_has_the_angle_of_its_range(
    altitude: float, roll: float, pitch: float, vertical: float, side: int
) -> None:
    # outwards of the lowest point of the beam plane, which the roll shifts off the body's nadir
    angle = vertical - roll if side == PORT else vertical + roll
    direction = _ray(roll, pitch, angle, side)
    slant_range = -altitude / direction[2]
    found = off_nadir_angle([slant_range * (1 + 1e-15)], [altitude], ([roll], [pitch]))[0, side, 0]
    # arccos near 1: half the digits
    assert found == pytest.approx(angle, abs=2e-7)


@given(altitudes, small_angles, small_angles, st.floats(-1.0, 1.0))
def test_slant_range_is_altitude_over_the_cosines_of_pitch_and_angle_less_roll(
    altitude: float, roll: float, pitch: float, t: float
) -> None:
    # r = h / (cos(pitch) cos(t - roll)), t off the body's nadir, positive to starboard
    slant_range = altitude / (np.cos(pitch) * np.cos(t - roll))
    assert slant_range == pytest.approx(-altitude / _ray(roll, pitch, t, STARBOARD)[2])
    across = slant_to_ground_range([slant_range * (1 + 1e-15)], [altitude], [pitch])[0, 0]
    y = slant_range * _ray(roll, pitch, t, STARBOARD)[1]
    assert across == pytest.approx(abs(y), abs=1e-5 * altitude)


def test_the_water_column_has_no_angle() -> None:
    assert np.isnan(off_nadir_angle([2.0], [3.0], ([0.0], [0.0]))).all()


def test_level_sides_see_the_same_angle() -> None:
    angle = off_nadir_angle([6.0], [3.0], ([0.0], [0.0]))
    np.testing.assert_allclose(angle, np.pi / 3)
    assert angle.shape == (1, 2, 1)


def _once(angle: float, roll: float, inner: float, side: int) -> bool:
    """Whether a ray of a side, some angle off the body's nadir, meets the floor where no other ray of the beam does."""
    vertical = angle + roll if side == PORT else angle - roll
    edge = inner + roll if side == PORT else inner - roll
    return 0 < vertical < _NEARLY_LEVEL and (edge >= 0 or vertical > -edge)


@given(
    altitudes, small_angles, small_angles, st.floats(0.0, 0.5), st.floats(0.0, 1.0), st.sampled_from([PORT, STARBOARD])
)
def test_equation_four_finds_the_foot_of_a_ray_walked_under_roll_and_pitch(
    altitude: float, roll: float, pitch: float, inner: float, beyond: float, side: int
) -> None:
    angle = inner + beyond
    direction = _ray(roll, pitch, angle, side)
    slant_range = -altitude / direction[2]
    b = first_usable_return([altitude], ([roll], [pitch]), inner)
    found = extended_ground_range([slant_range * (1 + 1e-15)], b, [roll], inner)[0, side, 0]
    if not _once(angle, roll, inner, side):
        return
    y = slant_range * direction[1] * (1 if side == PORT else -1)
    if slant_range < b[0, side]:  # the very first ray, to rounding
        assert slant_range == pytest.approx(b[0, side], rel=1e-12)
        return
    # near nadir the square root doubles the relative rounding and loses half the digits
    assert found == pytest.approx(y, abs=1e-6 * altitude + 1e-12)


@given(altitudes, small_angles, small_angles, st.floats(0.0, 0.5), st.floats(0.01, 100.0))
def test_equation_three_is_the_inverse_of_equation_four(
    altitude: float, roll: float, pitch: float, inner: float, beyond: float
) -> None:
    b = first_usable_return([altitude], ([roll], [pitch]), inner)
    ground_range = (b * np.sin(first_ray_angle([roll], inner)) + beyond)[:, :, None]
    slant_range = extended_slant_range(ground_range, b, [roll], inner)
    for side in (PORT, STARBOARD):
        back = extended_ground_range(slant_range[:, side], b, [roll], inner)[:, side]
        np.testing.assert_allclose(back, ground_range[:, side], rtol=1e-7)


@given(altitudes, small_angles, small_angles, st.floats(0.0, 0.5))
def test_the_altitude_behind_the_first_returns_comes_back_on_both_sides(
    altitude: float, roll: float, pitch: float, inner: float
) -> None:
    b = first_usable_return([altitude], ([roll], [pitch]), inner)
    np.testing.assert_allclose(altitude_from_first_return(b, ([roll], [pitch]), inner), altitude, rtol=1e-12)


def test_the_side_rolled_outward_has_its_own_first_return() -> None:
    # 20 m up, inner edge 15 degrees, 10 degrees of roll: the beam edges stand 25 and 5 degrees off the vertical
    b = first_usable_return([20.0], ([np.radians(10)], [0.0]), np.radians(15))
    np.testing.assert_allclose(b, [[20 / np.cos(np.radians(25)), 20 / np.cos(np.radians(5))]])


def test_what_falls_on_its_mirror_image_about_nadir_is_left_out() -> None:
    # 10 m up, edge at nadir, 0.2 rad starboard down: starboard sees 10 tan(0.2) = 2.03 m past nadir
    b = first_usable_return([10.0], ([0.2], [0.0]), 0.0)
    just_inside, just_beyond = np.hypot(10.0, [2.0, 2.1])
    found = extended_ground_range([just_inside, just_beyond], b, [0.2], 0.0)[0, STARBOARD]
    assert np.isnan(found[0])
    assert found[1] == pytest.approx(2.1)


def test_nearer_than_the_first_ray_there_is_no_slant_range() -> None:
    b = first_usable_return([10.0], ([0.0], [0.0]), 0.3)
    found = extended_slant_range([1.0, 10.0 * np.tan(0.3) + 1.0], b, [0.0], 0.3)[0, PORT]
    assert np.isnan(found[0])
    assert found[1] == pytest.approx(np.hypot(10.0, 10.0 * np.tan(0.3) + 1.0))


def test_a_first_return_that_is_not_positive_is_refused() -> None:
    with pytest.raises(ValueError, match=r"first return must be positive, got 0\.0 m"):
        extended_ground_range([5.0], [[0.0, 1.0]], [0.0], 0.1)
