"""StarFish: logs made on purpose and read back, and the one real log."""

import os
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from frontend.recording import Quantity
from sssslam.readers import read
from tests.sssslam.readers.damage import check_survival, damaged
from tests.sssslam.readers.starfish_files import StarfishScene


def test_a_log_reads_as_it_was_made(write):
    dive = StarfishScene()
    recording = read(write(dive.to_bytes(), "no.name"))
    for side in ("port", "starboard"):
        np.testing.assert_array_equal(getattr(recording, side), dive.lines(side).astype(np.float32))
    np.testing.assert_allclose(recording.sample_spacing, 0.5)
    np.testing.assert_allclose(recording.ping_time, dive.time, rtol=0, atol=1e-3)
    np.testing.assert_allclose(recording.altitude, 10.0)
    np.testing.assert_allclose(recording.trajectory_dr.z, -0.5)
    assert (recording.sound_speed == 1475.0).all()
    assert (recording.sonar.frequency, recording.sonar.quantity) == (450e3, Quantity.UNKNOWN)
    assert np.isnan(recording.sonar.mounting_depression)
    assert recording.n_dropped == 0


def test_utm_becomes_true_metres_about_the_first_ping(write):
    recording = read(write(StarfishScene().to_bytes()))
    # On the central meridian grid north is north and the scale is 0.9996, which the scene multiplies by.
    np.testing.assert_allclose(recording.trajectory_dr.y, 0.06 * np.arange(40), atol=1e-4)
    np.testing.assert_allclose(recording.trajectory_dr.x, 0.0, atol=1e-4)
    np.testing.assert_allclose(recording.trajectory_dr.yaw, np.pi / 2 - np.radians(1.0))
    assert recording.georeference.longitude == pytest.approx(-57.0)


def test_southern_bands_are_south_of_the_equator(write):
    recording = read(write(StarfishScene(zone=(b"H", 21), northing=6_200_000.0).to_bytes()))
    assert -36 < recording.georeference.latitude < -33


@pytest.mark.parametrize(
    ("unit", "name"), [(1.0, "m/s"), (3.6, "km/h"), (3600 / 1852, "knots"), (1 / 0.44704, "miles per hour")]
)
def test_the_unit_of_speed_is_told_by_the_track(write, unit, name):
    recording = read(write(StarfishScene(n_pings=100, speed_unit=unit).to_bytes()))
    np.testing.assert_allclose(recording.speed, 1.2, rtol=1e-6)
    assert any(f"{name} fits the track" in note for note in recording.notes)


def test_a_speed_that_fits_the_track_in_no_unit_is_unknown(write):
    recording = read(write(StarfishScene(n_pings=100, speed_unit=10.0).to_bytes()))
    assert np.isnan(recording.speed).all()
    assert any("none fits the track" in note for note in recording.notes)


def test_a_speed_without_a_track_is_unknown(write):
    dive = StarfishScene(n_pings=2, interval=1e-3, stamps=np.full(2, 1.45e9))
    recording = read(write(dive.to_bytes()))
    assert any("the track does not tell: speed is unknown" in note for note in recording.notes)


