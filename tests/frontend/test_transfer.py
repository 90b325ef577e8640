"""What recorded numbers are: gamma speckle rewritten as amplitudes, intensities and logarithms, in bits and floats."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import polygamma

from frontend.arrays import FloatArray
from frontend.recording import Quantity, Recording
from frontend.speckle import asymmetry_of_looks, looks_of_spread, measure_speckle, spread_of_looks
from frontend.transfer import DECIBEL, Transfer, estimate_transfer, to_intensity
from sssslam.simulation.receiver import LinearRecorder, LogRecorder
from tests.frontend.flat_floor import FlatFloor

FLOOR = FlatFloor(12.0 + 3.0 * np.sin(np.arange(400) / 60), strength=1e8)
LOUDEST = 75.0  # dB; the brightest echoes of that floor


def recorded(looks: float, write: Callable[[FloatArray], FloatArray], seed: int = 1) -> Recording:
    """The floor as a recorder writes it that does not say what its numbers are."""
    recording = replace(FLOOR, looks=looks).record(np.random.default_rng(seed))
    sides = [np.asarray(write(side.astype(np.float64)), np.float32) for side in (recording.port, recording.starboard)]
    return replace(recording, port=sides[0], starboard=sides[1])


WRITERS = {
    "intensity as it is": (Quantity.INTENSITY, lambda x: x),
    "amplitude as it is": (Quantity.AMPLITUDE, np.sqrt),
    "amplitude in 8 bits": (Quantity.AMPLITUDE, LinearRecorder(bits=8, full_scale=55.0).record),
    "amplitude in 16 bits": (Quantity.AMPLITUDE, LinearRecorder(bits=16, full_scale=LOUDEST).record),
    "logarithm in 8 bits": (Quantity.LOG, LogRecorder(bits=8, full_scale=LOUDEST).record),
    "logarithm in 16 bits": (Quantity.LOG, LogRecorder(bits=16, full_scale=LOUDEST).record),
    "decibels": (Quantity.LOG, lambda x: 10 * np.log10(x)),
    "negative decibels": (Quantity.LOG, lambda x: 10 * np.log10(x) - 200),
}


@pytest.mark.parametrize("looks", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("name", WRITERS)
def test_what_is_written_is_recognised_and_said_with_its_probability(name: str, looks: float) -> None:
    quantity, write = WRITERS[name]
    transfer = estimate_transfer(recorded(looks, write))
    assert transfer.quantity == quantity
    assert transfer.confidence > 0.7
    assert transfer.words.startswith(f"Samples taken for {quantity} by their speckle")


@pytest.mark.parametrize("looks", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("dynamic_range", [50.0, 70.0, 90.0])
def test_the_unit_of_a_logarithm_is_found_from_its_speckle(dynamic_range: float, looks: float) -> None:
    recorder = LogRecorder(bits=8, full_scale=LOUDEST, dynamic_range=dynamic_range)
    transfer = estimate_transfer(recorded(looks, recorder.record))
    # spread goes with the root of looks, and looks are told by an asymmetry of 0.2 to about a half
    assert transfer.step / DECIBEL == pytest.approx(dynamic_range / 255, rel=0.2)
    assert f"One unit is {transfer.step / DECIBEL:.2g} dB." in transfer.words


def test_intensities_come_back_from_what_the_logarithmic_recorder_writes() -> None:
    recorder = LogRecorder(bits=8, full_scale=LOUDEST)
    written = recorded(1.0, recorder.record)
    original = recorded(1.0, lambda x: x)
    back = estimate_transfer(written).intensity(written.port)
    clear = (written.port > 5) & (written.port < 250)
    slope, _ = np.polyfit(np.log(original.port[clear]), np.log(back[clear]), 1)
    assert slope == pytest.approx(1.0, abs=0.15)
    exact = to_intensity(written.port, Quantity.LOG, recorder.dynamic_range / 255 * DECIBEL)
    ratio = np.log(exact[clear]) - np.log(original.port[clear])
    # half a step of rounding
    assert np.ptp(ratio) <= 1.001 * recorder.dynamic_range / 255 * DECIBEL


def test_what_the_recording_says_is_believed_and_doubt_is_said() -> None:
    lying = recorded(1.0, lambda x: x)
    lying = replace(lying, sonar=replace(lying.sonar, quantity=Quantity.AMPLITUDE))
    transfer = estimate_transfer(lying)
    assert transfer.quantity == Quantity.AMPLITUDE
    assert transfer.confidence == 1.0
    expected = "Samples taken for amplitude, as the recording says, though their speckle is that of intensity."
    assert transfer.words == expected
    honest = replace(lying, sonar=replace(lying.sonar, quantity=Quantity.INTENSITY))
    assert estimate_transfer(honest).words == "Samples taken for intensity, as the recording says."


def test_a_textured_floor_of_many_looks_does_not_tell_and_that_is_said() -> None:
    rng, texture = np.random.default_rng(3), np.linspace(0.2, 0.5, 900)
    recording = recorded(8.0, lambda x: np.rint(10 * np.sqrt(x) * np.exp(texture * rng.normal(size=x.shape))))
    transfer = estimate_transfer(recording)
    assert transfer.quantity == Quantity.AMPLITUDE
    assert transfer.confidence < 0.7
    assert transfer.words.startswith(f"Samples taken for amplitude ({transfer.confidence:.0%}; intensity ")
    assert "their speckle does not tell" in transfer.words


@pytest.mark.parametrize("said", list(Quantity))
def test_where_there_is_too_little_the_usual_is_taken(said: Quantity) -> None:
    few = FLOOR.record(np.random.default_rng(1), said)[:5]
    transfer = estimate_transfer(few)
    if said == Quantity.UNKNOWN:
        assert transfer.quantity == Quantity.AMPLITUDE
        assert transfer.confidence < 0.5
        assert "there is too little to judge by" in transfer.words
    else:
        assert (transfer.quantity, transfer.confidence, transfer.step) == (said, 1.0, DECIBEL)


def test_silence_and_gaps_are_too_little_as_well() -> None:
    recording = FLOOR.record(np.random.default_rng(1))
    for nothing in (0.0, np.nan, np.inf):
        empty = np.full_like(recording.port, nothing)
        assert measure_speckle(replace(recording, port=empty, starboard=empty)) is None


def test_clipped_echoes_are_reported() -> None:
    clipped = estimate_transfer(recorded(1.0, LinearRecorder(bits=8, full_scale=45.0).record))
    assert clipped.saturation == 255.0
    assert "Echoes above 255 were clipped." in clipped.words
    assert estimate_transfer(recorded(1.0, np.sqrt)).saturation == np.inf


def test_the_same_recording_gives_the_same_answer_and_stays_as_it_is() -> None:
    recording = recorded(2.0, LogRecorder(full_scale=LOUDEST).record)
    before = recording.port.copy()
    assert estimate_transfer(recording) == estimate_transfer(recording)
    np.testing.assert_array_equal(recording.port, before)


def test_a_transfer_says_what_intensity_a_number_is() -> None:
    numbers = np.array([0.0, 2.0, np.nan])
    np.testing.assert_allclose(Transfer(Quantity.AMPLITUDE).intensity(numbers), [0.0, 4.0, np.nan])
    np.testing.assert_allclose(Transfer(Quantity.LOG).intensity(numbers), [1.0, 10**0.2, np.nan])
    np.testing.assert_allclose(Transfer(Quantity.LOG, 0.5).intensity(numbers), [1.0, np.e, np.nan])


@given(st.floats(0.3, 100.0))
def test_looks_and_spread_are_inverse(looks: float) -> None:
    # a table of 200 looks over four decades, read linearly in the logarithm
    assert looks_of_spread(spread_of_looks(looks)) == pytest.approx(looks, rel=2e-3)


def test_spread_and_asymmetry_are_those_of_drawn_speckle() -> None:
    rng = np.random.default_rng(4)
    for looks in (1.0, 3.0):
        log = np.log(rng.gamma(looks, 1 / looks, 400_000))
        low, middle, high = np.quantile(log, [0.1, 0.5, 0.9])
        assert spread_of_looks(looks) == pytest.approx(high - low, rel=0.01)
        assert asymmetry_of_looks(looks) == pytest.approx((low + high - 2 * middle) / (high - low), abs=0.01)
    # of many looks the logarithm is normal: 2.563 standard deviations, and var ln I = trigamma(L)
    assert spread_of_looks(200.0) == pytest.approx(2.5631 * np.sqrt(polygamma(1, 200.0)), rel=1e-3)
    assert asymmetry_of_looks(200.0) == pytest.approx(0.0, abs=0.02)
