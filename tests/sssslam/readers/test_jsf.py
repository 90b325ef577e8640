"""EdgeTech JSF: messages made on purpose and read back."""

import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from frontend.recording import Quantity
from sssslam.readers import read
from tests.sssslam.readers.damage import check_survival, damaged
from tests.sssslam.readers.jsf_files import (
    START,
    JsfScene,
    attitude,
    doppler,
    message,
    nmea,
    pressure,
    situation,
    situation_2,
)


def test_a_dive_reads_as_it_was_made(write):
    dive = JsfScene()
    recording = read(write(dive.to_bytes(), "no.name"))
    np.testing.assert_array_equal(recording.port, dive.lines(0).astype(np.float32))
    np.testing.assert_array_equal(recording.starboard, dive.lines(1).astype(np.float32))
    np.testing.assert_allclose(recording.sample_spacing, 40e-6 * 1480 / 2)
    np.testing.assert_allclose(recording.ping_time, dive.time, rtol=0, atol=1e-3)
    np.testing.assert_allclose(recording.altitude, 12.0)
    np.testing.assert_allclose(recording.depth, 5.0)
    # 3.88 knots: tenths in one field, hundredths in another.
    np.testing.assert_allclose(recording.speed, 3.88 * 1852 / 3600)
    assert (recording.sound_speed == 1480).all()
    assert recording.sonar.quantity == Quantity.AMPLITUDE
    assert recording.sonar.frequency == pytest.approx(230e3)
    assert recording.n_dropped == 0


def test_attitude_and_position_are_in_our_frames(write):
    trajectory = read(write(JsfScene().to_bytes())).trajectory_dr
    # A step of the angles is 180 / 32768 = 0.0055 degrees, half of which is lost by rounding.
    np.testing.assert_allclose(np.degrees(trajectory.pitch), -3.0, atol=0.003)
    np.testing.assert_allclose(np.degrees(trajectory.roll), 2.0, atol=0.003)
    np.testing.assert_allclose(np.degrees(trajectory.yaw), 88.5)
    np.testing.assert_allclose(trajectory.z, -5.0)
    # A ten-thousandth of a minute is 0.19 m.
    np.testing.assert_allclose(trajectory.y, 0.2 * np.arange(40), atol=0.19)
    np.testing.assert_allclose(trajectory.x, 0.0, atol=1e-6)


@pytest.mark.parametrize("data_format", [0, 1, 2, 3, 4, 9])
def test_each_data_format_gives_magnitudes(write, data_format):
    dive = JsfScene(data_format=data_format)
    recording = read(write(dive.to_bytes()))
    expected = dive.lines(0) // 5 * 5 if data_format in (1, 9) else dive.lines(0)
    np.testing.assert_array_equal(recording.port, expected.astype(np.float32))
    assert (recording.sonar.quantity == Quantity.AMPLITUDE) == (data_format in (0, 1))


def test_the_weighting_factor_scales_samples_by_powers_of_two(write):
    recording = read(write(JsfScene(weight=3).to_bytes()))
    np.testing.assert_array_equal(recording.port, (JsfScene().lines(0) / 8).astype(np.float32))


def test_a_weighting_factor_beyond_reason_is_not_applied(write):
    recording = read(write(JsfScene(weight=900).to_bytes()))
    np.testing.assert_array_equal(recording.port, JsfScene().lines(0).astype(np.float32))


def test_more_than_65535_samples_are_read(write):
    dive = JsfScene(n_pings=2, n_samples=66_000, sampling={20: 1000})
    recording = read(write(dive.to_bytes()))
    assert recording.n_samples == 66_000
    np.testing.assert_array_equal(recording.starboard, dive.lines(1).astype(np.float32))


def test_a_window_that_starts_late_is_put_at_its_range(write):
    recording = read(write(JsfScene(ping={"lead": 7}).to_bytes()))
    assert np.isnan(recording.port[:, :7]).all()
    np.testing.assert_array_equal(recording.port[:, 7:], JsfScene().lines(0).astype(np.float32))


def test_the_fraction_of_the_sampling_interval_counts(write):
    recording = read(write(JsfScene(ping={"lsb": 128}).to_bytes()))
    np.testing.assert_allclose(recording.sample_spacing, 40_000.5e-9 * 740, rtol=1e-12)


def test_the_finer_subsystem_is_taken_and_the_other_on_demand(write):
    dive = JsfScene(subsystems=(20, 21))
    path = write(dive.to_bytes())
    recording = read(path)
    np.testing.assert_array_equal(recording.port, dive.lines(0, 21).astype(np.float32))
    assert any("channels 3 port 540 kHz" in note and "also has 1 port 230 kHz" in note for note in recording.notes)
    for wanted in ("1,2", "230 kHz"):
        np.testing.assert_array_equal(read(path, channels=wanted).port, dive.lines(0, 20).astype(np.float32))
    with pytest.raises(ValueError, match="are no pair of port and starboard"):
        read(path, channels="1,3")


