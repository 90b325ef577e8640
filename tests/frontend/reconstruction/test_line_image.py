"""What lines over a flat floor should have seen, by the formula."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.geometry import PORT, STARBOARD
from frontend.reconstruction.line_image import inner_angle, see_lines
from frontend.reconstruction.lines import frame_lines
from frontend.recording import SonarGeometry
from tests.frontend.reconstruction.small_lines import (
    ALTITUDE,
    ATTITUDES,
    make_echoes,
    make_lines,
    make_window,
    no_shadow,
)


@pytest.mark.parametrize(("roll", "pitch"), ATTITUDES)
def test_a_flat_floor_is_as_bright_as_expected_on_both_sides(roll: float, pitch: float) -> None:
    frames, image = make_lines(make_window(roll=roll, pitch=pitch))
    for side in (PORT, STARBOARD):
        seen = (image.weight > 0) & (frames.side == side) & (np.abs(frames.cell) > 10)
        assert seen.sum() > 100
        # the fixture takes the ground that a sample covers from the altitude, not along the tilted line: up to
        # (10 tan 0.2)^2 / (4 * 10^2) near nadir
        np.testing.assert_allclose(image.amplitude[seen], 1.0, atol=0.012)


@pytest.mark.parametrize("roll", [0.0, 0.1, 0.35])
def test_cells_in_layover_or_nearer_than_the_beam_are_left_out(roll: float) -> None:
    frames, image = make_lines(make_window(roll=roll))
    nearest = {side: np.abs(frames.cell[(image.weight[0] > 0) & (frames.side == side)]).min() for side in (0, 1)}
    # the beam starts 0.2 rad off nadir: its edge stands at 0.2 + roll on port, and at |0.2 - roll| on starboard
    assert nearest[PORT] == pytest.approx(ALTITUDE * np.tan(0.2 + roll), abs=1.0)
    assert nearest[STARBOARD] == pytest.approx(max(ALTITUDE * np.tan(abs(0.2 - roll)), 0.5), abs=1.0)


def test_echoes_follow_the_relief_they_are_corrected_onto() -> None:
    data = make_window()
    frames = frame_lines(data, 1.0)
    dark = no_shadow(data)
    dark[:, PORT, 500:520] = True  # the metre about 25.5 m of slant range
    for height in (0.0, 3.0):
        image = see_lines(data, dark, frames, np.full(frames.shape, height), make_echoes())
        across = np.sqrt(25.5**2 - (ALTITUDE - height) ** 2)
        assert frames.cell[image.is_shadow[0]].mean() == pytest.approx(across, abs=0.5)


def test_raised_ground_is_as_bright_as_level_ground_is_there() -> None:
    # the floor lies 8 m down and is said to lie 10 m down with 2 m of relief on it
    near = make_window(altitude=8.0)
    wrong = replace(near, altitude=near.altitude + 2.0)
    frames = frame_lines(wrong, 1.0)
    image = see_lines(wrong, no_shadow(wrong), frames, np.full(frames.shape, 2.0), make_echoes())
    seen = (image.weight > 0) & (np.abs(frames.cell) > 10)
    np.testing.assert_allclose(image.amplitude[seen], 1.0, atol=0.01)


def test_silence_and_gaps_say_what_they_are() -> None:
    data = make_window()
    data.intensity[:, PORT, 500:600] = np.nan
    dark = no_shadow(data)
    dark[:, STARBOARD, 500:600] = True
    frames = frame_lines(data, 1.0)
    image = see_lines(data, dark, frames, np.zeros(frames.shape), make_echoes())
    middle = np.sqrt(27.5**2 - ALTITUDE**2)
    port, starboard = (np.argmin(np.abs(frames.cell - y)) for y in (middle, -middle))
    assert (image.weight[:, port] == 0).all()
    assert image.is_shadow[:, starboard].all()
    assert not image.is_shadow[:, port].any()
    assert not image.is_shadow[:, starboard + 6 :].any()


def test_one_ping_makes_a_line() -> None:
    frames, image = make_lines(make_window(n=1))
    assert frames.shape[0] == 1
    assert np.isfinite(image.amplitude).all()


def test_the_main_lobe_ends_one_beamwidth_off_its_axis() -> None:
    sonar = SonarGeometry(mounting_depression=np.radians(30), vertical_beamwidth=np.radians(40))
    assert inner_angle(sonar, 1.0) == pytest.approx(np.radians(20))
    assert inner_angle(sonar, 2.0) == 0.0
    assert inner_angle(SonarGeometry(), 1.0) == 0.0
