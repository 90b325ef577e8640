"""XTF: each oddity of the format, made on purpose and read back."""

import math
import os
import struct
from pathlib import Path

import numpy as np
import pytest
import pyxtf
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from frontend.recording import Quantity
from sssslam.readers import read
from sssslam.readers.xtf import read_xtf
from tests.sssslam.readers.damage import check_survival, damaged

START = 1_700_000_000.0


@pytest.mark.parametrize("n_bytes", [1, 2, 4])
@pytest.mark.parametrize("port_far_first", [True, False])
def test_samples_of_every_size_and_order_come_out_near_end_first(scene, write, n_bytes, port_far_first):
    dive = scene(n_bytes=n_bytes, port_far_first=port_far_first)
    recording = read_xtf(write(dive.to_bytes()))
    assert recording.port.dtype == np.float32
    np.testing.assert_array_equal(recording.port, dive.lines("p").astype(np.float32))
    np.testing.assert_array_equal(recording.starboard, dive.lines("s").astype(np.float32))
    order = "far" if port_far_first else "near"
    assert any(f"port is stored {order} end first" in note for note in recording.notes)


def test_port_order_is_found_without_altitude_by_likeness_to_starboard(scene, write):
    dive = scene(port_far_first=False, ping={"SensorPrimaryAltitude": 0.0})
    recording = read_xtf(write(dive.to_bytes()))
    np.testing.assert_array_equal(recording.port, dive.lines("p").astype(np.float32))
    assert np.isnan(recording.altitude).all()


def test_port_that_tells_nothing_follows_the_custom_and_says_so(scene, write, monkeypatch):
    flat = np.full((40, 120), 7, dtype="<u2")
    monkeypatch.setattr(scene, "lines", lambda *_: flat)
    recording = read_xtf(write(scene().to_bytes()))
    assert any("the echoes do not tell its order" in note for note in recording.notes)


def test_starboard_stored_far_end_first_is_turned_round_and_said(scene, write):
    dive = scene(starboard_far_first=True)
    recording = read_xtf(write(dive.to_bytes()))
    np.testing.assert_array_equal(recording.starboard, dive.lines("s").astype(np.float32))
    assert any("starboard is stored far end first" in note for note in recording.notes)


def test_four_byte_floats_are_read_and_infinities_are_unknown(scene, write):
    dive = scene(n_bytes=4, sample_format=5)
    data = bytearray(dive.to_bytes())
    data[1024 + 256 + 64 :][:4] = b""
    struct.pack_into("<f", data, 1024 + 256 + 64, np.inf)
    recording = read_xtf(write(bytes(data)))
    expected = dive.lines("p").astype(np.float32)
    expected[0, -1] = np.nan
    np.testing.assert_array_equal(recording.port, expected)


def test_weight_scales_samples_by_powers_of_two(scene, write):
    recording = read_xtf(write(scene(weight=3).to_bytes()))
    np.testing.assert_array_equal(recording.port, scene().lines("p") / np.float32(8))


def test_a_gain_that_is_changed_is_said(scene, write):
    recording = read_xtf(write(scene(block={"GainCode": np.repeat([3, 7], 20)}).to_bytes()))
    assert "the gain of port changes 1 times (codes 3 to 7): its brightness jumps there" in recording.notes
    assert not any("the gain of" in note for note in read_xtf(write(scene(block={"GainCode": 5}).to_bytes())).notes)


