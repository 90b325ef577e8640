"""Raw packets of XTF: attitude, gyro and positions beside the pings serve where the ping headers fall short."""

import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import pyxtf

from sssslam.readers.xtf import read_xtf
from sssslam.readers.xtf_packets import index_packets, map_file, read_file_header
from sssslam.readers.xtf_raw_packets import read_raw_series

START = 1_700_000_000.0
METRES_PER_DEGREE = 6367381.8 * np.pi / 180  # the meridian at 45 degrees north, WGS 84


def _stamped(packet, time: float, fraction: str, unit: float):
    """A packet with its time: civil fields and a fraction of the second in some unit."""
    stamp = datetime.fromtimestamp(int(time + 1e-7), UTC)
    packet.Year, packet.Month, packet.Day = stamp.year, stamp.month, stamp.day
    packet.Hour, packet.Minute, packet.Second = stamp.hour, stamp.minute, stamp.second
    setattr(packet, fraction, round((time - int(time + 1e-7)) / unit))
    packet.NumBytesThisRecord = 64
    return packet


def _attitude(time: float, roll: float, pitch: float, heading: float) -> bytes:
    packet = _stamped(pyxtf.XTFAttitudeData(), time, "Millisecond", 1e-3)
    packet.HeaderType, packet.Roll, packet.Pitch, packet.Heading = 3, roll, pitch, heading
    return bytes(packet)


def _raw_position(time: float, north: float, unit: float = 1e-4, kind: int = 107) -> bytes:
    maker = pyxtf.XTFPosRawNavigation if kind == 107 else pyxtf.XTFHeaderNavigation
    packet = _stamped(maker(), time, "Microsecond", unit)
    packet.HeaderType, packet.RawXcoordinate, packet.RawYcoordinate = kind, 5.0, 45.0 + north / METRES_PER_DEGREE
    return bytes(packet)


def _gyro(time: float, heading: float) -> bytes:
    packet = _stamped(pyxtf.XTFHeaderGyro(), time, "Microsecond", 1e-4)
    packet.HeaderType, packet.Gyro = 84, heading
    return bytes(packet)


def _times(dive, rate: float) -> np.ndarray:
    return START + np.arange(0.0, dive.n_pings * dive.interval + 0.3, 1 / rate)


def _file(dive, raw: list[bytes]) -> bytes:
    """Raw packets before, between and after the pings; the time in them orders them, not their place."""
    half = len(raw) // 2
    return dive.header() + b"".join(raw[:half] + dive.packets() + raw[half:])


def test_attitude_that_pings_lack_is_interpolated_from_packets_of_type_3(scene, write):
    dive = scene(ping={"SensorRoll": 0.0, "SensorPitch": 0.0, "SensorHeading": 0.0})
    raw = [_attitude(t, t - START, -2 * (t - START), 359 + (t - START)) for t in _times(dive, 20)]
    recording = read_xtf(write(_file(dive, raw)))
    s = dive.time - START
    # Millisecond stamps and float32 angles: a thousandth of a degree.
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.roll), s, atol=2e-3)
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.pitch), 2 * s, atol=2e-3)
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.yaw), 91 - s, atol=2e-3)
    assert "heading is taken from packets of type 3: the ping headers have none" in recording.notes


def test_a_held_heading_gives_way_to_a_finer_one_that_agrees(scene, write):
    turn = 5.0 * 0.1 * np.arange(40)
    dive = scene(ping={"SensorHeading": np.repeat(turn[::10], 10) + 10})
    raw = [_gyro(t, 10 + 5 * (t - START)) for t in _times(dive, 25)]
    recording = read_xtf(write(_file(dive, raw)))
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.yaw), 80 - turn, atol=2e-3)
    assert any("heading is taken from packets of type 84: finer than the ping headers" in n for n in recording.notes)


