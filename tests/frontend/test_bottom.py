"""First bottom return on floors of known depth, through ringing, dropouts and a wrong altimeter."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from frontend.bottom import Bottom, BottomConfig, find_bottom
from frontend.recording import Recording
from sssslam.readers import read
from tests.frontend.flat_floor import SPACING, FlatFloor

# The search averages three samples: an edge is found to the sample, early by at most two.
RESOLUTION = 2 * SPACING + 1e-9
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
    # the mean of five pings begins where the nearest does: two pings of 7 cm early, besides the resolution
    error = bottom.first_bottom_return - altitude[:, None]
    assert np.abs(error).max() < RESOLUTION + 2 * 2.0 / 30


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


def test_the_altimeter_decides_between_two_edges(level: Recording) -> None:
    # a school of fish at 5 m, louder than the floor
    port, starboard = level.port.copy(), level.starboard.copy()
    for side in (port, starboard):
        side[:, 100:110] += 1e6
    fish = replace(level, port=port, starboard=starboard)
    assert np.median(find(fish).altitude) < 6.0
    known = find(replace(fish, altitude=np.full(200, 12.0)))
    np.testing.assert_allclose(known.first_bottom_return, 12.0, atol=RESOLUTION)


def test_a_nose_down_vehicle_is_lower_than_its_slant_range() -> None:
    bottom = find(replace(LEVEL, pitch=0.2).record(np.random.default_rng(5)))
    np.testing.assert_allclose(bottom.first_bottom_return, 12.0 / np.cos(0.2), atol=RESOLUTION)
    np.testing.assert_allclose(bottom.altitude, 12.0, atol=RESOLUTION)


def test_two_pings_are_a_track_and_one_is_not(level: Recording) -> None:
    one = level[:1]
    with pytest.raises(ValueError, match="no first bottom return found"):
        find(one)
    assert find(level[:2]).altitude.shape == (2,)


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
