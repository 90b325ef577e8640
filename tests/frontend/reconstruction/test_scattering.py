"""A scattering exponent is found where lines kept aside tell it, and left alone where they do not."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.arrays import FloatArray
from frontend.bottom import Bottom, BottomConfig, find_bottom
from frontend.radiometry import RadiometryConfig
from frontend.reconstruction import JointConfig, calibrate
from frontend.reconstruction.joint import reconstruct
from frontend.reconstruction.scattering import likeliest_exponent
from frontend.recording import Recording
from frontend.windows import sliding_windows
from sssslam.evaluation.reconstruction import evaluate_submaps
from sssslam.simulation import Scene, simulate

SPREAD = 0.35


def parabola(truth: float, depth: float = 200.0) -> Callable[[float], FloatArray]:
    """Misfits of five windows that agree, up to a part in ten of how much each tells."""
    share = depth * np.array([0.9, 1.0, 1.1, 0.95, 1.05])
    return lambda exponent: share * np.log(exponent / truth) ** 2 + np.arange(5.0)


@given(st.floats(2.9, 4.0))
def test_the_lowest_point_of_a_parabola_is_found(truth: float) -> None:
    # what the windows differ by and the belief in the usual one both pull towards 2, by a part in ten at most
    assert 0.9 * truth < likeliest_exponent(parabola(truth), 2.0, SPREAD) < 1.02 * truth


@given(st.floats(0.5, 2.0))
def test_a_smaller_exponent_than_the_usual_is_not_looked_for(truth: float) -> None:
    assert likeliest_exponent(parabola(truth), 2.0, SPREAD) == 2.0


def test_windows_that_disagree_leave_the_usual_one() -> None:
    gains = np.array([-30.0, 25.0, -28.0, 30.0])  # a mean near nothing, of what scatters by thirty
    assert likeliest_exponent(lambda e: gains * (e > 2.0), 2.0, SPREAD) == 2.0
    assert likeliest_exponent(lambda e: (gains - 60.0) * (e > 2.0), 2.0, SPREAD) > 2.0


def test_two_windows_say_too_little() -> None:
    assert likeliest_exponent(lambda e: np.array([-100.0, -100.0]) * e, 2.0, SPREAD) == 2.0


def test_a_firm_belief_holds_the_exponent() -> None:
    def misfit(exponent: float) -> FloatArray:
        raise AssertionError(f"{exponent} was tried")

    assert likeliest_exponent(misfit, 2.0, 0.01) == 2.0


def test_the_search_ends() -> None:
    tried: list[float] = []

    def misfit(exponent: float) -> FloatArray:
        tried.append(exponent)
        return np.full(4, -1e6 * exponent)

    assert likeliest_exponent(misfit, 2.0, SPREAD) == pytest.approx(2.0 * 2**1.5)
    assert len(tried) == 4


def sound(exponent: float) -> Recording:
    """Three lines 12 m above boulders and pits on a floor that scatters by an exponent."""
    layers = [{"kind": "fractal", "rms": 0.8}, {"kind": "sediment", "rms": 0.2}, {"kind": "objects", "count": 300}]
    scene = {
        "seed": 3,
        "terrain": {"size": [300.0, 300.0], "layers": layers},
        "survey": {"length": 140.0, "spacing": 40.0, "n_legs": 3},
        "sonar": {"range_max": 40.0, "ping_rate": 4.0, "n_sub_beams": 1},
        "seabed": {"exponent": exponent},
        "drift": {"grade": "none"},
    }
    return simulate(Scene.model_validate(scene))


def error_of(recording: Recording, bottom: Bottom, config: RadiometryConfig) -> tuple[float, float]:
    """Exponent after calibration, and RMSE without plane of eleven submaps together [m]."""
    windows = sliding_windows(recording.trajectory_dr, 40.0)
    radiometry = calibrate(recording, windows, bottom, config, JointConfig())
    submaps = [reconstruct(recording, window, bottom, radiometry, JointConfig()) for window in windows[1::4]]
    truth = recording.truth
    assert truth is not None
    assert truth.terrain is not None
    rows = [evaluate_submaps([submap], truth.trajectory, truth.terrain) for submap in submaps]
    errors = [m.value for row in rows for m in row if m.name == "submap_rmse_without_plane"]
    return radiometry.tables.exponent, float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.slow
def test_a_floor_of_exponent_four_is_known_for_one_and_its_shape_is_not_bent() -> None:
    recording = sound(4.0)
    bottom = find_bottom(recording, BottomConfig())
    exponent, found = error_of(recording, bottom, RadiometryConfig(exponent_spread=0.35))
    _, known = error_of(recording, bottom, RadiometryConfig(exponent=4.0))
    _, usual = error_of(recording, bottom, RadiometryConfig())
    assert 2.4 < exponent < 5.7  # nearer to four than to the usual two, or beyond by as much
    # a factor of the square root of two is what is left open: more than half of what a factor of two costs is mended
    assert usual > 1.2 * known
    assert found - known < 0.5 * (usual - known)