def test_sub_bottom_messages_are_not_side_scan(write):
    dive = JsfScene(frequencies={20: 230e3, 0: 12e3}, sampling={20: 40_000, 0: 10_000})
    data = b"".join(dive.sonar_data(k, 0, 0) + b"".join(dive.ping_messages(k)) for k in range(40))
    assert read(write(data)).sonar.frequency == pytest.approx(230e3)
    only = b"".join(dive.sonar_data(k, 0, 0) for k in range(3)) + message(182, bytes(24))
    words = r"no whole side-scan message \(3 messages of type 80, 1 messages of type 182\); type 80 of a side is wanted"
    with pytest.raises(ValueError, match=words):
        read(write(only))


def test_a_missing_side_is_unknown_and_said(write):
    recording = read(write(JsfScene(sides=(1,)).to_bytes()))
    assert np.isnan(recording.port).all()
    np.testing.assert_array_equal(recording.starboard, JsfScene().lines(1).astype(np.float32))
    assert any("the file has no port channel" in note for note in recording.notes)


def test_sides_are_matched_by_ping_number(write):
    dive = JsfScene()
    messages = [m for k in range(40) for m in dive.ping_messages(k)]
    del messages[11]
    recording = read(write(b"".join(messages)))
    assert (recording.n_pings, recording.n_dropped) == (39, 1)
    np.testing.assert_array_equal(recording.starboard[5], dive.lines(1)[6].astype(np.float32))


def test_sides_whose_numbers_repeat_are_matched_by_time(write):
    dive = JsfScene(ping={"ping": 7})
    messages = [m for k in range(40) for m in dive.ping_messages(k)]
    del messages[10]
    recording = read(write(b"".join(messages)))
    assert recording.n_pings == 39
    np.testing.assert_array_equal(recording.port[5], dive.lines(0)[6].astype(np.float32))


def test_milliseconds_in_another_time_zone_still_make_seconds_finer(write):
    milliseconds = np.round(1000 * ((JsfScene().time - 5.5 * 3600) % 86400)).astype(int)
    recording = read(write(JsfScene(ping={"milliseconds": milliseconds}).to_bytes()))
    np.testing.assert_allclose(recording.ping_time, JsfScene().time, rtol=0, atol=1e-3)


def test_whole_seconds_alone_are_spread_and_said(write):
    recording = read(write(JsfScene(n_pings=100, ping={"milliseconds": 0}).to_bytes()))
    assert any("repeat or come in bursts" in note for note in recording.notes)


def test_unflagged_numbers_are_unknown(write):
    recording = read(write(JsfScene(ping={"validity": 0b1}).to_bytes()))
    for name in ("altitude", "depth", "speed"):
        assert np.isnan(getattr(recording, name)).all()
    assert any("heading is not recorded: the course over ground is assumed" in note for note in recording.notes)


def test_files_without_any_flag_are_believed_and_that_is_said(write):
    recording = read(write(JsfScene(ping={"validity": 0, "depth": 0}).to_bytes()))
    np.testing.assert_allclose(recording.altitude, 12.0)
    assert np.isnan(recording.depth).all()
    assert any("no field of any ping is flagged as valid" in note for note in recording.notes)


@pytest.mark.parametrize(("units", "scale"), [(1, 1000), (3, 10), (4, 100)])
def test_grid_positions_are_metres_about_the_first_ping(write, units, scale):
    x = [round(scale * (500 + 0.5 * k)) for k in range(40)]
    recording = read(write(JsfScene(ping={"units": units, "x": x, "y": 4000 * scale}).to_bytes()))
    np.testing.assert_allclose(recording.trajectory_dr.x, 0.5 * np.arange(40), atol=1e-3 + 0.1 * (scale == 10))
    assert recording.georeference is None


def test_sound_speed_that_cannot_be_is_assumed_and_said(write):
    recording = read(write(JsfScene(ping={"sound_speed": 0.0}).to_bytes()))
    assert (recording.sound_speed == 1500).all()
    assert any("sound speed is missing or implausible in 40 of 40 pings" in note for note in recording.notes)


def test_attitude_messages_are_interpolated_to_the_pings(write):
    times = START + 0.5 * np.arange(-2, 12)
    messages = b"".join(attitude(t, 4.0 + (t - START), -1.0) for t in times)
    recording = read(write(messages + JsfScene().to_bytes()))
    expected = -(4.0 + (recording.ping_time - START))
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.pitch), expected, atol=0.006)
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.roll), -1.0, atol=0.003)
    assert any("pitch and roll are interpolated from 14 attitude messages" in note for note in recording.notes)


