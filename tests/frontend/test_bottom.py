"""First bottom return on floors of known depth, through ringing, dropouts and a wrong altimeter."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from frontend.bottom import Bottom, BottomConfig, find_bottom
from frontend.recording import Quantity, Recording
from sssslam.readers import read
from sssslam.simulation.scene import parse_scene
from sssslam.simulation.simulator import simulate
from tests.frontend.flat_floor import SPACING, FlatFloor

# The middle of the first sample is given, and speckle may hide or feign one sample.
RESOLUTION = 1.5 * SPACING + 1e-9
LEVEL = FlatFloor(np.full(200, 12.0))


@pytest.fixture
def level() -> Recording:
    """Two hundred pings 12 m above a flat floor, single-look speckle."""
    return LEVEL.record(np.random.default_rng(1))


def find(recording: Recording) -> Bottom:
    return find_bottom(recording, BottomConfig())


def test_a_flat_floor_returns_first_at_its_altitude(level: Recording) -> None:
    bottom = find(level)
    assert bottom.first_bottom_return.shape == (200, 2)
    np.testing.assert_allclose(bottom.first_bottom_return, 12.0, atol=RESOLUTION)
    np.testing.assert_allclose(bottom.altitude, 12.0, atol=RESOLUTION)


def test_without_an_altimeter_there_is_no_scale(level: Recording) -> None:
    assert np.isnan(find(level).altimeter_scale)


def test_ringing_is_not_the_bottom() -> None:
    # a million times the noise at the start, above it for 4 m
    ringing = replace(LEVEL, ringing=1e6).record(np.random.default_rng(2))
    np.testing.assert_allclose(find(ringing).first_bottom_return, 12.0, atol=RESOLUTION)


def test_a_floor_that_rises_and_falls_is_followed() -> None:
    altitude = 12.0 + 2.0 * np.sin(np.arange(300) / 30)
    bottom = find(FlatFloor(altitude).record(np.random.default_rng(3)))
    error = bottom.first_bottom_return - altitude[:, None]
    # one more sample where the floor moves by one and a half from ping to ping
    assert np.abs(error).max() < RESOLUTION + SPACING


def test_single_pings_without_echo_are_bridged(level: Recording) -> None:
    rng = np.random.default_rng(4)
    lost = rng.random(200) < 0.3
    port, starboard = np.where(lost[:, None], 0, level.port), np.where(lost[:, None], np.nan, level.starboard)
    bottom = find(replace(level, port=port.astype(np.float32), starboard=starboard.astype(np.float32)))
    np.testing.assert_allclose(bottom.first_bottom_return, 12.0, atol=RESOLUTION)


@pytest.mark.parametrize("garbage", [np.inf, 3e38, -3e38, -1.0])
def test_a_broken_sample_does_not_hide_the_bottom(level: Recording, garbage: float) -> None:
    port = level.port.copy()
    port[40:60, 300] = garbage
    with np.errstate(all="raise"):
        bottom = find(replace(level, port=port))
    np.testing.assert_allclose(bottom.first_bottom_return[:, 1], 12.0, atol=RESOLUTION)
    np.testing.assert_allclose(bottom.altitude, 12.0, atol=RESOLUTION)


def test_a_long_gap_is_bridged(level: Recording) -> None:
    port, starboard = level.port.copy(), level.starboard.copy()
    port[80:120], starboard[80:120] = 0, 0
    bottom = find(replace(level, port=port, starboard=starboard))
    np.testing.assert_allclose(bottom.first_bottom_return, 12.0, atol=RESOLUTION)


def test_a_dead_side_has_the_return_of_the_altitude(level: Recording) -> None:
    bottom = find(replace(level, port=np.zeros_like(level.port)))
    np.testing.assert_allclose(bottom.first_bottom_return, 12.0, atol=RESOLUTION)


def test_silence_without_altitude_is_refused(level: Recording) -> None:
    silent = np.zeros_like(level.port)
    with pytest.raises(ValueError, match="no first bottom return found on either side and no altitude recorded"):
        find(replace(level, port=silent, starboard=silent))


def test_a_range_shorter_than_the_edge_looked_for_has_no_bottom(level: Recording) -> None:
    with pytest.raises(ValueError, match="one of them is wanted"):
        find(replace(level, port=level.port[:, :10], starboard=level.starboard[:, :10]))


def test_silence_with_an_altimeter_is_where_the_altimeter_says(level: Recording) -> None:
    silent = np.zeros_like(level.port)
    bottom = find(replace(level, port=silent, starboard=silent, altitude=np.full(200, 11.0)))
    np.testing.assert_array_equal(bottom.altitude, 11.0)
    np.testing.assert_array_equal(bottom.first_bottom_return, 11.0)
    assert bottom.altimeter_scale == 1.0


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_an_altimeter_that_is_ten_percent_wrong_is_scaled_to_the_echoes(level: Recording, share: float) -> None:
    bottom = find(replace(level, altitude=np.full(200, 12.0 * share)))
    assert bottom.altimeter_scale == pytest.approx(1 / share, rel=RESOLUTION / 12)
    np.testing.assert_allclose(bottom.altitude, 12.0, atol=RESOLUTION)


def test_an_altimeter_within_the_tolerance_is_believed(level: Recording) -> None:
    bottom = find(replace(level, altitude=np.full(200, 12.2)))
    assert bottom.altimeter_scale == 1.0
    np.testing.assert_array_equal(bottom.altitude, 12.2)


def test_gaps_of_the_altimeter_are_bridged(level: Recording) -> None:
    altitude = np.linspace(11.9, 12.1, 200)
    gappy = altitude.copy()
    gappy[50:100], gappy[120] = np.nan, 0.0
    np.testing.assert_allclose(find(replace(level, altitude=gappy)).altitude, altitude, atol=1e-9)


def test_an_altimeter_that_hardly_ever_answered_is_left_out(level: Recording) -> None:
    altitude = np.full(200, np.nan)
    altitude[:10] = 30.0
    bottom = find(replace(level, altitude=altitude))
    assert np.isnan(bottom.altimeter_scale)
    np.testing.assert_allclose(bottom.altitude, 12.0, atol=RESOLUTION)


def test_fish_are_not_the_floor(level: Recording) -> None:
    # a school at 5 m in every ping, half a metre thick, louder than the floor
    port, starboard = level.port.copy(), level.starboard.copy()
    for side in (port, starboard):
        side[:, 100:110] += 1e6
    bottom = find(replace(level, port=port, starboard=starboard))
    np.testing.assert_allclose(bottom.first_bottom_return, 12.0, atol=RESOLUTION)


def test_the_altimeter_decides_between_two_floors(level: Recording) -> None:
    # a layer at 5 m, thick as no fish is
    port, starboard = level.port.copy(), level.starboard.copy()
    for side in (port, starboard):
        side[:, 100:180] += 1e6
    layer = replace(level, port=port, starboard=starboard)
    assert np.median(find(layer).altitude) < 6.0
    known = find(replace(layer, altitude=np.full(200, 12.0)))
    np.testing.assert_allclose(known.first_bottom_return, 12.0, atol=RESOLUTION)


def test_an_altimeter_that_is_altogether_wrong_is_not_followed(level: Recording) -> None:
    bottom = find(replace(level, altitude=np.full(200, 30.0)))
    np.testing.assert_allclose(bottom.first_bottom_return, 12.0, atol=RESOLUTION)
    assert bottom.altimeter_scale == pytest.approx(12.0 / 30.0, rel=0.01)


def test_a_nose_down_vehicle_is_lower_than_its_slant_range() -> None:
    bottom = find(replace(LEVEL, pitch=0.2).record(np.random.default_rng(5)))
    np.testing.assert_allclose(bottom.first_bottom_return, 12.0 / np.cos(0.2), atol=RESOLUTION)
    np.testing.assert_allclose(bottom.altitude, 12.0, atol=RESOLUTION)


def test_one_ping_is_enough_where_the_floor_is_clear() -> None:
    one = find(replace(LEVEL, altitude=LEVEL.altitude[:1], looks=16.0).record(np.random.default_rng(6)))
    np.testing.assert_allclose(one.first_bottom_return, 12.0, atol=RESOLUTION)


def test_the_middle_of_the_first_sample_is_given() -> None:
    echoes = np.where(np.arange(600) < 217, 1.0, 100.0) * np.ones((8, 1))
    echoes += np.random.default_rng(7).uniform(0, 0.1, echoes.shape)  # no edge stands out of nothing
    recording = replace(LEVEL, altitude=np.full(8, 9.0), n_samples=600).record(np.random.default_rng(7))
    bottom = find(replace(recording, port=echoes.astype(np.float32), starboard=echoes.astype(np.float32)))
    np.testing.assert_allclose(bottom.first_bottom_return, 217.5 * SPACING, rtol=1e-12)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("quantity", [Quantity.UNKNOWN, Quantity.LOG])
def test_pure_noise_has_no_bottom(seed: int, quantity: Quantity) -> None:
    noise = replace(LEVEL, strength=0.0).record(np.random.default_rng(seed), quantity)
    if quantity == Quantity.LOG:
        noise = replace(noise, port=10 * np.log10(noise.port), starboard=10 * np.log10(noise.starboard))
    with pytest.raises(ValueError, match="no first bottom return found on either side"):
        find(noise)


def test_noise_that_is_amplified_over_range_has_no_bottom() -> None:
    noise = replace(LEVEL, strength=0.0).record(np.random.default_rng(1))
    gain = (LEVEL.slant_range**3).astype(np.float32)
    with pytest.raises(ValueError, match="no first bottom return found on either side"):
        find(replace(noise, port=noise.port * gain, starboard=noise.starboard * gain))


def test_logarithms_show_the_same_bottom_as_what_they_are_of(level: Recording) -> None:
    steps = [
        np.clip(np.rint(40 * np.log10(side) + 60), 0, 255).astype(np.float32) for side in (level.port, level.starboard)
    ]
    logarithmic = replace(level, port=steps[0], starboard=steps[1], sonar=replace(level.sonar, quantity=Quantity.LOG))
    np.testing.assert_allclose(find(logarithmic).first_bottom_return, 12.0, atol=RESOLUTION)


def test_a_lost_side_follows_the_other_over_a_floor_that_falls() -> None:
    altitude = 12.0 + np.clip(np.arange(300) - 100, 0, 80) * 0.03
    recording = FlatFloor(altitude).record(np.random.default_rng(8))
    port = recording.port.copy()
    port[90:200] = 0
    bottom = find(replace(recording, port=port))
    assert bottom.is_found is not None
    assert not bottom.is_found[90:200, 0].any()
    # the filter follows the seen side, five pings at a time: 15 cm of fall between two of them
    assert np.abs(bottom.first_bottom_return - altitude[:, None]).max() < RESOLUTION + 0.15


def test_sample_spacing_may_change_during_the_dive() -> None:
    fine, coarse = LEVEL.record(np.random.default_rng(9)), LEVEL.record(np.random.default_rng(10))
    pairs = [(side[:, ::2] + side[:, 1::2]) / 2 for side in (coarse.port, coarse.starboard)]
    port, starboard = (np.pad(pair, ((0, 0), (0, 450)), constant_values=np.nan) for pair in pairs)
    spacing = np.r_[fine.sample_spacing[:100], 2 * coarse.sample_spacing[100:]]
    mixed = replace(
        fine,
        port=np.r_[fine.port[:100], port[100:]],
        starboard=np.r_[fine.starboard[:100], starboard[100:]],
        sample_spacing=spacing,
    )
    assert (np.abs(find(mixed).first_bottom_return - 12.0) < 1.5 * spacing[:, None] + 1e-9).all()


@pytest.mark.parametrize("roll_deg", [0.0, 15.0])
def test_roll_does_not_move_the_first_return_of_a_simulated_fan(roll_deg: float) -> None:
    text = f"""
    terrain = {{ size = [160.0, 120.0], depth = 30.0, layers = [] }}
    survey = {{ pattern = "legs", legs = [[-25.0, 0.0, 25.0, 0.0]] }}
    vehicle = {{ altitude = 10.0, waves = {{ roll_deg = {roll_deg}, period = 8.0 }} }}
    sonar = {{ range_max = 40.0, ping_rate = 4.0 }}
    """
    recording = simulate(parse_scene(text, "level.toml"))
    assert recording.truth is not None
    true = recording.truth.trajectory
    assert np.degrees(np.ptp(true.roll)) >= 1.5 * roll_deg
    altitude = 30.0 + true.z
    returned = altitude / np.cos(true.pitch)
    bottom = find(replace(recording, altitude=np.full(recording.n_pings, np.nan)))
    # the arrays hang 5 cm below the body and 10 cm beside it, which rolls up and down by 3 cm
    assert np.abs(bottom.first_bottom_return - returned[:, None]).max() < RESOLUTION + 0.08
    assert np.median(np.abs(bottom.altitude - altitude)) < RESOLUTION


def test_the_silent_tail_at_low_altitude_is_left_out(level: Recording) -> None:
    noise = replace(LEVEL, strength=0.0).record(np.random.default_rng(11))
    port = level.port.copy()
    port[:, 640:] = noise.port[:, 640:]
    bottom = find(replace(level, port=port))
    assert bottom.last_usable_sample is not None
    # found in cells of 15 cm, smoothed over five
    np.testing.assert_allclose(bottom.last_usable_sample[:, 0], 639, atol=15)
    np.testing.assert_array_equal(bottom.last_usable_sample[:, 1], 899)


def test_a_tail_of_amplified_noise_is_a_tail() -> None:
    floor, noise = (replace(LEVEL, strength=s).record(np.random.default_rng(12)) for s in (3e6, 0.0))
    gain = ((LEVEL.slant_range / 10) ** 2).astype(np.float32)
    port = np.where(np.arange(900) < 600, floor.port, noise.port) * gain
    bottom = find(replace(floor, port=port, starboard=floor.starboard * gain))
    assert bottom.last_usable_sample is not None
    np.testing.assert_allclose(bottom.last_usable_sample[:, 0], 599, atol=15)
    np.testing.assert_array_equal(bottom.last_usable_sample[:, 1], 899)


def test_a_shadow_to_the_end_is_no_tail() -> None:
    loud, noise = (replace(LEVEL, strength=s).record(np.random.default_rng(13)) for s in (1e8, 0.0))
    port = loud.port.copy()
    port[90:96, 500:] = noise.port[90:96, 500:]
    last = find(replace(loud, port=port)).last_usable_sample
    assert last is not None
    np.testing.assert_array_equal(last, 899)


def test_echoes_are_not_changed(level: Recording) -> None:
    before = level.port.copy(), level.starboard.copy()
    find(level)
    np.testing.assert_array_equal(level.port, before[0])
    np.testing.assert_array_equal(level.starboard, before[1])


@pytest.mark.skipif("SSSSLAM_DATA" not in os.environ, reason="SSSSLAM_DATA is not set: no real recording")
def test_a_recorded_bottom_is_smooth_and_near_the_altimeter() -> None:
    wreck = read(Path(os.environ["SSSSLAM_DATA"]) / "recordings" / "scotsman-iver2.xtf")
    bottom = find(wreck)
    # the altimeter sits elsewhere on the hull and hears another footprint: a few decimetres of five metres
    assert bottom.altimeter_scale == pytest.approx(1.0, abs=0.15)
    assert np.abs(bottom.first_bottom_return - bottom.altitude[:, None]).max() < 1.5
    assert np.abs(np.diff(bottom.first_bottom_return, axis=0)).max() < 0.3
    # both sides hear the same floor
    assert np.median(np.abs(np.diff(bottom.first_bottom_return, axis=1))) < 0.1
