"""Lowrance SL2 and SL3: frames made on purpose and read back."""

import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from frontend.recording import Quantity
from sssslam.readers import read
from tests.sssslam.readers.damage import check_survival, damaged
from tests.sssslam.readers.lowrance_files import FEET, OFFSETS, START, LowranceScene


@pytest.mark.parametrize("kind", [2, 3])
@pytest.mark.parametrize("channels", [(0, 5), (3, 4), (4, 0, 2, 3)])
def test_a_dive_reads_as_it_was_made(write, kind, channels):
    dive = LowranceScene(kind=kind, channels=channels)
    recording = read(write(dive.to_bytes(), "no.name"))
    np.testing.assert_array_equal(recording.port, dive.lines("port").astype(np.float32))
    np.testing.assert_array_equal(recording.starboard, dive.lines("starboard").astype(np.float32))
    # Feet in four bytes are good to 1e-7 of themselves.
    np.testing.assert_allclose(recording.sample_spacing, 0.5, rtol=1e-6)
    np.testing.assert_allclose(recording.altitude, 10.0, rtol=1e-6)
    np.testing.assert_allclose(recording.speed, 2.0, rtol=1e-6)
    np.testing.assert_allclose(recording.ping_time, dive.time, rtol=0, atol=1e-3)
    np.testing.assert_allclose(recording.trajectory_dr.yaw, np.pi / 2 - 0.1, rtol=1e-6)
    assert (recording.sonar.frequency, recording.sonar.quantity) == (455e3, Quantity.UNKNOWN)
    assert recording.n_dropped == 0


def test_positions_are_mercator_on_the_polar_radius(write):
    recording = read(write(LowranceScene().to_bytes()))
    # The map's north of 45 degrees is R ln(tan(67.5 degrees)).
    assert np.log(np.tan(np.radians(67.5))) * 6356752.3142 == pytest.approx(5_602_674, abs=0.5)
    assert recording.georeference.latitude == pytest.approx(45.0, abs=1e-5)
    assert recording.georeference.longitude == pytest.approx(np.degrees(1e6 / 6356752.3142))


def test_whole_metres_become_a_smooth_track(write):
    recording = read(write(LowranceScene(n_pings=600).to_bytes()))
    steps = np.diff(recording.trajectory_dr.y)
    # 0.1 m a ping; a crossing is known to one ping of the seven between crossings, and the sphere is 0.3 % small.
    np.testing.assert_allclose(steps[30:-30], 0.1, atol=0.1 / 6)


def test_composite_frames_of_odd_length_lose_the_middle_sample(write):
    dive = LowranceScene(n_pings=3)
    content = bytearray(dive.to_bytes())
    offset, code = OFFSETS[2]["packet"]
    first = 8 + 144 + 50 + 4
    struct.pack_into(f"<{code}", content, first + offset, 239)
    recording = read(write(bytes(content)))
    np.testing.assert_array_equal(recording.port[0, :119], dive.lines("port")[0, 1:].astype(np.float32))


def test_sides_whose_order_cannot_be_told_follow_the_custom(write, monkeypatch):
    pattern = np.tile(np.arange(120, dtype=np.uint8), (40, 1))
    monkeypatch.setattr(LowranceScene, "lines", lambda *_: pattern)
    recording = read(write(LowranceScene(frame={"depth": 0.0}).to_bytes()))
    np.testing.assert_array_equal(recording.starboard, pattern.astype(np.float32))
    assert np.isnan(recording.altitude).all()


def test_separate_sides_stored_far_end_first_are_turned_round(write, monkeypatch):
    dive = LowranceScene(channels=(3, 4))
    monkeypatch.setattr(
        LowranceScene,
        "samples",
        lambda s, k, c: s.lines("port" if c == 3 else "starboard")[k, ::-1].tobytes(),
    )
    recording = read(write(dive.to_bytes()))
    np.testing.assert_array_equal(recording.port, dive.lines("port").astype(np.float32))
    assert sum("is stored far end first (the echoes say so)" in note for note in recording.notes) == 2


def test_sides_are_matched_by_time(write):
    dive = LowranceScene(channels=(3, 4))
    content = bytearray(dive.to_bytes())
    size = 144 + 120 + 4
    # The place of the starboard frame of ping 5, which no longer names itself.
    struct.pack_into("<I", content, 8 + 11 * size, 0)
    recording = read(write(bytes(content)))
    assert (recording.n_pings, recording.n_dropped) == (39, 1)
    np.testing.assert_array_equal(recording.port[5], dive.lines("port")[6].astype(np.float32))
    said = f"{size} bytes are damaged or cut off and are skipped: at byte {8 + 11 * size}, behind 11 whole frames"
    assert said in recording.notes


