from typing import Any

import numpy as np
import pytest

from frontend.recording import Quantity
from sssslam.simulation.receiver import (
    FloatRecorder,
    LinearRecorder,
    LogRecorder,
    ReceiverConfig,
    background,
    leak,
    sample_ranges,
    time_varying_gain,
)
from sssslam.simulation.sonar import SonarConfig


def _sonar(**values: Any) -> SonarConfig:
    return SonarConfig.model_validate(values)


def test_an_empty_sea_is_noise_alone() -> None:
    level = 10 * np.log10(background(_sonar(noise_level=47.0), ReceiverConfig(gain=-60.0), 1500.0, 0.1))
    np.testing.assert_allclose(level, -13.0)


def test_turbid_water_scatters_back_less_with_the_square_of_range() -> None:
    sonar = _sonar(noise_level=-300.0)
    level = background(sonar, ReceiverConfig(volume_strength=-80.0), 1500.0, 0.0)
    r = sample_ranges(sonar)
    np.testing.assert_allclose(level * r**2, level[0] * r[0] ** 2)
    # SL + Sv + 10 log(angle dr) at 1 m, angle 0.72^2 x 0.38 deg x 50 deg
    angle = 0.72**2 * sonar.horizontal_beamwidth(1500.0) * np.radians(50.0)
    expected = 210.0 - 80.0 + 10 * np.log10(angle * 0.05) - 60.0
    assert 10 * np.log10(level[0] * r[0] ** 2) == pytest.approx(expected)


def test_ringing_dies_away_by_its_length() -> None:
    sonar = _sonar(noise_level=-300.0)
    level = background(sonar, ReceiverConfig(ringing_level=120.0, ringing_length=0.5), 1500.0, 0.0)
    assert level[10] / level[0] == pytest.approx(np.exp(-1.0))


def test_time_varying_gain_undoes_spreading_and_absorption() -> None:
    sonar = _sonar()
    gain = time_varying_gain(sonar, ReceiverConfig(tvg_spreading=30.0, tvg_absorption=1.0), 0.1)
    r = sample_ranges(sonar)
    np.testing.assert_allclose(gain * r**-3 * 10 ** (-0.02 * r), 1.0)


def test_no_gain_is_asked_for_by_default() -> None:
    np.testing.assert_array_equal(time_varying_gain(_sonar(), ReceiverConfig(), 0.1), 1.0)


def test_crosstalk_leaks_its_share_to_the_other_side() -> None:
    port, starboard = leak(np.array([[1.0]]), np.array([[100.0]]), -20.0)
    assert (port[0, 0], starboard[0, 0]) == pytest.approx((2.0, 100.01))


def test_without_crosstalk_sides_stay_as_they_are() -> None:
    port, starboard = np.ones((1, 2)), np.zeros((1, 2))
    assert leak(port, starboard, None) == (port, starboard)


def test_the_float_recorder_keeps_intensity() -> None:
    recorder = FloatRecorder()
    assert recorder.record(np.array([[1.5, 0.0]])).tolist() == [[1.5, 0.0]]
    assert (recorder.quantity, recorder.sample_type) == (Quantity.INTENSITY, "<f4")


def test_the_linear_recorder_keeps_amplitude_in_steps_and_clips() -> None:
    recorder = LinearRecorder(bits=8, full_scale=20.0)
    assert recorder.record(np.array([[100.0, 25.0, 1e6, 0.0]])).tolist() == [[255.0, 128.0, 255.0, 0.0]]
    assert (recorder.quantity, recorder.sample_type) == (Quantity.AMPLITUDE, "u1")
    assert LinearRecorder(bits=16).sample_type == "<u2"


def test_the_log_recorder_keeps_decibels_in_steps_and_clips() -> None:
    recorder = LogRecorder(bits=8, full_scale=50.0, dynamic_range=50.0)
    recorded = recorder.record(np.array([[1e5, 1.0, 10**2.5, 0.0, 1e9]]))
    assert recorded.tolist() == [[255.0, 0.0, 128.0, 0.0, 255.0]]
    assert (recorder.quantity, recorder.sample_type) == (Quantity.LOG, "u1")
