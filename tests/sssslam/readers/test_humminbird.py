"""Humminbird: dives made on purpose and read back, and the sample of PyHum where it is at hand."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyproj import Transformer

from frontend.recording import Quantity
from sssslam.readers import read
from tests.sssslam.readers.damage import check_survival, damaged
from tests.sssslam.readers.humminbird_files import LONG, SHORT, START, HumminbirdScene


@pytest.mark.parametrize("tags", [SHORT, LONG])
def test_a_dive_reads_as_it_was_made(tmp_path, tags):
    dive = HumminbirdScene(tags=tags)
    recording = read(dive.write(tmp_path))
    np.testing.assert_array_equal(recording.port, dive.lines(2).astype(np.float32))
    np.testing.assert_array_equal(recording.starboard, dive.lines(3).astype(np.float32))
    np.testing.assert_allclose(recording.ping_time, dive.time, rtol=0, atol=1e-6)
    np.testing.assert_allclose(recording.altitude, 10.0)
    np.testing.assert_allclose(recording.speed, 2.0)
    np.testing.assert_allclose(recording.trajectory_dr.yaw, np.radians(-135.0))
    assert (recording.sonar.frequency, recording.sonar.quantity) == (455e3, Quantity.UNKNOWN)
    assert np.isnan(recording.depth).all()
    assert (recording.trajectory_dr.z == 0).all()
    assert recording.n_dropped == 0


def test_headers_have_the_sizes_that_units_write():
    sizes = [len(HumminbirdScene(tags=tags, n_samples=0).record(0, 2)) for tags in (SHORT, LONG)]
    assert sizes == [67, 152]


def test_positions_are_mercator_on_the_international_ellipsoid(tmp_path):
    recording = read(HumminbirdScene(speed=0.0).write(tmp_path))
    # A judge of its own: spherical Mercator gives the geocentric latitude of the same ellipsoid (axes 297 : 296).
    sphere = Transformer.from_crs("+proj=merc +R=6378388 +units=m", "+proj=longlat +R=6378388", always_xy=True)
    longitude, geocentric = sphere.transform(-12_414_000.0, 4_396_652.0)
    geodetic = np.degrees(np.arctan(np.tan(np.radians(geocentric)) * (297 / 296) ** 2))
    assert recording.georeference.longitude == pytest.approx(longitude, abs=1e-9)
    # The constant of the format is 4e-6 from that ratio: 0.0001 degrees.
    assert recording.georeference.latitude == pytest.approx(geodetic, abs=2e-4)


def test_whole_metres_become_a_smooth_track(tmp_path):
    recording = read(HumminbirdScene(n_pings=600).write(tmp_path))
    steps = np.hypot(np.diff(recording.trajectory_dr.x), np.diff(recording.trajectory_dr.y))
    # 0.088 m a ping; a rounded metre crosses its middle to within one ping, which is 0.07 of a map metre.
    np.testing.assert_allclose(steps[40:-40], 0.088, atol=0.015)
    assert any("their steps are smoothed" in note for note in recording.notes)


def test_any_file_of_a_dive_opens_it_and_several_count_once(tmp_path):
    dat = HumminbirdScene().write(tmp_path)
    by_dat = read(dat)
    port, starboard = (tmp_path / "R01224" / f"B00{beam}.SON" for beam in (2, 3))
    for paths in ((port,), (starboard, port), (dat, port, starboard)):
        recording = read(*paths)
        np.testing.assert_array_equal(recording.starboard, by_dat.starboard)
        assert recording.ping_time[0] == START
        assert recording.source_sha256 == by_dat.source_sha256


def test_a_dat_among_its_files_finds_them(tmp_path):
    dat = HumminbirdScene().write(tmp_path)
    inside = dat.rename(tmp_path / "R01224" / "other.DAT")
    assert read(inside).n_pings == 40


def test_the_name_in_the_dat_finds_the_folder(tmp_path):
    dat = HumminbirdScene().write(tmp_path)
    assert read(dat.rename(tmp_path / "renamed.DAT")).n_pings == 40


def test_without_dat_the_start_is_unknown_and_said(tmp_path):
    HumminbirdScene().write(tmp_path).unlink()
    recording = read(tmp_path / "R01224" / "B002.SON")
    assert recording.ping_time[0] == 0.0
    assert any("no DAT file tells the start" in note for note in recording.notes)
    assert any("1480 m/s is assumed, of unknown water" in note for note in recording.notes)


@pytest.mark.parametrize(("size", "water", "speed"), [(64, 0, 1466), (64, 1, 1507), (96, 1, 1466), (100, 3, 1507)])
def test_the_water_of_the_dat_tells_the_sound_speed(tmp_path, size, water, speed):
    recording = read(HumminbirdScene(dat_size=size, water=water).write(tmp_path))
    assert (recording.sound_speed == speed).all()
    assert recording.ping_time[0] == START
    # Samples are 4 / (pi 0.108 m 455 kHz) = 25.91 us apart, of which sound goes half.
    np.testing.assert_allclose(recording.sample_spacing, speed * 25.91e-6 / 2, rtol=1e-3)


def test_a_missing_side_is_unknown_and_said(tmp_path):
    recording = read(HumminbirdScene(sides="s").write(tmp_path))
    assert np.isnan(recording.port).all()
    np.testing.assert_array_equal(recording.starboard, HumminbirdScene().lines(3).astype(np.float32))
    assert any("no port file: that side is unknown" in note for note in recording.notes)


def test_sides_are_matched_by_time(tmp_path):
    dive = HumminbirdScene(delay_ms=2)
    dat = dive.write(tmp_path)
    son = tmp_path / "R01224" / "B003.SON"
    size = len(dive.record(0, 3))
    content = dive.son(3)
    son.write_bytes(content[: 5 * size] + content[6 * size :])
    recording = read(dat)
    assert (recording.n_pings, recording.n_dropped) == (39, 1)
    np.testing.assert_array_equal(recording.starboard[5], dive.lines(3)[6].astype(np.float32))
    np.testing.assert_array_equal(recording.port[5], dive.lines(2)[6].astype(np.float32))
    assert any("lack of a partner on the other side: 1" in note for note in recording.notes)


def test_a_damaged_record_costs_its_own_ping_only(tmp_path):
    dive = HumminbirdScene()
    dat = dive.write(tmp_path)
    son, size = tmp_path / "R01224" / "B002.SON", len(dive.record(0, 2))
    content = bytearray(dive.son(2))
    content[7 * size + 4] = 0x11
    son.write_bytes(bytes(content[:-10]))
    recording = read(dat)
    assert recording.n_pings == 38
    said = f"B002.SON: {2 * size - 10} bytes are damaged or cut off and are skipped: in 2 places, the first at byte "
    assert f"{said}{7 * size}, behind 7 whole records" in recording.notes


def test_a_record_that_reaches_into_the_next_is_left_out(tmp_path):
    dive = HumminbirdScene()
    dat = dive.write(tmp_path)
    son, size = tmp_path / "R01224" / "B002.SON", len(dive.record(0, 2))
    content = bytearray(dive.son(2))
    # The last byte of the number of samples, in front of the end of the header.
    content[7 * size + 65] = 130
    son.write_bytes(bytes(content))
    assert (read(dat).n_pings, read(dat).n_samples) == (39, 120)


def test_a_dive_without_side_beams_is_refused(tmp_path):
    dat = HumminbirdScene(sides="").write(tmp_path)
    with pytest.raises(ValueError, match=r"no SON file found in or beside .*R01224; SON files of beam 2 or 3"):
        read(dat)
    (tmp_path / "R01224" / "B000.SON").write_bytes(HumminbirdScene().son(0))
    with pytest.raises(ValueError, match=r"B000.SON beam 0 found in or beside"):
        read(dat)


def test_an_empty_or_foreign_son_beside_a_good_one_is_said(tmp_path):
    dat = HumminbirdScene().write(tmp_path)
    (tmp_path / "R01224" / "B003.SON").write_bytes(b"")
    (tmp_path / "R01224" / "B004.SON").write_bytes(b"%PDF-1.4")
    recording = read(dat)
    assert np.isnan(recording.starboard).all()
    said = ("the dive has no starboard file: that side is unknown", "B003.SON is empty: it is left out")
    assert {*said, "B004.SON starts with the bytes 25 50 44 46: it is left out"} <= set(recording.notes)


def test_a_dive_of_empty_files_is_refused_by_their_names(tmp_path):
    dat = HumminbirdScene().write(tmp_path)
    for beam in (2, 3):
        (tmp_path / "R01224" / f"B00{beam}.SON").write_bytes(b"")
    with pytest.raises(
        ValueError, match=r"B002.SON is empty, B003.SON is empty found in or beside .*R01224; SON files"
    ):
        read(dat)


def test_two_files_of_one_beam_are_refused(tmp_path):
    dat = HumminbirdScene().write(tmp_path)
    (tmp_path / "R01224" / "copy.son").write_bytes(HumminbirdScene().son(3))
    with pytest.raises(ValueError, match="both hold beam 3; one dive in a folder is wanted"):
        read(dat)


def test_a_son_without_whole_record_is_refused(tmp_path):
    son = tmp_path / "B002.SON"
    son.write_bytes(b"\xc0\xde\xab\x21\x80\x00")
    with pytest.raises(ValueError, match=r"B002.SON \(no whole record header .* found in"):
        read(son)


def test_records_without_position_are_refused_with_their_place(tmp_path):
    son = tmp_path / "B002.SON"
    son.write_bytes(HumminbirdScene(tags=(0x80, 0x81, 0x50)).son(2))
    with pytest.raises(ValueError, match="lack the tags 0x82, 0x83"):
        read(son)


def test_a_unit_without_gnss_is_refused(tmp_path):
    with pytest.raises(ValueError, match="none of 40 pings has a position"):
        read(HumminbirdScene(east=0.0, north=0.0, speed=0.0).write(tmp_path))


def test_channels_of_a_dive_cannot_be_chosen(tmp_path):
    with pytest.raises(ValueError, match="channels '1,2' were asked for; a Humminbird dive holds one pair only"):
        read(HumminbirdScene().write(tmp_path), channels="1,2")


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_no_damage_makes_anything_but_a_recording_or_one_line(tmp_path, seed):
    dive = HumminbirdScene(n_pings=6, n_samples=30)
    rng = np.random.default_rng(seed)
    son = tmp_path / "B002.SON"
    son.write_bytes(damaged(dive.son(2), rng, keep=4))
    (tmp_path / "B003.SON").write_bytes(damaged(dive.son(3), rng, keep=4))
    check_survival(son, 40)


def test_the_river_dive_of_pyhum_reads_as_it_is_known():
    """Its files, taken out of the source distribution of PyHum 1.4.6: ``test.DAT`` beside the folder ``test``."""
    dat = Path(os.environ.get("SSSSLAM_DATA", "")) / "recordings" / "pyhum" / "test.DAT"
    if not dat.is_file():
        pytest.skip("SSSSLAM_DATA/recordings/pyhum/test.DAT is not there: no real Humminbird dive")
    recording = read(dat)
    assert (recording.n_pings, recording.n_samples, recording.n_dropped) == (3453, 1550, 0)
    assert recording.georeference.latitude == pytest.approx(36.8788, abs=1e-4)
    # The unit's own speed over ground is a judge of the track.
    speed = recording.trajectory_dr.distance[-1] / np.ptp(recording.ping_time)
    assert speed == pytest.approx(np.mean(recording.speed), rel=0.05)