def test_attitude_messages_from_another_time_are_not_taken(write):
    recording = read(write(attitude(START - 100, 9.0, 9.0) + JsfScene().to_bytes()))
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.pitch), -3.0, atol=0.003)


def test_heading_of_attitude_messages_serves_where_pings_have_none(write):
    times = START + 0.5 * np.arange(-2, 12)
    # Through north: the mean of 359 and 1 degrees is 0.
    messages = b"".join(attitude(t, 0, 0, 359 if k % 2 else 1, 1 << 9) for k, t in enumerate(times))
    recording = read(write(messages + JsfScene(ping={"validity": 0b1}).to_bytes()))
    assert np.abs(np.degrees(recording.trajectory_dr.yaw) - 90).max() < 1.01


def test_nmea_positions_serve_where_pings_have_none(write):
    sentences = (
        "GPGGA,120000.00,4530.0000,N,00515.0000,W,1,10,0.9,10.0,M,,M,,",
        "GPRMC,120000.00,A,4530.0000,N,00515.0000,W,1.0,0.0,010120,,,A",
        "GPGLL,4530.0000,N,00515.0000,W,120000.00,A",
    )
    for sentence in sentences:
        data = nmea(START - 1, sentence) + JsfScene(ping={"x": 0, "y": 0}).to_bytes()
        recording = read(write(data))
        assert recording.georeference.latitude == pytest.approx(45.5)
        assert recording.georeference.longitude == pytest.approx(-5.25)
        assert any("those of the NMEA strings are taken" in note for note in recording.notes)


def test_void_nmea_positions_are_not_taken(write):
    void = nmea(START - 1, "GPRMC,120000.00,V,4530.0000,N,00515.0000,W,1.0,0.0,010120,,,N")
    broken = nmea(START - 1, "GPGGA,120000.00,4530.0000,N,00515.0000,W,1,10").replace(b"4530", b"4630")
    with pytest.raises(ValueError, match="none of 40 pings has a position"):
        read(write(void + broken + JsfScene(ping={"x": 0, "y": 0}).to_bytes()))


NO_NAVIGATION = {"validity": 1 << 14, "x": 0, "y": 0}
SPAN = START + 0.5 * np.arange(-1, 12)


def _north(time: float) -> tuple[float, float]:
    """Latitude and longitude 2 m/s north of a start."""
    return 45.0 + float(np.degrees(2.0 * (time - START) / 6367381.8)), 5.0


def test_a_situation_message_gives_all_that_pings_lack(write):
    said = b"".join(situation(t, _north(t), 359.0 if k % 2 else 1.0) for k, t in enumerate(SPAN.tolist()))
    recording = read(write(said + JsfScene(ping=NO_NAVIGATION).to_bytes()))
    track = recording.trajectory_dr
    # Fixes as doubles of degrees, twice a second on a straight course: the meridian's millimetres over 8 m.
    np.testing.assert_allclose(track.y, 0.2 * np.arange(40), atol=5e-3)
    np.testing.assert_allclose(np.degrees(track.roll), 1.0)
    np.testing.assert_allclose(np.degrees(track.pitch), -2.0)
    # Headings swing by a degree about north, the short way round.
    assert np.abs(np.degrees(track.yaw) - 90).max() <= 1 + 1e-9
    np.testing.assert_allclose(recording.depth, 30.0)
    np.testing.assert_allclose(recording.speed, 1.5)
    assert "position is interpolated from situation messages (2090)" in recording.notes
    assert any(note.startswith("roll, pitch, heading, depth, speed: no ping holds any") for note in recording.notes)


@pytest.mark.parametrize(
    ("kind", "velocity", "speed"),
    [(0, (3.0, 4.0), 5.0), (1, (1.5, 0.7), 1.5), (2, (np.sqrt(2.0), 0.0), 1.0), (2, (0.0, -np.sqrt(2.0)), 1.0)],
)
def test_the_second_situation_message_is_better_than_the_first(write, kind, velocity, speed):
    first = b"".join(situation(t, (50.0, 6.0), 20.0) for t in SPAN.tolist())
    second = b"".join(situation_2(t, _north(t), kind, velocity) for t in SPAN.tolist())
    recording = read(write(first + second + JsfScene(ping=NO_NAVIGATION).to_bytes()))
    assert recording.georeference.latitude == pytest.approx(45.0, abs=1e-4)
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.yaw), 80.0, atol=1e-5)
    np.testing.assert_allclose(recording.altitude, 9.0)
    # A velocity is a float32.
    np.testing.assert_allclose(recording.speed, speed, rtol=1e-6)