def test_sides_of_different_length_are_compared_as_far_as_both_go(write):
    dive = LowranceScene(channels=(3, 4), frame={"depth": np.nan})
    longer = LowranceScene(channels=(3, 4), frame={"depth": np.nan}, n_samples=150, slant_range=75.0)
    content = bytearray(dive.to_bytes()[:8])
    for k in range(dive.n_pings):
        content += dive.one_frame(k, 3, len(content))
        content += longer.one_frame(k, 4, len(content))
    recording = read(write(bytes(content)))
    assert (recording.n_pings, recording.n_samples) == (40, 150)
    np.testing.assert_array_equal(recording.port[:, :120], dive.lines("port").astype(np.float32))
    np.testing.assert_array_equal(recording.starboard, longer.lines("starboard").astype(np.float32))
    assert np.isnan(recording.port[:, 120:]).all()


def test_a_missing_side_is_unknown_and_said(write):
    recording = read(write(LowranceScene(channels=(4,)).to_bytes()))
    assert np.isnan(recording.port).all()
    assert any("the file has no port channel" in note for note in recording.notes)


def test_either_pair_can_be_asked_for(write):
    path = write(LowranceScene(channels=(5, 3, 4)).to_bytes())
    for wanted in ("1,2", "3,4", "455 kHz"):
        expected = LowranceScene().lines("port").astype(np.float32)
        np.testing.assert_array_equal(read(path, channels=wanted).port, expected)


def test_without_compass_the_course_is_taken_and_said(write):
    recording = read(write(LowranceScene(frame={"heading": 0.0}).to_bytes()))
    np.testing.assert_allclose(recording.trajectory_dr.yaw, np.pi / 2 - 6.2 + 2 * np.pi, rtol=1e-6)
    assert any("no compass heading: the course of the GNSS is taken" in note for note in recording.notes)


def test_without_clock_times_are_counted_from_the_start(write):
    recording = read(write(LowranceScene(frame={"start": 0}).to_bytes()))
    assert recording.ping_time[0] == 0.0
    assert any("the file does not tell the start" in note for note in recording.notes)


def test_a_range_from_zero_is_that_of_each_side(write):
    recording = read(write(LowranceScene(frame={"low": 0.0}).to_bytes()))
    np.testing.assert_allclose(recording.sample_spacing, 0.5, rtol=1e-6)


@pytest.mark.parametrize("high", [0.0, -5.0, np.nan, np.inf])
def test_frames_without_range_are_no_side_scan(write, high):
    with pytest.raises(ValueError, match=r"no side-scan frame .*40 frames of channel 5"):
        read(write(LowranceScene(frame={"low": 0.0, "high": high}).to_bytes()))


def test_a_file_without_side_scan_is_refused(write):
    with pytest.raises(ValueError, match=r"no side-scan frame \(40 frames of channel 0\); channel 3, 4 or 5 is wanted"):
        read(write(LowranceScene(channels=(0,)).to_bytes()))
    with pytest.raises(ValueError, match=r"no side-scan frame \(no whole frame\)"):
        read(write(LowranceScene().to_bytes()[:100]))


def test_a_frame_longer_than_its_size_is_left_out(write):
    content = bytearray(LowranceScene().to_bytes())
    first = 8 + 144 + 50 + 4
    struct.pack_into("<H", content, first + OFFSETS[2]["packet"][0], 1000)
    assert read(write(bytes(content))).n_pings == 39


def test_a_unit_without_gnss_is_refused(write):
    with pytest.raises(ValueError, match="none of 40 pings has a position"):
        read(write(LowranceScene(frame={"x": 0, "y": 0}).to_bytes()))


def test_times_and_depths_are_what_the_scene_says():
    # The premise of the tests above: 10 m are 32.8 feet, and the clock starts in 2020.
    assert pytest.approx(32.8, abs=0.01) == 10 * FEET
    assert LowranceScene().time[0] == START


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from([2, 3]), channels=st.sampled_from([(5,), (3, 4)]))
def test_no_damage_makes_anything_but_a_recording_or_one_line(write, seed, kind, channels):
    content = LowranceScene(kind=kind, n_pings=6, n_samples=30, channels=channels).to_bytes()
    check_survival(write(damaged(content, np.random.default_rng(seed), keep=12)), 40)
