"""Files of navigation: CSV, TUM and NMEA give the same track; what is none is refused in one line."""

import os
import re
from contextlib import suppress
from datetime import UTC, datetime
from functools import reduce
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from frontend.georeference import Georeference
from frontend.trajectory import Trajectory
from sssslam.navigation.files import read_navigation
from sssslam.products.tum import format_tum
from tests.sssslam.navigation.conftest import START, positions, vehicle

TIME = np.arange(0.0, 60.0, 0.5)


def _degrees(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return Georeference(45.0, 5.0).to_geographic(*positions(time))


def _csv(header: str, *columns: object, delimiter: str = ",") -> str:
    rows = zip(*columns, strict=True)
    return "\n".join([header, *(delimiter.join(str(value) for value in row) for row in rows)]) + "\n"


def _sentence(body: str) -> str:
    return f"${body}*{reduce(lambda a, c: a ^ ord(c), body, 0):02X}"


def _nmea_angle(value: float, width: int) -> str:
    degrees = int(abs(value))
    return f"{degrees:0{width}d}{60 * (abs(value) - degrees):09.6f}"


def _clock(time: float) -> str:
    return datetime.fromtimestamp(START + time, UTC).strftime("%H%M%S.%f")[:-4]


def _nmea(time: np.ndarray, day: bool = True) -> list[str]:
    """GGA, RMC, HDT, VTG and DPT at every time; heading and depth without a time of their own."""
    latitude, longitude = _degrees(time)
    said, lines = vehicle(time), []
    for k, t in enumerate(time):
        stamp = datetime.fromtimestamp(START + t, UTC)
        clock = f"{stamp:%H%M%S}.{stamp.microsecond // 10000:02d}"
        place = f"{_nmea_angle(latitude[k], 2)},N,{_nmea_angle(longitude[k], 3)},E"
        heading = 90 - np.degrees(said["yaw"][k])
        lines.append(_sentence(f"GPGGA,{clock},{place},4,10,0.8,2.0,M,50.0,M,,"))
        lines.append(
            _sentence(f"GPRMC,{clock},A,{place},{1.5 * 3600 / 1852:.4f},90.0,{stamp:%d%m%y},,,A")
        ) if day else None
        lines.append(_sentence(f"HEHDT,{heading:.3f},T"))
        lines.append(_sentence(f"GPVTG,90.0,T,,M,{1.5 * 3600 / 1852:.4f},N,5.4,K,A"))
        lines.append(_sentence(f"SDDPT,{said['altitude'][k]:.3f},0.0"))
    return lines


def test_a_csv_of_degrees_is_read_into_the_house(write):
    latitude, longitude = _degrees(TIME)
    said = vehicle(TIME)
    table = _csv(
        "timestamp,Latitude,LON,heading [deg],roll_deg,Pitch (deg),depth,speed [kn],gain",
        *(START + TIME, latitude, longitude, 90 - np.degrees(said["yaw"]), np.degrees(said["roll"])),
        *(-np.degrees(said["pitch"]), said["depth"], said["speed"] * 3600 / 1852, TIME),
    )
    log = read_navigation(write(table), START)
    assert log.place == ("longitude", "latitude")
    np.testing.assert_allclose(log.series["latitude"].values, latitude)
    for name in ("yaw", "roll", "pitch", "depth", "speed"):
        np.testing.assert_allclose(log.series[name].values, said[name], atol=1e-9)
    assert log.notes == ("columns not used: gain",)


@pytest.mark.parametrize("delimiter", [";", "\t", " "])
def test_delimiters_decimal_commas_and_dates_are_understood(write, delimiter):
    stamps = [datetime.fromtimestamp(START + t, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f") for t in TIME]
    x, y = ([f"{value:.4f}".replace(".", ",") for value in axis] for axis in positions(TIME))
    text = _csv(delimiter.join(("time", "x", "y")), stamps, x, y, delimiter=delimiter)
    log = read_navigation(write(text), START)
    np.testing.assert_allclose(log.series["x"].values, positions(TIME)[0], atol=1e-4)
    np.testing.assert_allclose(log.series["x"].time, START + TIME, atol=1e-6)


@pytest.mark.parametrize("has_date", [True, False])
def test_times_of_day_take_their_date_from_a_column_or_from_the_dive(write, has_date):
    late = TIME + 6370  # midnight comes at 6400 s
    stamps = [datetime.fromtimestamp(START + t, UTC) for t in late]
    clock = [stamp.strftime("%H:%M:%S.%f") for stamp in stamps]
    if has_date:
        text = _csv("date,time,speed", [stamp.strftime("%Y-%m-%d") for stamp in stamps], clock, TIME)
    else:
        text = _csv("time,speed", clock, TIME)
    log = read_navigation(write(text), START)
    np.testing.assert_allclose(log.series["speed"].time, START + late, atol=1e-5)


def test_the_products_of_a_run_can_be_read_back(write):
    said, (x, y) = vehicle(TIME), positions(TIME)
    track = Trajectory(START + TIME, x, y, -said["depth"], said["roll"], said["pitch"], said["yaw"])
    tum = read_navigation(write(format_tum(track), "trajectory.tum"), START)
    csv = _csv(
        "time,x,y,z,roll,pitch,yaw,sigma_x", *(track.time, x, y, track.z, track.roll, track.pitch, track.yaw, 0 * x)
    )
    table = read_navigation(write(csv), START)
    for name in ("x", "y", "z", "roll", "pitch", "yaw"):
        # Six decimals in TUM.
        np.testing.assert_allclose(tum.series[name].values, getattr(track, name), atol=2e-6)
        np.testing.assert_allclose(table.series[name].values, getattr(track, name), atol=1e-12)


def test_nmea_gives_position_heading_speed_and_altitude(write):
    log = read_navigation(write("\n".join(_nmea(TIME)), "log.txt"), near=0.0)
    latitude, longitude = _degrees(TIME)
    np.testing.assert_allclose(log.series["latitude"].time, START + TIME, atol=1e-6)
    np.testing.assert_allclose(log.series["latitude"].values, latitude, atol=1e-8)
    np.testing.assert_allclose(log.series["longitude"].values, longitude, atol=1e-8)
    # A heading has no time of its own and takes that of its burst; it is written to a thousandth of a degree.
    np.testing.assert_allclose(log.series["yaw"].time, START + TIME, atol=1e-6)
    np.testing.assert_allclose(log.series["yaw"].values, vehicle(TIME)["yaw"], atol=1e-5)
    np.testing.assert_allclose(log.series["speed"].values, 1.5, rtol=1e-4)
    np.testing.assert_allclose(log.series["altitude"].values, vehicle(TIME)["altitude"], atol=1e-3)


@pytest.mark.parametrize("interval", [0.13, 0.1])
def test_sentences_that_come_at_their_own_rate_are_spread_between_the_fixes(write, interval):
    fixes, headings = np.arange(0.0, 60.0), np.arange(0.05, 59.0, interval)
    said = [(t, _sentence(f"GPGGA,{_clock(t)},4530.0,N,00530.0,E,1,9,1.0,0.0,M,,M,,")) for t in fixes]
    said += [(t, _sentence(f"HEHDT,{t:.2f},T")) for t in headings]
    log = read_navigation(write("\n".join(line for _, line in sorted(said)), "log.txt"), START)
    # Their order in a second is known: each is told to an interval at either side.
    np.testing.assert_allclose(log.series["yaw"].time, START + headings, atol=interval)


def test_sentences_that_open_a_burst_take_the_time_behind_them(write):
    fixes = np.arange(0.0, 20.0)
    lines = [
        _sentence(words)
        for t in fixes
        for words in (f"HEHDT,{t:.2f},T", f"GPGGA,{_clock(t)},4530.0,N,00530.0,E,1,9,1.0,0.0,M,,M,,")
    ]
    for said, first in ((lines, 0), (lines[1:], 1)):
        log = read_navigation(write("\n".join(said), "log.txt"), START)
        # A log that begins with a fix has each heading behind one: the fix before it is the best guess.
        np.testing.assert_allclose(log.series["yaw"].time, START + fixes[first:] - first, atol=1e-6)


def test_numbers_that_are_none_are_damage(write):
    lines = [_sentence("GPZDA,221320.00,14,11,2023,00,00"), _sentence("HEHDT,10.0,T"), _sentence("HEHDT,inf,T")]
    log = read_navigation(write("\n".join(lines), "log.txt"), 0.0)
    assert len(log.series["yaw"].time) == 1
    assert log.notes == ("1 sentences with a wrong checksum or field are left out",)


def test_nmea_without_a_date_takes_that_of_the_dive_and_goes_on_after_midnight(write):
    late = TIME + 6370
    log = read_navigation(write("\n".join(_nmea(late, day=False)), "log.txt"), near=START + 6000)
    np.testing.assert_allclose(log.series["latitude"].time, START + late, atol=1e-6)


def test_what_a_logger_wrote_before_a_sentence_is_skipped_and_damage_is_counted(write):
    lines = [f"2023-11-14T22:13:20.123Z,COM3,{line}" for line in _nmea(TIME)]
    lines[0] = lines[0].replace(",N,", ",S,")
    log = read_navigation(write("\r\n".join(lines), "log.txt"), START)
    assert len(log.series["latitude"].time) == len(TIME) - 1
    assert log.notes == ("1 sentences with a wrong checksum or field are left out",)


@pytest.mark.parametrize(
    ("sentence", "name", "value"),
    [
        ("PASHR,221320.00,080.00,T,-02.00,+03.00,+0.1,0.1,0.1,0.1,1,1", "pitch", -np.radians(3)),
        ("PASHR,221320.00,080.00,T,-02.00,+03.00,+0.1,0.1,0.1,0.1,1,1", "roll", np.radians(-2)),
        ("PASHR,221320.00,080.00,T,-02.00,+03.00,+0.1,0.1,0.1,0.1,1,1", "yaw", np.radians(10)),
        ("HCHDG,080.0,1.0,W,3.0,E", "yaw", np.radians(8)),
        ("GNTHS,080.0,A", "yaw", np.radians(10)),
        ("SDDBT,32.8,f,10.0,M,5.5,F", "altitude", 10.0),
        ("GPGLL,4530.0,S,00530.0,W,221320.00,A", "latitude", -45.5),
        ("GPGLL,4530.0,S,00530.0,W,221320.00,A", "longitude", -5.5),
        ("GPVTG,90.0,T,,M,,N,5.4,K,A", "speed", 1.5),
    ],
)
def test_each_sentence_says_its_own(write, sentence, name, value):
    lines = [_sentence("GPZDA,221320.00,14,11,2023,00,00"), _sentence(sentence)]
    series = read_navigation(write("\n".join(lines), "log.txt"), 0.0).series[name]
    assert series.values[0] == pytest.approx(value, abs=1e-9)
    assert series.time[0] == pytest.approx(START)


def test_magnetic_heading_is_taken_last_and_said(write):
    lines = [_sentence("GPZDA,221320.00,14,11,2023,00,00"), _sentence("HCHDM,080.0,M")]
    log = read_navigation(write("\n".join(lines), "log.txt"), 0.0)
    assert log.notes == ("heading is magnetic (HDM), its variation unknown: yaw is off by that",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty; a file of navigation is wanted"),
        ("\n\n", "this is no navigation"),
        ("Dear diary\n", "this is no navigation"),
        ("x,y\n1,2\n", "this is no navigation"),
        ("time,colour\n1,2\n", "no row holds a time with a position"),
        ("169999999999.0 -1.0 2.0 -5.0 0 0 0.6 0.8\n", "no row holds a time with a position"),
        ("time,x,y\n1,2,3\n2,three,4\n", "line 3: x is 'three'; a number is wanted"),
        ("time,x,y\nnoon,2,3\n", "line 2: time is 'noon'; seconds since 1970 or ISO 8601 is wanted"),
        ("time,x,y\n1,2\n2,3,4\n", "line 2 has 2 fields; 3 are wanted"),
        ("date,time,x,y\n1 May,12:00:00,2,3\n", "line 2: date is '1 May'; a date as YYYY-MM-DD is wanted"),
        ("time,speed [furlong]\n1,2\n", "the unit of column 'speed [furlong]' is unknown"),
        ("time,yaw\n1,359\n", "yaw goes up to 359 rad; name its unit, as yaw [deg]"),
        ("$HEHDT,80.0,T*2C\n$SDDPT,3,0\n", "no NMEA sentence tells the time"),
        ("1 2 3 4 0 0 0 1\n1 2 3 4 0 0 0 1\n", "times must increase strictly"),
        ("time,x\n\0", "this is no text"),
    ],
)
def test_what_is_no_navigation_is_refused_in_one_line_that_names_the_file(write, text, words):
    path = write(text)
    with pytest.raises(ValueError, match=re.escape(words)) as error:
        read_navigation(path, START)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_bytes_and_missing_files_are_refused(tmp_path):
    (tmp_path / "photo").write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(ValueError, match="this is no text"):
        read_navigation(tmp_path / "photo", START)
    with pytest.raises(ValueError, match="there is no such file; a file of navigation is wanted"):
        read_navigation(tmp_path / "none.csv", START)


def test_a_pipe_and_a_device_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(ValueError, match=f"{path}: this is no regular file; a file of navigation is wanted"):
            read_navigation(path, 0.0)


def test_a_heading_in_radians_that_is_not_called_so_is_pointed_out(write):
    log = read_navigation(write("time,heading\n1,0.1\n2,6.2\n"), START)
    assert "heading stays below 6.3 and is taken for degrees" in log.notes[0]


def test_half_a_last_row_and_empty_cells_are_no_fault(write):
    log = read_navigation(write("time,x,y\n1,2,3\n2,,nan\n3,4,5\n4,6"), START)
    np.testing.assert_array_equal(log.series["x"].time, [1.0, 3.0])


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_no_damage_makes_anything_but_navigation_or_one_line(write, data):
    good = data.draw(st.sampled_from(["\n".join(_nmea(TIME[:4])), "time,x,y,heading\n1,2,3,4\n2,3,4,5\n"]))
    at = data.draw(st.integers(0, len(good)))
    text = good[:at] + data.draw(st.text(max_size=6)) + good[at + data.draw(st.integers(0, 9)) :]
    with suppress(ValueError):
        log = read_navigation(write(text.encode("utf-8", "replace").decode()), START)
        assert all(np.isfinite(s.values).all() and np.all(np.diff(s.time) > 0) for s in log.series.values())