def test_positions_of_a_situation_message_are_finer_than_those_of_pings(write):
    dive = JsfScene(ping={"x": 3_000_000, "y": 27_000_000})
    said = [situation(t, _north(t), 15.0) for t in SPAN.tolist()]
    recording = read(write(b"".join(said) + dive.to_bytes()))
    np.testing.assert_allclose(recording.trajectory_dr.y, 0.2 * np.arange(40), atol=5e-3)
    # What pings hold stays, and a few fixes at the start are no track.
    np.testing.assert_allclose(recording.depth, 5.0)
    assert read(write(b"".join(said[:3]) + dive.to_bytes())).trajectory_dr.distance[-1] == 0


@pytest.mark.parametrize(
    ("velocity", "flags", "speed"),
    [
        ((300, 1400), 0b101_1110_0011, 1.4),
        ((300, 400), 0b101_1110_0001, 0.5),
        ((300, -32768), 0b101_1110_0011, np.nan),
        ((300, 400), 0b101_1110_0010, np.nan),
        ((300, 400), 1 << 31 | 0b101_1110_0011, np.nan),
    ],
)
def test_a_doppler_log_gives_speed_ahead_altitude_and_depth(write, velocity, flags, speed):
    said = b"".join(doppler(t, velocity, flags) for t in SPAN.tolist())
    ping = {"validity": 1 | 1 << 14}
    recording = read(write(said + JsfScene(ping=ping).to_bytes()))
    np.testing.assert_allclose(recording.speed, speed)
    is_sound = not flags >> 31
    np.testing.assert_allclose(recording.altitude, 8.0 if is_sound else np.nan)
    np.testing.assert_allclose(recording.depth, 31.0 if is_sound else np.nan)
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.yaw), 91.0)
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.pitch), -3.0)
    np.testing.assert_allclose(np.degrees(recording.trajectory_dr.roll), -1.0)


def test_a_pressure_sensor_gives_depth_where_nothing_better_does(write):
    said = b"".join(pressure(t, 12) for t in SPAN.tolist())
    lacking = JsfScene(ping={"validity": 1 | 1 << 14})
    np.testing.assert_allclose(read(write(said + lacking.to_bytes())).depth, 12.0)
    np.testing.assert_allclose(read(write(said + JsfScene().to_bytes())).depth, 5.0)
    unsaid = b"".join(pressure(t, 12, 0) for t in SPAN.tolist())
    assert np.isnan(read(write(unsaid + lacking.to_bytes())).depth).all()


@pytest.mark.parametrize("size", [-1, 0, 3, 600, 2**31 - 1])
def test_a_size_that_lies_costs_its_own_ping_only(write, size):
    dive = JsfScene()
    messages = [bytearray(m) for k in range(40) for m in dive.ping_messages(k)]
    struct.pack_into("<i", messages[20], 12, size)
    recording = read(write(b"".join(messages)))
    assert recording.n_pings == 39
    # A size that is too small is that of a whole message of nothing, behind which the damage starts.
    place = 20 * len(messages[0]) + (16 + size if 0 <= size < 16 else 0)
    assert any(f"skipped: at byte {place}, behind 2" in note for note in recording.notes)


def test_more_samples_than_the_message_holds_are_refused(write):
    with pytest.raises(ValueError, match="no whole side-scan message"):
        read(write(JsfScene(ping={"samples": 121}).to_bytes()))


def test_a_window_that_starts_beyond_reason_is_refused(write):
    with pytest.raises(ValueError, match="the file holds no whole ping with samples on both sides"):
        read(write(JsfScene(ping={"lead": 2**31}).to_bytes()))


def test_a_range_that_cannot_be_is_refused(write):
    with pytest.raises(ValueError, match="no ping has a slant range that can be"):
        read(write(JsfScene(sampling={20: 2**32 - 1}).to_bytes()))


def test_files_of_one_dive_share_the_frame_and_units_do_not_mix(write):
    dive = JsfScene()
    early = b"".join(b"".join(dive.ping_messages(k)) for k in range(20))
    late = b"".join(b"".join(dive.ping_messages(k)) for k in range(20, 40))
    joined = read(write(late, "late.jsf"), write(early, "early.jsf"))
    whole = read(write(dive.to_bytes()))
    np.testing.assert_allclose(joined.trajectory_dr.y, whole.trajectory_dr.y, atol=0.2)
    grid = write(JsfScene(ping={"units": 1, "time": START + 1000}).to_bytes(), "grid.jsf")
    with pytest.raises(ValueError, match="one has positions in degrees and one in metres"):
        read(write(early, "early.jsf"), grid)


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_no_damage_makes_anything_but_a_recording_or_one_line(write, seed):
    sensors = situation(START, (45.0, 5.0), 10.0) + situation_2(START, (45.0, 5.0)) + doppler(START, (0, 1500))
    content = (
        attitude(START, 1, 1)
        + sensors
        + pressure(START, 9)
        + JsfScene(n_pings=6, n_samples=30, subsystems=(20, 21)).to_bytes()
    )
    check_survival(write(damaged(content, np.random.default_rng(seed), keep=16)), 60)
