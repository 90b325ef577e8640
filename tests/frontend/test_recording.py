"""The data model refuses what it cannot mean, in one line that says what is wanted."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from frontend.heightfield import Heightfield
from frontend.recording import Quantity, Recording, SonarGeometry, Truth
from frontend.trajectory import Trajectory

N, M = 5, 4


def trajectory(n: int = N, **changes: Any) -> Trajectory:
    zero = np.zeros(n)
    return replace(Trajectory(np.arange(n) + 1.6e9, 2.0 * np.arange(n), zero, zero - 20, zero, zero, zero), **changes)


def recording(**changes: Any) -> Recording:
    values: dict[str, Any] = {
        "port": np.arange(N * M, dtype=np.float32).reshape(N, M),
        "starboard": np.ones((N, M), dtype=np.float32),
        "sample_spacing": np.full(N, 0.1),
        "sound_speed": np.full(N, 1500.0),
        "trajectory_dr": trajectory(),
        "altitude": np.full(N, 12.0),
        "depth": np.full(N, 20.0),
        "speed": np.full(N, np.nan),
    }
    return Recording(**{**values, **changes})


def test_numbers_follow_from_the_arrays() -> None:
    dive = recording()
    assert (dive.n_pings, dive.n_samples) == (N, M)
    assert dive.ping_spacing == 2.0
    np.testing.assert_allclose(dive.slant_range_max, 0.4)
    np.testing.assert_array_equal(dive.ping_time, dive.trajectory_dr.time)


def test_what_the_sonar_does_not_say_is_nan_and_unknown() -> None:
    sonar = recording().sonar
    assert np.isnan([sonar.frequency, sonar.horizontal_beamwidth, sonar.mounting_depression]).all()
    assert sonar.quantity == Quantity.UNKNOWN == "unknown"


@pytest.mark.parametrize("pings", [slice(1, 3), np.array([1, 2]), np.array([False, True, True, False, False])])
def test_some_pings_are_a_recording_with_every_row_cut(pings: Any) -> None:
    whole = recording(
        sonar=SonarGeometry(frequency=4e5),
        notes=("a",),
        truth=Truth(trajectory(), Heightfield(np.zeros((2, 2)), 1.0, (0, 0))),
    )
    some = whole[pings]
    assert some.n_pings == 2
    np.testing.assert_array_equal(some.port, whole.port[1:3])
    np.testing.assert_array_equal(some.ping_time, whole.ping_time[1:3])
    assert some.truth is not None
    np.testing.assert_array_equal(some.truth.trajectory.x, [2.0, 4.0])
    assert (some.sonar, some.notes) == (whole.sonar, whole.notes)


def test_one_ping_has_no_spacing() -> None:
    assert np.isnan(recording()[:1].ping_spacing)


def test_sides_of_different_size_are_refused() -> None:
    with pytest.raises(
        ValueError, match=r"port and starboard must both be \(pings, samples\), got \(5, 4\) and \(5, 3\)"
    ):
        recording(starboard=np.ones((N, 3), dtype=np.float32))


def test_a_flat_array_is_refused() -> None:
    flat = np.ones(N, dtype=np.float32)
    with pytest.raises(ValueError, match=r"must both be \(pings, samples\), got \(5,\) and \(5,\)"):
        recording(port=flat, starboard=flat)


def test_a_number_instead_of_an_array_is_refused() -> None:
    with pytest.raises(ValueError, match=r"must both be \(pings, samples\), got \(\) and \(5, 4\)"):
        recording(port=np.array(1.0))


@pytest.mark.parametrize("shape", [(0, M), (N, 0)])
def test_an_empty_recording_is_refused(shape: tuple[int, int]) -> None:
    nothing = np.empty(shape, dtype=np.float32)
    with pytest.raises(ValueError, match=rf"at least one ping and one sample, got {shape[0]} pings of {shape[1]}"):
        recording(port=nothing, starboard=nothing)


@pytest.mark.parametrize("name", ["sample_spacing", "sound_speed", "altitude", "depth", "speed"])
def test_a_row_too_few_is_refused_by_name(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must have one row a ping: 5 wanted, got 4"):
        recording(**{name: np.ones(N - 1)})


def test_a_track_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="trajectory_dr must have one row a ping: 5 wanted, got 6"):
        recording(trajectory_dr=trajectory(6))


@pytest.mark.parametrize("name", ["time", "x", "y", "z", "roll", "pitch", "yaw"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_navigation_that_is_not_finite_is_refused_with_the_ping(name: str, bad: float) -> None:
    values = getattr(trajectory(), name).copy()
    values[[2, 4]] = bad
    with pytest.raises(ValueError, match=rf"navigation must be finite: {name} of ping 2 is not \(2 such pings\)"):
        recording(trajectory_dr=trajectory(**{name: values}))


@pytest.mark.parametrize("step", [0.0, -1.0])
def test_times_that_stand_still_or_run_back_are_refused(step: float) -> None:
    time = trajectory().time.copy()
    time[3] = time[2] + step
    with pytest.raises(ValueError, match="ping times must increase strictly: ping 3 is not later than the one before"):
        recording(trajectory_dr=trajectory(time=time))


@pytest.mark.parametrize(("name", "words"), [("sample_spacing", "sample spacing"), ("sound_speed", "sound speed")])
@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan])
def test_spacing_and_sound_speed_must_be_positive(name: str, words: str, bad: float) -> None:
    values = np.full(N, 2.0)
    values[1] = bad
    with pytest.raises(ValueError, match=f"{words} must be positive"):
        recording(**{name: values})
