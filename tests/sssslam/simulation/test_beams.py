from typing import Any

import numpy as np
import pytest

from sssslam.simulation.beams import VERTICAL_STEP, horizontal_pattern, sub_beams, vertical_pattern
from sssslam.simulation.sonar import SonarConfig


def _sonar(**values: Any) -> SonarConfig:
    return SonarConfig.model_validate(values)


def _level(pattern: np.ndarray, off_nadir_deg: float) -> float:
    return float(10 * np.log10(pattern[round((np.radians(off_nadir_deg) + np.pi) / VERTICAL_STEP)]))


@pytest.mark.parametrize("shape", ["gaussian", "line"])
def test_the_fan_is_strongest_on_its_axis_and_half_as_strong_at_half_its_width(shape: str) -> None:
    pattern = vertical_pattern(
        _sonar(depression_deg=20.0, vertical_beamwidth_deg=50.0, vertical_shape=shape, sidelobe_level=-60.0)
    )
    assert _level(pattern, 70.0) == pytest.approx(0.0, abs=1e-9)
    for off_nadir in (45.0, 95.0):
        assert _level(pattern, off_nadir) == pytest.approx(-3.01, abs=0.01)


def test_behind_the_array_only_sidelobes_are_left() -> None:
    for shape in ("gaussian", "line"):
        pattern = vertical_pattern(_sonar(depression_deg=20.0, vertical_shape=shape, sidelobe_level=-25.0))
        assert _level(pattern, -110.0) == pytest.approx(-25.0, abs=0.01)


def test_a_line_array_has_its_first_sidelobe_thirteen_decibels_down() -> None:
    pattern = vertical_pattern(
        _sonar(depression_deg=0.0, vertical_beamwidth_deg=20.0, vertical_shape="line", sidelobe_level=-90.0)
    )
    beyond_null = pattern[round((np.radians(90.0 + 24.0) + np.pi) / VERTICAL_STEP) :][:200]
    # sinc^2's first sidelobe; the table's quarter degree misses its top by little.
    assert 10 * np.log10(beyond_null.max()) == pytest.approx(-13.26, abs=0.1)


def test_the_horizontal_beam_is_half_as_strong_at_half_its_width() -> None:
    assert horizontal_pattern(np.array([0.0, 0.5, -0.5])).tolist() == pytest.approx([1.0, 0.5, 0.5], abs=1e-5)


@pytest.mark.parametrize(
    ("frequency", "length", "published_deg"),
    [(100e3, 1.0, 0.76), (400e3, 0.5, 0.38), (455e3, 0.3, 0.56), (455e3, 0.108, 1.55), (900e3, 0.45, 0.19)],
)
def test_the_beam_of_a_line_array_is_as_wide_as_published(
    frequency: float, length: float, published_deg: float
) -> None:
    width = np.degrees(_sonar(frequency=frequency, array_length=length).horizontal_beamwidth(1500.0))
    assert width == pytest.approx(published_deg, abs=0.01)


def test_sub_beams_lie_in_the_middle_of_equal_intervals() -> None:
    assert sub_beams(_sonar(n_sub_beams=3, sub_beam_extent=0.75)).tolist() == pytest.approx([-0.5, 0.0, 0.5])


def test_an_unknown_preset_is_refused_by_name() -> None:
    with pytest.raises(
        ValueError, match=r"preset 'sonar9' given, one of 400kHz, 100kHz, 900kHz, humminbird-455 wanted"
    ):
        _sonar(preset="sonar9")


@pytest.mark.parametrize("preset", ["400kHz", "100kHz", "900kHz", "humminbird-455"])
def test_a_preset_sends_no_ping_before_the_last_echo_is_back(preset: str) -> None:
    sonar = _sonar(preset=preset)
    assert sonar.ping_rate <= 1465.0 / (2 * sonar.range_max)


def test_what_a_section_says_comes_on_top_of_its_preset() -> None:
    sonar = _sonar(preset="900kHz", range_max=20.0)
    assert (sonar.frequency, sonar.range_max, sonar.n_samples) == (900e3, 20.0, 1600)