def test_navigation_follows_the_conventions_of_the_house(scene, write):
    recording = read_xtf(write(scene().to_bytes()))
    trajectory, k = recording.trajectory_dr, np.arange(40)
    # 45 degrees north: the meridian's radius there is 6367381.8 m (WGS 84); 1 mm over 8 m is its rounding.
    np.testing.assert_allclose(trajectory.y, 0.2 * k, atol=1e-3)
    np.testing.assert_allclose(trajectory.x, 0.0, atol=1e-6)
    # Fields are float32: one part in 1e7 of a degree.
    np.testing.assert_allclose(trajectory.yaw, np.radians(89.0 - 0.01 * k), atol=1e-7)
    np.testing.assert_allclose(trajectory.pitch, -np.radians(3.0 + 0.01 * k), atol=1e-7)
    np.testing.assert_allclose(trajectory.roll, np.radians(2.0 + 0.01 * k), atol=1e-7)
    np.testing.assert_allclose(trajectory.z, -(5.0 + 0.01 * k), atol=1e-6)
    np.testing.assert_allclose(recording.depth, -trajectory.z)
    np.testing.assert_allclose(recording.altitude, 10.0)
    np.testing.assert_allclose(recording.speed, 2.0, rtol=1e-6)
    np.testing.assert_allclose(trajectory.time, START + 0.1 * k, rtol=0, atol=1e-6)
    assert recording.georeference.latitude == 45.0
    assert recording.georeference.longitude == 5.0


def test_geometry_comes_from_range_and_one_way_sound_speed(scene, write):
    channel = {
        "BeamWidth": 50.0,
        "HorizBeamAngle": 1.0,
        "TiltAngle": 20.0,
        "OffsetX": 0.5,
        "OffsetY": 2.0,
        "OffsetZ": 0.25,
    }
    recording = read_xtf(write(scene(channel=channel).to_bytes()))
    np.testing.assert_allclose(recording.sample_spacing, 0.5)
    np.testing.assert_allclose(recording.sound_speed, 1500.0)
    sonar = recording.sonar
    assert sonar.frequency == 600e3
    assert sonar.vertical_beamwidth == pytest.approx(math.radians(50))
    assert sonar.horizontal_beamwidth == pytest.approx(math.radians(1))
    assert sonar.mounting_depression == pytest.approx(math.radians(20))
    assert sonar.lever_arm_port == (2.0, -0.5, -0.25)
    assert sonar.quantity is Quantity.UNKNOWN


@pytest.mark.parametrize(
    ("velocity", "computed", "expected"),
    [(1480.0, 0.0, 1480.0), (740.0, 0.0, 1480.0), (0.0, 1510.0, 1510.0), (0.0, 0.0, 1500.0), (np.nan, np.inf, 1500.0)],
)
def test_sound_speed_is_doubled_where_it_is_one_way_and_assumed_where_missing(
    scene, write, velocity, computed, expected
):
    dive = scene(ping={"SoundVelocity": velocity, "ComputedSoundVelocity": computed})
    recording = read_xtf(write(dive.to_bytes()))
    np.testing.assert_allclose(recording.sound_speed, expected)
    is_assumed = computed in (0.0, np.inf) and not velocity > 0
    assert any("sound speed is missing" in note for note in recording.notes) == is_assumed


def test_missing_slant_range_is_taken_from_the_duration(scene, write):
    dive = scene(slant_ranges=(60.0,), block={"SlantRange": 0.0, "TimeDuration": 0.08})
    # 0.08 s at 750 m/s one way is 60 m; the field is float32.
    np.testing.assert_allclose(read_xtf(write(dive.to_bytes())).slant_range_max, 60.0, rtol=1e-6)


def test_positions_in_metres_start_at_the_first_ping_and_have_no_place_on_earth(scene, write):
    ping = {
        "SensorXcoordinate": 500_000.0 + 0.1 * np.arange(40),
        "SensorYcoordinate": 5_000_000.0 + 0.2 * np.arange(40),
    }
    recording = read_xtf(write(scene(nav_units=0, ping=ping).to_bytes()))
    assert recording.georeference is None
    # Grid metres as doubles: 1e-9 of 5e6 m.
    np.testing.assert_allclose(recording.trajectory_dr.x, 0.1 * np.arange(40), atol=1e-6)
    np.testing.assert_allclose(recording.trajectory_dr.y, 0.2 * np.arange(40), atol=1e-6)
    assert any("easting 500000.000, northing 5000000.000" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("nav_units", "east", "is_geographic"), [(3, 500_000.0, False), (7, 5.0, True), (7, 500_000.0, False)]
)
def test_a_unit_of_positions_that_cannot_be_is_corrected_and_said(scene, write, nav_units, east, is_geographic):
    ping = {"SensorXcoordinate": east, "SensorYcoordinate": 45.0 + 1e-6 * np.arange(40) * (1 if east < 360 else 1e6)}
    recording = read_xtf(write(scene(nav_units=nav_units, ping=ping).to_bytes()))
    assert (recording.georeference is not None) == is_geographic
    assert any("assumed" in note and ("degrees" in note or "metres" in note) for note in recording.notes)


