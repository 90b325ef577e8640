"""Lines over a flat floor: where they lie, by triangles."""

import numpy as np
import pytest

from frontend.geometry import first_usable_return
from frontend.reconstruction.lines import frame_lines, with_heave
from tests.frontend.reconstruction.small_lines import ALTITUDE, ATTITUDES, make_window, rough
from tests.frontend.slant_equation import extended_slant_range


@pytest.mark.parametrize(("roll", "pitch"), ATTITUDES)
def test_a_flat_floor_is_flat_in_space_whatever_the_attitude(roll: float, pitch: float) -> None:
    data = make_window(roll=roll, pitch=pitch, turn=0.05)
    frames = frame_lines(data, 1.0)
    points = frames.points(np.zeros(frames.shape))
    np.testing.assert_allclose(points[..., 2], -ALTITUDE, atol=1e-9)


@pytest.mark.parametrize(("roll", "pitch"), ATTITUDES)
def test_flat_cells_are_as_far_as_equation_three_has_it_on_both_sides(roll: float, pitch: float) -> None:
    data = make_window(roll=roll, pitch=pitch)
    frames = frame_lines(data, 1.0)
    distance = np.linalg.norm(frames.points(np.zeros(frames.shape)) - frames.sensor[:, None], axis=2)
    b = first_usable_return(np.full(len(distance), ALTITUDE), (frames.roll, frames.pitch), 0.2)
    expected = extended_slant_range(np.abs(frames.cell), b, frames.roll, 0.2)[
        :, frames.side, np.arange(len(frames.cell))
    ]
    beyond = np.isfinite(expected)
    assert beyond.mean() > 0.8
    np.testing.assert_allclose(distance[beyond], expected[beyond], rtol=1e-9)


def test_a_nose_down_vehicle_looks_behind_itself() -> None:
    frames = frame_lines(make_window(pitch=0.2), 1.0)
    shift = frames.points(np.zeros(frames.shape))[..., 0] - frames.sensor[:, None, 0]
    # equation 2: f sin(pitch), with f = h / cos(pitch)
    np.testing.assert_allclose(shift, -ALTITUDE * np.tan(0.2), rtol=1e-9)


def test_a_turn_fans_the_lines_out() -> None:
    data = make_window(turn=0.1)
    frames = frame_lines(data, 0.5)
    points = frames.points(np.zeros(frames.shape))
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=0)
    # a port turn on a radius of 5 m: half a metre at the track, 3 at 25 m to starboard, nothing at the centre
    np.testing.assert_allclose(steps, 0.1 * np.abs(frames.cell - 5.0), atol=0.06)


def test_relief_is_the_height_of_points() -> None:
    frames = frame_lines(make_window(pitch=0.2, turn=0.02), 1.0)
    relief = rough(frames)
    np.testing.assert_allclose(frames.relief(frames.points(relief)[..., 2]), relief, atol=1e-9)


@pytest.mark.parametrize(("roll", "pitch"), ATTITUDES)
def test_heave_is_what_the_first_bottom_return_says_under_the_pitch(roll: float, pitch: float) -> None:
    data = make_window(roll=roll, pitch=pitch)
    data.altitude[:] = 99.0
    np.testing.assert_allclose(with_heave(data).altitude, ALTITUDE, rtol=1e-12)
    assert (data.altitude == 99.0).all()