def test_a_sensor_that_disagrees_is_not_taken_and_said(scene, write):
    dive = scene(ping={"SensorHeading": np.repeat(5.0 * 0.1 * np.arange(40)[::10], 10) + 10})
    raw = [_gyro(t, 100 + 5 * (t - START)) for t in _times(dive, 25)]
    recording = read_xtf(write(_file(dive, raw)))
    assert any("heading of packets of type 84 is 9" in n and "is kept" in n for n in recording.notes)
    assert np.degrees(recording.trajectory_dr.yaw[0]) == pytest.approx(80)


@pytest.mark.parametrize(("kind", "unit"), [(107, 1e-4), (42, 1e-4), (42, 1e-6)])
def test_positions_that_pings_hold_come_from_raw_packets_at_their_own_times(scene, write, kind, unit):
    held = 45.0 + np.repeat(np.arange(4.0) * 2.0, 10) / METRES_PER_DEGREE
    dive = scene(ping={"SensorYcoordinate": held})
    raw = [_raw_position(t, 2.0 * (t - START), unit, kind) for t in _times(dive, 10)]
    recording = read_xtf(write(_file(dive, raw)))
    # The stamps of the packets are as fine as a tenth of a millisecond: 0.2 mm at 2 m/s; the projection adds 1 mm.
    np.testing.assert_allclose(recording.trajectory_dr.y, 2.0 * (dive.time - START), atol=2e-3)
    assert any(f"position is taken from packets of type {kind}" in note for note in recording.notes)


def test_a_file_whose_pings_have_no_position_is_read_by_its_raw_positions(scene, write):
    dive = scene(ping={"SensorYcoordinate": 0.0, "SensorXcoordinate": 0.0})
    raw = [_raw_position(t, 2.0 * (t - START)) for t in _times(dive, 5)]
    recording = read_xtf(write(_file(dive, raw)))
    assert recording.n_pings == 40
    np.testing.assert_allclose(recording.trajectory_dr.y, 2.0 * (dive.time - START), atol=2e-3)


def test_packets_that_cover_half_the_pings_or_are_coarser_change_nothing(scene, write):
    dive = scene()
    plain = read_xtf(write(dive.to_bytes()))
    half = [_attitude(t, 9.0, 9.0, 9.0 + t % 1) for t in _times(dive, 50) if t < START + 2]
    coarse = [_attitude(t, 2.0, 3.0, 1.0 + t - START) for t in _times(dive, 1)]
    for raw in (half, coarse):
        recording = read_xtf(write(_file(dive, raw)))
        np.testing.assert_array_equal(recording.trajectory_dr.yaw, plain.trajectory_dr.yaw)
        assert recording.notes == plain.notes


def test_impossible_fields_of_raw_packets_are_no_navigation(scene, write):
    dive = scene()
    plain = read_xtf(write(dive.to_bytes()))
    bad_time = [_attitude(t, 2.0, 3.0, t - START).replace(b"\xe7\x07", b"\x00\x00") for t in _times(dive, 50)]
    bad_value = [_attitude(t, np.nan, 1e30, np.inf) for t in _times(dive, 50)]
    for raw in (bad_time, bad_value):
        recording = read_xtf(write(_file(dive, raw)))
        np.testing.assert_array_equal(recording.trajectory_dr.poses, plain.trajectory_dr.poses)


@pytest.mark.skipif("SSSSLAM_DATA" not in os.environ, reason="SSSSLAM_DATA is not set: no real recordings")
def test_real_raw_packets_come_every_40_milliseconds():
    data = map_file(Path(os.environ["SSSSLAM_DATA"]) / "recordings" / "r2sonic-no-sidescan.xtf")
    raw = read_raw_series(data, index_packets(data, read_file_header(data).start))
    kinds = {name: kind for name, (_, kind) in raw.items()}
    assert kinds == {"roll": 3, "pitch": 3, "heading": 3, "east": 107, "north": 107}
    for series, _ in raw.values():
        assert len(series.time) > 1190
        np.testing.assert_allclose(np.median(np.diff(series.time)), 0.04, atol=1e-6)
    assert np.degrees(raw["heading"][0].values).min() == pytest.approx(242.515, abs=1e-3)