def test_pings_without_position_are_dropped_and_counted(scene, write):
    dive = scene()
    east, north = np.full(40, 5.0), 45.0 + 1e-6 * np.arange(40)
    for k, bad in ((0, (0.0, 0.0)), (7, (np.nan, np.nan)), (8, (5.0, 95.0)), (20, (25.0, 45.0)), (21, (5.0, np.inf))):
        east[k], north[k] = bad
    dive.ping = {"SensorXcoordinate": east, "SensorYcoordinate": north}
    recording = read_xtf(write(dive.to_bytes()))
    assert recording.n_dropped == 5
    kept = np.setdiff1d(np.arange(40), [0, 7, 8, 20, 21])
    np.testing.assert_array_equal(recording.port, dive.lines("p")[kept])
    assert recording.georeference.latitude == north[1]
    assert "pings dropped, for lack of position or samples: 5" in recording.notes


@pytest.mark.parametrize("ping", [{"SensorXcoordinate": 0.0, "SensorYcoordinate": 0.0}, {"SensorXcoordinate": np.nan}])
def test_a_file_without_any_position_stands_at_the_origin_and_says_so(scene, write, ping):
    recording = read_xtf(write(scene(ping=ping).to_bytes()))
    assert recording.n_pings == 40
    assert not recording.trajectory_dr.positions[:, :2].any()
    np.testing.assert_allclose(recording.trajectory_dr.yaw[0], np.radians(89.0), atol=1e-7)
    assert recording.georeference is None
    assert any("none of 40 pings has a position" in note for note in recording.notes)


def test_the_ship_stands_in_for_a_sensor_without_position_or_heading(scene, write):
    ping = {
        "SensorXcoordinate": 0.0,
        "SensorYcoordinate": 0.0,
        "SensorHeading": 0.0,
        "ShipGyro": 90.0,
        "ShipXcoordinate": 5.0,
        "ShipYcoordinate": 45.0 + 1e-6 * np.arange(40),
    }
    recording = read_xtf(write(scene(ping=ping).to_bytes()))
    np.testing.assert_allclose(recording.trajectory_dr.yaw, 0.0, atol=1e-12)
    assert any("ship's is taken" in note for note in recording.notes)
    assert any("gyro" in note for note in recording.notes)


def test_attitude_that_was_never_recorded_is_level_along_the_course_and_said(scene, write):
    recording = read_xtf(write(scene(ping={"SensorHeading": 0.0, "SensorRoll": 0.0, "SensorPitch": 0.0}).to_bytes()))
    trajectory = recording.trajectory_dr
    np.testing.assert_allclose(trajectory.yaw, np.pi / 2, atol=1e-6)
    np.testing.assert_array_equal(trajectory.roll, 0.0)
    np.testing.assert_array_equal(trajectory.pitch, 0.0)
    for name in ("roll", "pitch", "heading"):
        assert any(note.startswith(f"{name} is not recorded") for note in recording.notes)


def test_implausible_attitude_is_interpolated_across_north(scene, write):
    heading = (355.0 + np.arange(40)) % 360
    heading[10] = np.nan
    recording = read_xtf(write(scene(ping={"SensorHeading": heading}).to_bytes()))
    # float32 degrees
    np.testing.assert_allclose(
        np.unwrap(recording.trajectory_dr.yaw), np.radians(90 - 355 + 360 - np.arange(40)), atol=1e-6
    )
    assert any("heading is missing or implausible in 1 of 40 pings" in note for note in recording.notes)


