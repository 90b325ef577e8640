"""Radiometry of echoes drawn with known looks, noise, beam pattern and range law over a flat floor."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.bottom import BottomConfig, find_bottom
from frontend.radiometry import Radiometry, RadiometryConfig, Tables, estimate_radiometry, to_intensity
from frontend.recording import Quantity, Recording, SonarGeometry
from frontend.transfer import DECIBEL
from sssslam.simulation.receiver import LogRecorder
from tests.frontend.flat_floor import FlatFloor, fan

# 9 to 15 m of altitude: angle and range are told apart only where altitude changes
WAVY = FlatFloor(12.0 + 3.0 * np.sin(np.arange(400) / 60))


def estimate(recording: Recording) -> Radiometry:
    return estimate_radiometry(recording, find_bottom(recording, BottomConfig()), RadiometryConfig())


def as_amplitude(recording: Recording) -> Recording:
    return replace(recording, port=np.sqrt(recording.port), starboard=np.sqrt(recording.starboard))


def knots(tables: Tables) -> np.ndarray:
    return np.asarray(tables.angle_first + tables.angle_step * np.arange(tables.log_beam.shape[1]))


def test_numbers_become_intensities() -> None:
    values = np.array([0.0, 3.0, 20.0], dtype=np.float32)
    np.testing.assert_array_equal(to_intensity(values, Quantity.INTENSITY), [0, 3, 20])
    np.testing.assert_array_equal(to_intensity(values, Quantity.AMPLITUDE), [0, 9, 400])
    np.testing.assert_allclose(to_intensity(values, Quantity.LOG), [1, 10**0.3, 100])
    assert to_intensity(values, Quantity.INTENSITY).dtype == np.float64


@pytest.mark.parametrize("quantity", [Quantity.INTENSITY, Quantity.AMPLITUDE, Quantity.LOG])
def test_what_is_no_number_is_unknown(quantity: Quantity) -> None:
    values = np.array([np.nan, np.inf, -np.inf, 1.0], dtype=np.float32)
    intensity = to_intensity(values, quantity)
    assert np.isnan(intensity[:2]).all()
    assert np.isfinite(intensity[3])
    assert np.isnan(to_intensity(np.array([1e5]), Quantity.LOG)).all()  # ten thousand powers of ten
    np.testing.assert_array_equal(values[1:], [np.inf, -np.inf, 1.0])


@pytest.mark.parametrize("nothing", [0.0, np.nan])
def test_a_recording_without_echoes_is_refused(nothing: float) -> None:
    recording = WAVY.record(np.random.default_rng(1))
    silent = np.full_like(recording.port, nothing)
    recording = replace(recording, port=silent, starboard=silent, altitude=WAVY.altitude)
    with pytest.raises(ValueError, match="the recording holds no echoes: every sample is zero or unknown"):
        estimate(recording)


@pytest.mark.parametrize("looks", [1.0, 2.0, 4.0, 16.0])
def test_looks_of_gamma_speckle_are_found(looks: float) -> None:
    recording = replace(WAVY, looks=looks).record(np.random.default_rng(1), Quantity.INTENSITY)
    # 30 000 differences of means of eight: 1 %, and the range law inside eight samples
    assert estimate(recording).looks == pytest.approx(looks, rel=0.05)


def test_amplitude_and_intensity_of_single_looks_are_told_apart() -> None:
    intensity = WAVY.record(np.random.default_rng(2))
    assert estimate(intensity).quantity == Quantity.INTENSITY
    amplitude = estimate(as_amplitude(intensity))
    assert amplitude.quantity == Quantity.AMPLITUDE
    assert amplitude.looks == pytest.approx(1.0, rel=0.05)


def test_what_the_sonar_says_is_not_guessed() -> None:
    amplitude = as_amplitude(WAVY.record(np.random.default_rng(3), Quantity.INTENSITY))
    assert estimate(amplitude).quantity == Quantity.INTENSITY


def test_the_noise_floor_is_the_mean_of_the_water_column_of_each_side() -> None:
    recording = WAVY.record(np.random.default_rng(4), Quantity.INTENSITY)
    # leaving out what is above six medians takes 7 % of exponential speckle
    np.testing.assert_allclose(estimate(recording).tables.noise, [2.0, 1.0], rtol=0.1)


def test_fish_do_not_raise_the_noise_floor() -> None:
    recording = WAVY.record(np.random.default_rng(5), Quantity.INTENSITY)
    port = recording.port.copy()
    port[::7, 90:120] += 1e5
    assert estimate(replace(recording, port=port)).tables.noise[0] == pytest.approx(2.0, rel=0.1)


def test_a_silent_water_column_has_a_floor_above_zero() -> None:
    tables = estimate(replace(WAVY, noise=(0.0, 0.0)).record(np.random.default_rng(6), Quantity.INTENSITY)).tables
    assert (tables.noise > 0).all()
    assert (tables.noise < 1e-3).all()


@pytest.mark.parametrize("power", [2.0, 3.0, 4.0])
def test_beam_pattern_and_range_law_of_a_flat_floor_are_recovered(power: float) -> None:
    floor = replace(WAVY, power=power, strength=1e5 * 30.0**power)
    tables = estimate(floor.record(np.random.default_rng(7), Quantity.INTENSITY)).tables
    fall = np.diff(tables.log_range[[40, 200]]) / np.diff(np.log(np.array([40, 200]) * tables.range_step))
    assert fall[0] == pytest.approx(-power, abs=0.11)  # one step of the search
    angle = knots(tables)
    seen = (angle > 0.35) & (angle < 1.2)
    error = np.stack([tables.log_beam[side] - fan(side, angle) for side in (0, 1)])[:, seen]
    # what of the level is pattern and what range law is a matter of units, the same for both sides;
    # 0.1 is half a decibel: speckle, and the smoothing over knots of two degrees
    np.testing.assert_allclose(error - error.mean(), 0.0, atol=0.1)


def test_roll_and_pitch_do_not_bend_the_beam_pattern() -> None:
    level = estimate(WAVY.record(np.random.default_rng(8), Quantity.INTENSITY)).tables
    tilted = replace(WAVY, roll=0.15, pitch=0.1).record(np.random.default_rng(9), Quantity.INTENSITY)
    tables = estimate(replace(tilted, altitude=WAVY.altitude)).tables
    seen = (knots(level) > 0.6) & (knots(level) < 1.1)
    difference = (tables.log_beam - level.log_beam)[:, seen]
    np.testing.assert_allclose(difference - difference.mean(), 0.0, atol=0.15)  # speckle of two estimates


def flat_tables(n_knots: int = 61) -> Tables:
    return Tables(np.zeros((2, n_knots)), -0.5, 0.035, np.zeros(260), 0.25, np.zeros(2), 2.0)


def test_logarithms_of_a_dive_give_its_beam_pattern() -> None:
    floor = replace(WAVY, strength=1e8)
    echoes = floor.record(np.random.default_rng(10), Quantity.INTENSITY)
    recorder = LogRecorder(full_scale=65.0, dynamic_range=80.0)
    steps = [recorder.record(side.astype(np.float64)) for side in (echoes.port, echoes.starboard)]
    logarithmic = replace(echoes, port=steps[0], starboard=steps[1], sonar=SonarGeometry(quantity=Quantity.LOG))
    straight, bent = estimate(echoes), estimate(logarithmic)
    assert bent.quantity == Quantity.LOG
    assert bent.transfer is not None
    angle = knots(straight.tables)
    seen = (angle > 0.5) & (angle < 1.1)
    r = np.arange(260) * straight.tables.range_step
    far = (r > 15) & (r < 40)
    # what the unit of the logarithm is wrong by, the pattern and the law are, too
    share = bent.transfer.step / DECIBEL / (80.0 / 255)
    for true, found in (
        (straight.tables.log_beam[:, seen], bent.tables.log_beam[:, seen]),
        (straight.tables.log_range[far], bent.tables.log_range[far]),
    ):
        difference = found - share * true
        assert np.ptp(difference) < 0.25 * np.ptp(true) + 0.3


def test_a_range_that_changes_during_the_dive_changes_no_law() -> None:
    fine = WAVY.record(np.random.default_rng(11), Quantity.INTENSITY)
    halves = [((side[:, ::2] + side[:, 1::2]) / 2)[200:] for side in (fine.port, fine.starboard)]
    padded = [np.pad(half, ((0, 0), (0, 450)), constant_values=np.nan) for half in halves]
    mixed = replace(
        fine,
        port=np.r_[fine.port[:200], padded[0]],
        starboard=np.r_[fine.starboard[:200], padded[1]],
        sample_spacing=np.r_[fine.sample_spacing[:200], 2 * fine.sample_spacing[200:]],
    )
    bottom = find_bottom(fine, BottomConfig())
    one, two = (estimate_radiometry(r, bottom, RadiometryConfig()).tables for r in (fine, mixed))
    range_two = np.interp(np.linspace(10, 42, 40), np.arange(260) * two.range_step, two.log_range)
    range_one = np.interp(np.linspace(10, 42, 40), np.arange(260) * one.range_step, one.log_range)
    angle = knots(one)
    seen = (angle > 0.5) & (angle < 1.15)
    # a decibel: half the pings, in cells twice as wide, of which the farther half holds noise
    assert np.ptp(range_two - range_one) < 0.23
    assert np.ptp((two.log_beam - one.log_beam)[0, seen]) < 0.23


def test_the_noise_floor_over_range_grows_with_the_recorders_gain() -> None:
    gain = (WAVY.slant_range / 10) ** 2
    recording = replace(WAVY, strength=1e8).record(np.random.default_rng(12), Quantity.INTENSITY)
    louder = replace(
        recording,
        port=(recording.port * gain).astype(np.float32),
        starboard=(recording.starboard * gain).astype(np.float32),
    )
    radiometry = estimate(louder)
    assert radiometry.noise_floor is not None
    r = np.arange(260) * radiometry.tables.range_step
    heard = (r > 5.0) & (r < 11.0)
    expected = np.array([[2.0], [1.0]]) * (r[heard] / 10) ** 2
    # means of a few thousand exponentials, less the 7 % that leaving out loud ones takes
    np.testing.assert_allclose(radiometry.noise_floor[:, heard], expected, rtol=0.15)
    # never heard beyond: as at the last range it was heard at
    assert (radiometry.noise_floor[:, -1] == radiometry.noise_floor[:, 150]).all()


def test_what_the_samples_are_is_said_with_their_looks() -> None:
    radiometry = estimate(WAVY.record(np.random.default_rng(13)))
    assert radiometry.words.startswith("Samples taken for intensity by their speckle. Each has ")
    assert Radiometry(Quantity.AMPLITUDE, 2.0, flat_tables()).words == "Samples taken for amplitude. Each has 2 looks."
    values = np.array([3.0, np.nan])
    np.testing.assert_array_equal(Radiometry(Quantity.AMPLITUDE, 2.0, flat_tables()).intensity(values), [9.0, np.nan])