def test_stamps_in_bursts_are_spread_and_said(write):
    k = np.arange(400)
    dive = StarfishScene(n_pings=400, stamps=1.45e9 + 0.05 * 4 * (k // 4))
    recording = read(write(dive.to_bytes()))
    assert any("come in bursts and are re-spread" in note for note in recording.notes)
    # Lines are fitted over about four bursts, of which a window holds one more or less: a fifth of an interval.
    np.testing.assert_allclose(np.diff(recording.ping_time)[20:-20], 0.05, atol=0.05 / 5)


def test_sides_stored_far_end_first_are_turned_round_and_said(write):
    dive = StarfishScene(far_end_first=True)
    recording = read(write(dive.to_bytes()))
    np.testing.assert_array_equal(recording.port, dive.lines("port").astype(np.float32))
    np.testing.assert_array_equal(recording.starboard, dive.lines("starboard").astype(np.float32))
    assert sum("stored far end first" in note for note in recording.notes) == 2


def test_a_damaged_packet_costs_its_own_ping_only(write):
    packets = StarfishScene().packets()
    packets[5 * 6 + 5] = packets[5 * 6 + 5][:100] + b"\x55\x66" + packets[5 * 6 + 5][102:]
    recording = read(write(StarfishScene().head() + b"".join(packets)))
    assert recording.n_pings == 39
    start, damaged = (len(b"".join(part)) for part in ((StarfishScene().head(), *packets[:35]), packets[35:36]))
    said = f"{damaged} bytes are damaged or cut off and are skipped: at byte {start}, behind 35 whole packets"
    assert said in recording.notes


def test_a_packet_inside_another_is_no_packet(write):
    dive = StarfishScene(n_pings=3)
    inner = dive.packet(0, 0x26, dive.payload(0, 0x26))
    data = dive.to_bytes() + dive.packet(0, 0x30, inner)
    assert read(write(data)).n_pings == 3


def test_missing_settings_are_assumed_and_said(write):
    recording = read(write(StarfishScene(properties={}).to_bytes()))
    assert (recording.sound_speed == 1500.0).all()
    assert np.isnan(recording.sonar.frequency)
    assert any("sound speed is missing or implausible: 1500 m/s is assumed" in note for note in recording.notes)


def test_a_setting_that_is_no_number_is_unknown(write):
    recording = read(write(StarfishScene(properties={r"\Environment|WaterVos": "fast"}).to_bytes()))
    assert (recording.sound_speed == 1500.0).all()


def test_a_log_without_side_scan_is_refused(write):
    path = write(StarfishScene(n_pings=2, opcodes=(0x21, 0x20)).to_bytes())
    words = r"no side-scan packet \(2 packets of type 0x20, 2 packets of type 0x21\); type 0x26 is wanted"
    with pytest.raises(ValueError, match=words):
        read(path)
    with pytest.raises(ValueError, match=r"no side-scan packet \(no whole packet\)"):
        read(write(StarfishScene().head()))


def test_side_scan_without_range_is_refused_with_its_place(write):
    dive = StarfishScene(slant_range=0.0, n_samples=0)
    with pytest.raises(ValueError, match=r"none of 40 side-scan packets holds a range .*first at byte \d+"):
        read(write(dive.to_bytes()))


def test_a_log_without_position_is_refused(write):
    with pytest.raises(ValueError, match="none of 40 pings has a position"):
        read(write(StarfishScene(zone=(b"P", 61)).to_bytes()))


def test_channels_of_a_log_cannot_be_chosen(write):
    with pytest.raises(ValueError, match="channels '1,2' were asked for; a StarFish log holds one pair only"):
        read(write(StarfishScene().to_bytes()), channels="1,2")


def test_sides_of_unlike_length_are_dropped(write):
    dive = StarfishScene(n_pings=3)
    side = struct.pack("<4fI", 38.0, 0.0, -42.0, 60.0, 10)
    lame = dive.packet(1, 0x26, side + bytes(10) + struct.pack("<4fI", 38.0, 0.0, -42.0, 60.0, 4) + bytes(10))
    recording = read(write(dive.to_bytes() + lame))
    assert (recording.n_pings, recording.n_dropped) == (3, 1)


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_no_damage_makes_anything_but_a_recording_or_one_line(write, seed):
    content = StarfishScene(n_pings=6, n_samples=30).to_bytes()
    check_survival(write(damaged(content, np.random.default_rng(seed), keep=20)), 40)


def test_the_reef_dive_reads_as_its_description_says():
    folder = os.environ.get("SSSSLAM_DATA")
    if not folder:
        pytest.skip("SSSSLAM_DATA is not set: no real recordings")
    recording = read(Path(folder) / "recordings" / "starfish-iver2-barbados.logdoc")
    assert (recording.n_pings, recording.n_samples, recording.n_dropped) == (3259, 500, 0)
    np.testing.assert_allclose(recording.slant_range_max, 30.0)
    assert 151 < recording.trajectory_dr.distance[-1] < 154
    assert 23.5 < 1 / np.median(np.diff(recording.ping_time)) < 24.3
    assert recording.altitude.min() > 1.9
    assert recording.altitude.max() < 5.7
    # 152 m in 136 s are 1.12 m/s; a recorded speed may differ by the 7.5 % within which its unit is believed.
    assert np.mean(recording.speed) == pytest.approx(1.12, rel=0.075)