def test_unknown_altitude_and_depth_are_nan_and_the_vehicle_is_at_the_surface(scene, write):
    recording = read_xtf(
        write(scene(ping={"SensorPrimaryAltitude": 0.0, "SensorDepth": 0.0, "SensorSpeed": 0.0}).to_bytes())
    )
    for series in (recording.altitude, recording.depth, recording.speed):
        assert np.isnan(series).all()
    np.testing.assert_array_equal(recording.trajectory_dr.z, 0.0)


def test_auxiliary_altitude_stands_in(scene, write):
    recording = read_xtf(write(scene(ping={"SensorPrimaryAltitude": 0.0, "SensorAuxAltitude": 10.0}).to_bytes()))
    np.testing.assert_array_equal(recording.altitude, 10.0)


def test_speed_that_fits_the_track_in_metres_per_second_is_not_taken_for_knots(scene, write):
    recording = read_xtf(write(scene(ping={"SensorSpeed": 2.0}).to_bytes()))
    np.testing.assert_allclose(recording.speed, 2.0)
    assert any("metres per second" in note for note in recording.notes)


def test_held_positions_are_interpolated_to_the_true_track_and_said(scene, write):
    fix = 4 * (np.arange(40) // 4)
    ping = {"SensorYcoordinate": 45.0 + np.degrees(0.2 * fix / 6367381.8), "SensorXcoordinate": 5.0}
    recording = read_xtf(write(scene(ping=ping).to_bytes()))
    # A straight track at one speed: nothing is lost but the scale of the meridian (see above).
    np.testing.assert_allclose(recording.trajectory_dr.y, 0.2 * np.arange(40), atol=2e-3)
    assert any("positions change in 10 of 40 pings" in note for note in recording.notes)


def test_a_position_that_never_changes_is_said(scene, write):
    recording = read_xtf(write(scene(ping={"SensorYcoordinate": 45.0}).to_bytes()))
    assert np.ptp(recording.trajectory_dr.y) == 0
    assert "the position never changes" in recording.notes


def test_repeated_stamps_are_spread_and_said(scene, write):
    dive = scene(ping={"HSeconds": 0})
    recording = read_xtf(write(dive.to_bytes()))
    steps = np.diff(recording.ping_time)
    # Ten pings a second stamped with whole seconds: within a window of four bursts the rate is right to a third.
    np.testing.assert_allclose(steps, 0.1, atol=0.035)
    assert any("re-spread" in note for note in recording.notes)


def test_a_clock_set_back_does_not_turn_time_round(scene, write):
    dive = scene(ping={"Year": [2023] * 20 + [2022] * 20})
    recording = read_xtf(write(dive.to_bytes()))
    np.testing.assert_allclose(np.diff(recording.ping_time), 0.1, atol=1e-3)
    assert any("clock was set back (1x)" in note for note in recording.notes)


def test_pings_without_any_date_are_timed_at_the_recorded_rate(scene, write):
    dive = scene(ping={"Month": 0}, block={"SecondsPerPing": 0.1})
    recording = read_xtf(write(dive.to_bytes()))
    np.testing.assert_allclose(recording.ping_time, 0.1 * np.arange(40), atol=1e-6)
    assert any("40 of 40 ping times" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("channels", "pair"), [(None, 1), ("3,4", 1), ("1,2", 0), ("2, 1", 0), ("400kHz", 0), ("900 kHz", 1)]
)
@pytest.mark.parametrize("has_own_packets", [False, True])
def test_the_finer_pair_of_two_frequencies_is_taken_unless_another_is_asked_for(
    scene, write, channels, pair, has_own_packets
):
    dive = scene(frequencies=(400.0, 900.0), slant_ranges=(60.0, 30.0), has_own_packets=has_own_packets)
    recording = read_xtf(write(dive.to_bytes()), channels)
    np.testing.assert_array_equal(recording.port, dive.lines("p", pair))
    np.testing.assert_array_equal(recording.starboard, dive.lines("s", pair))
    assert recording.sonar.frequency == (400e3, 900e3)[pair]
    np.testing.assert_allclose(recording.sample_spacing, (0.5, 0.25)[pair])
    assert recording.n_dropped == 0
    assert any("the file also has" in note for note in recording.notes)


def test_among_pairs_of_one_spacing_the_higher_frequency_is_taken(scene, write):
    dive = scene(frequencies=(900e3, 400.0), slant_ranges=(60.0, 60.0))
    assert read_xtf(write(dive.to_bytes())).sonar.frequency == 900e3


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        ("1,3", "no pair of port and starboard; the file has 1 port 400 kHz"),
        ("0,1", "no pair"),
        ("2,2", "no pair"),
        ("high", "cannot be read"),
        ("1", "cannot be read"),
        ("100kHz", "no channel is within 10 %"),
        ("0kHz", "no channel"),
    ],
)
def test_channels_that_are_not_there_are_refused_with_those_that_are(scene, write, channels, words):
    dive = scene(frequencies=(400.0, 900.0), slant_ranges=(60.0, 30.0))
    with pytest.raises(ValueError, match=words):
        read_xtf(write(dive.to_bytes()), channels)


