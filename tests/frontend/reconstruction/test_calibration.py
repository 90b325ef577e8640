"""The beam pattern of a dive comes out of its windows."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.bottom import BottomConfig, find_bottom
from frontend.radiometry import RadiometryConfig, estimate_radiometry
from frontend.reconstruction import JointConfig, calibrate
from frontend.recording import Quantity, Recording
from frontend.windows import Window
from tests.frontend.flat_floor import FlatFloor, fan

FLOOR = FlatFloor(12.0 + 2.0 * np.sin(np.arange(240) / 40), strength=1e8)
WINDOWS = [Window(k, 60 * k, 60 * k + 120, 60 * k + 60) for k in range(3)]
JOINT = JointConfig(n_levels=2)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """A vehicle that rises and falls over a flat floor."""
    recording = FLOOR.record(np.random.default_rng(1), Quantity.INTENSITY)
    track = replace(recording.trajectory_dr, z=FLOOR.altitude - 50.0)
    return replace(recording, trajectory_dr=track, altitude=FLOOR.altitude)


def test_a_flat_floor_keeps_its_pattern_when_it_is_refined(recording: Recording) -> None:
    bottom = find_bottom(recording, BottomConfig())
    calibrated = calibrate(recording, WINDOWS, bottom, RadiometryConfig(n_rounds=1, n_windows=2), JOINT)
    first = estimate_radiometry(recording, bottom, RadiometryConfig())
    angle = first.tables.angle_first + first.tables.angle_step * np.arange(first.tables.log_beam.shape[1])
    seen = (angle > 0.5) & (angle < 1.2)
    for tables in (first.tables, calibrated.tables):
        error = np.stack([tables.log_beam[side] - fan(side, angle) for side in (0, 1)])[:, seen]
        # a decibel: knots of two degrees, and what a slope that all windows share may hide
        np.testing.assert_allclose(error - error.mean(), 0.0, atol=0.23)
    np.testing.assert_array_equal(calibrated.tables.log_range, first.tables.log_range)
    np.testing.assert_array_equal(calibrated.tables.noise, first.tables.noise)


def test_without_rounds_or_windows_the_first_estimate_stands(recording: Recording) -> None:
    bottom = find_bottom(recording, BottomConfig())
    first = estimate_radiometry(recording, bottom, RadiometryConfig())
    for calibrated in (
        calibrate(recording, WINDOWS, bottom, RadiometryConfig(n_rounds=0), JOINT),
        calibrate(recording, WINDOWS, bottom, RadiometryConfig(n_windows=0), JOINT),
    ):
        np.testing.assert_array_equal(calibrated.tables.log_beam, first.tables.log_beam)


def test_a_side_that_is_twice_as_loud_has_a_pattern_twice_as_high(recording: Recording) -> None:
    bottom, config = find_bottom(recording, BottomConfig()), RadiometryConfig(n_rounds=1, n_windows=2)
    loud = replace(recording, port=2 * recording.port)
    tables = [calibrate(r, WINDOWS, bottom, config, JOINT).tables.log_beam for r in (recording, loud)]
    angles_seen = slice(30, 48)
    # noise grows with the echo, so that even the solver's steps are the same; the smoothing pulls a little
    np.testing.assert_allclose((tables[1] - tables[0])[0, angles_seen], np.log(2), atol=0.05)
    np.testing.assert_allclose((tables[1] - tables[0])[1, angles_seen], 0.0, atol=0.05)