@pytest.mark.parametrize("side", ["p", "s"])
def test_a_missing_side_is_unknown_and_said(scene, write, side):
    dive = scene(sides=side)
    recording = read_xtf(write(dive.to_bytes()))
    present, missing = ("port", "starboard") if side == "p" else ("starboard", "port")
    np.testing.assert_array_equal(getattr(recording, present), dive.lines(side))
    assert np.isnan(getattr(recording, missing)).all()
    assert any(f"no {missing} channel" in note for note in recording.notes)


def test_pings_of_different_length_are_filled_with_nan(scene, write):
    long, short = scene(n_samples=120), scene(n_samples=60)
    data = long.header() + b"".join(long.packets()[:20] + short.packets()[20:])
    recording = read_xtf(write(data))
    assert recording.n_samples == 120
    np.testing.assert_array_equal(recording.port[20:, :60], short.lines("p")[20:])
    assert np.isnan(recording.port[20:, 60:]).all()
    assert np.isnan(recording.starboard[20:, 60:]).all()
    np.testing.assert_allclose(recording.sample_spacing, [0.5] * 20 + [1.0] * 20)


def test_channel_numbers_that_all_are_zero_are_told_apart_by_their_place(scene, write):
    dive = scene(block={"ChannelNumber": 0})
    recording = read_xtf(write(dive.to_bytes()))
    np.testing.assert_array_equal(recording.starboard, dive.lines("s"))


def test_the_number_of_samples_of_old_files_is_in_the_channel_table(scene, write):
    dive = scene(block={"NumSamples": 0}, channel={"Reserved": 120})
    np.testing.assert_array_equal(read_xtf(write(dive.to_bytes())).starboard, dive.lines("s"))


def test_more_than_six_channels_make_a_longer_header(scene, write):
    dive = scene()
    header = bytearray(dive.header() + bytes(1024))
    # Slots 0 and 1 are bathymetry, the sides are in slots 6 and 7, behind the first 1024 bytes.
    header[1024 : 1024 + 256] = header[256 : 256 + 256]
    header[256] = header[256 + 128] = 3
    packets = [bytearray(packet) for packet in dive.packets()]
    for packet in packets:
        struct.pack_into("<H", packet, 256, 6)
        struct.pack_into("<H", packet, 256 + 64 + 240, 7)
    recording = read_xtf(write(bytes(header) + b"".join(packets)))
    np.testing.assert_array_equal(recording.starboard, dive.lines("s"))


def test_pyxtf_reads_the_same_samples(scene, write):
    path = write(scene().to_bytes())
    _, packets = pyxtf.xtf_read(str(path))
    port = np.stack([ping.data[0] for ping in packets[pyxtf.XTFHeaderType.sonar]])
    np.testing.assert_array_equal(read_xtf(path).port, port[:, ::-1])


def test_other_packets_between_the_pings_are_stepped_over(scene, write):
    dive = scene()
    note = pyxtf.XTFNotesHeader()
    note.NumBytesThisRecord = 256
    data = dive.header() + b"".join(bytes(note) + packet for packet in dive.packets())
    assert read_xtf(write(data)).n_pings == 40


def test_a_damaged_packet_costs_one_ping_and_is_said(scene, write):
    dive = scene()
    packets = [bytearray(packet) for packet in dive.packets()]
    packets[10][:2] = b"XX"
    struct.pack_into("<I", packets[20], 10, 0)
    struct.pack_into("<I", packets[30], 10, 4_000_000_000)
    recording = read_xtf(write(dive.header() + b"".join(packets)))
    np.testing.assert_array_equal(recording.port, dive.lines("p")[np.setdiff1d(np.arange(40), [10, 20, 30])])
    # Three packets of 896 bytes; the first of them is the eleventh.
    said = f"2688 bytes are damaged or cut off and are skipped: in 3 places, the first at byte {1024 + 10 * 896}, "
    assert said + "behind 10 whole packets" in recording.notes


@pytest.mark.parametrize("size", [300, 1500])
def test_a_packet_with_a_wrong_size_costs_that_ping_alone(scene, write, size):
    dive = scene()
    packets = [bytearray(packet) for packet in dive.packets()]
    assert len(packets[20]) == 896
    struct.pack_into("<I", packets[20], 10, size)
    recording = read_xtf(write(dive.header() + b"".join(packets)))
    np.testing.assert_array_equal(recording.port, dive.lines("p")[np.setdiff1d(np.arange(40), [20])])


@pytest.mark.parametrize("cut", [1, 100, 300, 500])
def test_a_cut_file_gives_the_whole_pings_before_the_cut(scene, write, cut):
    dive = scene()
    recording = read_xtf(write(dive.to_bytes()[:-cut]))
    np.testing.assert_array_equal(recording.port, dive.lines("p")[:39])
    assert recording.n_dropped == 1
    assert any("cut off" in note for note in recording.notes)


def test_one_ping_is_a_recording(scene, write):
    recording = read_xtf(write(scene(n_pings=1).to_bytes()))
    assert recording.n_pings == 1


def test_a_ping_that_claims_far_too_many_samples_is_dropped(scene, write):
    dive = scene()
    packets = dive.packets()
    packets[5] = scene(n_samples=4000).packet(5, dive.channels())
    recording = read_xtf(write(dive.header() + b"".join(packets)))
    assert recording.n_samples == 120
    assert recording.n_dropped == 1


def test_sides_that_disagree_about_the_range_are_dropped(scene, write):
    dive = scene()
    packets = [bytearray(packet) for packet in dive.packets()]
    struct.pack_into("<f", packets[5], 256 + 4, 100.0)
    assert read_xtf(write(dive.header() + b"".join(packets))).n_dropped == 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sides": ""}, "no side-scan channel (40 packets of type 0)"),
        ({"block": {"NumSamples": 0}, "channel": {"Reserved": 0}}, "no side-scan ping with samples"),
        ({"block": {"SlantRange": 0.0}}, "no side-scan ping with samples"),
        ({"n_pings": 0}, "no side-scan ping with samples (no whole packet from byte 1024 on)"),
        ({"channel": {"CorrectionFlags": 2}}, "corrected to ground range; slant range is wanted"),
        ({"n_bytes": 4, "sample_format": 1}, "IBM floating point"),
    ],
)
def test_a_file_that_gives_no_recording_is_refused_in_one_line(scene, write, change, words):
    path = write(scene(**change).to_bytes())
    with pytest.raises(ValueError) as caught:  # noqa: PT011  the words are checked below
        read_xtf(path)
    message = str(caught.value)
    assert words in message
    assert message.startswith(f"{path}: ")
    assert "\n" not in message


def test_sides_that_disagree_throughout_are_refused(scene, write):
    dive = scene()
    packets = [bytearray(packet) for packet in dive.packets()]
    for packet in packets:
        struct.pack_into("<f", packet, 256 + 4, 100.0)
    with pytest.raises(ValueError, match="different sample spacings in every ping; one spacing is wanted"):
        read_xtf(write(dive.header() + b"".join(packets)))


def test_a_file_cut_in_its_header_is_refused(scene, write):
    with pytest.raises(ValueError, match="ends inside its header: 700 bytes, at least 1024 are wanted"):
        read(write(scene().to_bytes()[:700]))


@pytest.mark.parametrize("n_bytes", [1, 2, 4])
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_no_damage_makes_anything_but_a_recording_or_one_line(scene, write, n_bytes, seed):
    content = scene(n_pings=6, n_samples=30, n_bytes=n_bytes).to_bytes()
    check_survival(write(damaged(content, np.random.default_rng(seed), keep=1)), 40)


@pytest.fixture
def recordings() -> Path:
    folder = os.environ.get("SSSSLAM_DATA")
    if not folder:
        pytest.skip("SSSSLAM_DATA is not set: no real recordings")
    return Path(folder) / "recordings"


def test_the_scotsman_dive_reads_as_its_description_says(recordings):
    recording = read(recordings / "scotsman-iver2.xtf")
    assert (recording.n_pings, recording.n_samples, recording.n_dropped) == (460, 1024, 1)
    assert recording.sonar.frequency == 600e3
    np.testing.assert_allclose(recording.slant_range_max, 29.98, atol=0.01)
    assert 8.5 < 1 / np.median(np.diff(recording.ping_time)) < 9.1
    assert 54 < recording.trajectory_dr.distance[-1] < 58
    # Nose up to -23 degrees in the file is nose down here.
    assert np.degrees(recording.trajectory_dr.pitch.max()) == pytest.approx(22.9, abs=0.1)
    # The first samples are the saturated transmission: both sides are near end first.
    assert (recording.port[:, :5] == 32767).all()
    assert (recording.starboard[:, :5] == 32767).all()
    steps = np.hypot(np.diff(recording.trajectory_dr.x), np.diff(recording.trajectory_dr.y))
    assert steps.min() > 0


def test_the_sonar_without_side_scan_is_refused_in_one_line(recordings):
    with pytest.raises(ValueError, match=r"no side-scan channel .*1204 packets of type 107") as caught:
        read(recordings / "r2sonic-no-sidescan.xtf")
    assert "\n" not in str(caught.value)


def test_the_scotsman_dive_cut_anywhere_gives_its_first_pings_or_one_line(recordings, write):
    content, whole = (recordings / "scotsman-iver2.xtf").read_bytes(), read(recordings / "scotsman-iver2.xtf")
    for cut in np.random.default_rng(7).integers(1, len(content), 10):
        try:
            recording = read(write(content[:cut]))
        except ValueError as error:
            assert "\n" not in str(error)  # noqa: PT017
            continue
        np.testing.assert_array_equal(recording.port, whole.port[: recording.n_pings])
        assert recording.n_pings == (cut - 1024) // 4480 - 1


@pytest.mark.filterwarnings("error")
def test_a_signalling_nan_in_a_header_is_unknown_and_warns_of_nothing(scene, write):
    data = bytearray(scene(ping={"SensorPitch": 0.125}).to_bytes())
    told, signalling = struct.pack("<f", 0.125), b"\x01\x00\xa0\x7f"
    assert data.count(told) >= 3
    at = data.find(told)
    data[at : at + 4] = signalling
    assert np.isfinite(read_xtf(write(bytes(data))).trajectory_dr.pitch).all()
