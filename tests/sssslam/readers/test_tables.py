"""CSV and NumPy: the same pings as a table and as an archive."""

import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from frontend.recording import Quantity
from sssslam.readers import read
from tests.sssslam.readers.damage import check_survival, damaged

K = np.arange(5.0)
SERIES = {
    "time": 1.6e9 + 0.1 * K,
    "x": 100.0 + K,
    "y": -50.0 - 2 * K,
    "z": -3.0 - 0.1 * K,
    "roll": 0.01 * K,
    "pitch": 0.02 * K,
    "yaw": -1.0 + 0.1 * K,
    "altitude": 8.0 + K,
    "speed": 1.0 + 0.1 * K,
    "sample_spacing": 0.05 + 0 * K,
    "sound_speed": 1490.0 + 0 * K,
}
SIDES = {
    "port": np.arange(20, dtype=np.float32).reshape(5, 4),
    "starboard": 100 + np.arange(20, dtype=np.float32).reshape(5, 4),
}
SETTINGS = {
    "frequency": 4e5,
    "horizontal_beamwidth": 0.01,
    "lever_arm_port": (0.5, 0.1, -0.2),
    "quantity": "amplitude",
    "origin_latitude": 54.0,
    "origin_longitude": 7.0,
}


def as_csv(series=SERIES, sides=SIDES, settings=SETTINGS) -> bytes:
    lines = [f"# {k}: {' '.join(map(str, v)) if isinstance(v, tuple) else v}" for k, v in settings.items()]
    columns = dict(series)
    for side, samples in sides.items():
        columns |= {f"{side}_{k}": samples[:, k] for k in range(samples.shape[1])}
    lines.append(",".join(columns))
    lines += [",".join(repr(float(column[k])) for column in columns.values()) for k in range(len(K))]
    return "\n".join(["# made by hand", *lines, ""]).encode()


def as_npz(series=SERIES, sides=SIDES, settings=SETTINGS) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **{**series, **sides, **settings})
    return buffer.getvalue()


FORMATS = pytest.mark.parametrize("written", [as_csv, as_npz])


def but(**changes):
    """The series with some changed; None takes one away."""
    return {name: values for name, values in {**SERIES, **changes}.items() if values is not None}


@FORMATS
def test_pings_read_as_they_were_written(write, written):
    recording = read(write(written(), "no.name"))
    for side, samples in SIDES.items():
        np.testing.assert_array_equal(getattr(recording, side), samples)
    for name in ("x", "y", "z", "roll", "pitch", "yaw"):
        # Yaw goes over heading, which costs the last digit.
        np.testing.assert_allclose(getattr(recording.trajectory_dr, name), SERIES[name], atol=1e-12)
    np.testing.assert_array_equal(recording.ping_time, SERIES["time"])
    for name in ("sample_spacing", "sound_speed", "altitude", "speed"):
        np.testing.assert_array_equal(getattr(recording, name), SERIES[name])
    assert (recording.georeference.latitude, recording.georeference.longitude) == (54.0, 7.0)
    assert recording.sonar.frequency == 4e5
    assert recording.sonar.lever_arm_port == (0.5, 0.1, -0.2)
    assert recording.sonar.quantity == Quantity.AMPLITUDE
    assert np.isnan(recording.sonar.vertical_beamwidth)
    assert recording.notes == ()


@FORMATS
def test_latitude_and_longitude_make_a_frame_of_their_own(write, written):
    north = but(x=None, y=None, latitude=45 + 1e-5 * K, longitude=5 + 0 * K, yaw=None, heading_deg=90 + 0 * K)
    recording = read(write(written(north)))
    # A degree of latitude at 45 degrees is 111131.7 m.
    np.testing.assert_allclose(recording.trajectory_dr.y, 1.111317 * K, atol=1e-5)
    np.testing.assert_allclose(recording.trajectory_dr.yaw, 0.0, atol=1e-12)
    assert recording.georeference.latitude == 45.0


@FORMATS
def test_what_is_left_out_is_assumed_and_said(write, written):
    bare = {name: SERIES[name] for name in ("time", "x", "y")} | {"slant_range_max": 2.0 + 0 * K}
    recording = read(write(written(bare, settings={})))
    np.testing.assert_array_equal(recording.sample_spacing, 0.5)
    np.testing.assert_array_equal(recording.sound_speed, 1500.0)
    np.testing.assert_allclose(recording.trajectory_dr.yaw, np.arctan2(-2, 1))
    assert np.isnan(recording.altitude).all()
    assert recording.georeference is None
    assert recording.sonar.quantity == Quantity.UNKNOWN
    words = ("sound speed is missing or impossible in 5 of 5", "roll is not recorded", "heading is not recorded")
    assert all(any(word in note for note in recording.notes) for word in words)


@FORMATS
def test_a_sound_speed_that_cannot_be_is_assumed_and_said(write, written):
    recording = read(write(written(but(sound_speed=1e-310 + 0 * K))))
    np.testing.assert_array_equal(recording.sound_speed, 1500.0)
    assert any("missing or impossible in 5 of 5" in note for note in recording.notes)


@FORMATS
def test_one_side_alone_leaves_the_other_unknown(write, written):
    recording = read(write(written(sides={"starboard": SIDES["starboard"]})))
    assert np.isnan(recording.port).all()
    np.testing.assert_array_equal(recording.starboard, SIDES["starboard"])


@FORMATS
def test_pings_without_position_are_dropped_and_said(write, written):
    recording = read(write(written(but(x=np.where(K == 2, np.nan, 100.0 + K)))))
    assert (recording.n_pings, recording.n_dropped) == (4, 1)
    assert any("pings dropped" in note for note in recording.notes)


@FORMATS
def test_pings_on_the_other_side_of_the_earth_are_dropped(write, written):
    latitude = np.where(K < 3, 45 + 1e-5 * K, -45.0)
    recording = read(write(written(but(x=None, y=None, latitude=latitude, longitude=5 + 0 * K))))
    assert (recording.n_pings, recording.n_dropped) == (3, 2)


@FORMATS
def test_a_dive_across_the_date_line_is_one(write, written):
    longitude = np.where(K < 3, 179.9999 + 3e-5 * K, -180.0001 + 3e-5 * K)
    recording = read(write(written(but(x=None, y=None, latitude=45 + 1e-5 * K, longitude=longitude))))
    assert recording.n_pings == 5
    # 3e-5 degrees of a parallel of 78.85 km a degree.
    np.testing.assert_allclose(np.diff(recording.trajectory_dr.x)[[0, 1, 3]], 2.365, atol=0.01)


@FORMATS
@pytest.mark.parametrize(
    ("series", "words"),
    [
        (but(x=None), "the position is missing; latitude and longitude, or x and y, are wanted"),
        (but(sample_spacing=None), r"the range is missing; sample_spacing or slant_range_max \[m\] is wanted"),
        (but(sample_spacing=-1 + 0 * K), "no ping has a slant range that can be, the first has -4 m"),
    ],
)
def test_what_is_needed_and_missing_is_named(write, written, series, words):
    with pytest.raises(ValueError, match=words):
        read(write(written(series)))


@FORMATS
@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"lever_arm_port": (1.0, 2.0)}, "lever_arm_port has 2 numbers; 3 wanted"),
        ({"lever_arm_port": (1.0, 2.0, np.nan)}, "lever_arm_port is 1.0 2.0 nan; finite numbers are wanted"),
        ({"quantity": "decibel"}, "quantity is 'decibel'; intensity, amplitude, log, unknown is wanted"),
        ({"origin_latitude": 95.0, "origin_longitude": 0.0}, "the origin is 95, 0; a latitude and a longitude"),
    ],
)
def test_settings_that_make_no_sense_are_refused(write, written, settings, words):
    with pytest.raises(ValueError, match=words):
        read(write(written(settings=settings)))


@FORMATS
def test_channels_cannot_be_chosen(write, written):
    with pytest.raises(ValueError, match="channels '1,2' were asked for"):
        read(write(written()), channels="1,2")


@FORMATS
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("east", "north"), [("x", "y"), ("longitude", "latitude")])
@pytest.mark.parametrize("unknown", [0, 1])
def test_a_dive_with_one_coordinate_throughout_unknown_is_refused_in_words(write, written, east, north, unknown):
    places = {east: 8.0 + 0 * K, north: 54.0 + 0 * K}
    places[(east, north)[unknown]] = np.full(len(K), np.nan)
    settings = {key: value for key, value in SETTINGS.items() if not key.startswith("origin")}
    with pytest.raises(ValueError, match="none of 5 pings has a position"):
        read(write(written({**but(x=None, y=None), **places}, settings=settings)))


def test_local_and_geographic_positions_do_not_mix(write):
    there = but(x=None, y=None, latitude=45 + 1e-5 * K, longitude=5 + 0 * K, time=2e9 + K)
    with pytest.raises(ValueError, match="one has positions in metres of a local frame and one in degrees"):
        read(write(as_csv(), "a.csv"), write(as_csv(there), "b.csv"))


def test_a_table_may_hold_comments_quotes_empty_cells_and_a_byte_order_mark(write):
    text = as_csv().decode().replace("speed", '"Speed"', 1)
    header, *rows = [line for line in text.splitlines() if not line.startswith("#")]
    altitude = header.split(",").index("altitude")
    cells = rows[1].split(",")
    cells[altitude] = ""
    rows[1] = ",".join(cells)
    recording = read(write("\ufeff".encode() + "\n".join([header, "", rows[0], "# pause", *rows[1:]]).encode()))
    assert recording.n_pings == 5
    assert np.isnan(recording.altitude[1])
    np.testing.assert_array_equal(recording.speed, SERIES["speed"])


def test_a_row_that_was_cut_off_is_left_out(write):
    assert read(write(as_csv()[:-30])).n_pings == 4


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("100.0,-50.0", "100.0"), "line 9 has 18 cells; 19 are wanted, as in the header"),
        (lambda text: text.replace("-50.0", "south"), "a cell of the rows from line 9 on is no number .*south"),
        (lambda text: text.replace(",x,", ",y,"), "the column 'y' is there more than once; one is wanted"),
        (lambda text: text.replace("port_2", "port_7"), "port has 4 columns up to port_7; 0 to 3 wanted"),
        (lambda text: text.replace("400000.0", "high"), "line 2: frequency is 'high'; numbers are wanted"),
        (lambda text: "\n".join(text.splitlines()[:8]), "the table has no whole row; at least one ping is wanted"),
    ],
)
def test_damage_of_a_table_is_named_with_its_place(write, change, words):
    with pytest.raises(ValueError, match=words):
        read(write(change(as_csv().decode()).encode()))


def test_a_table_that_is_no_text_is_refused(write):
    with pytest.raises(ValueError, match=r"byte \d+ is no text in UTF-8"):
        read(write(as_csv() + b"\xff\xfe"))


def test_a_table_without_samples_is_no_recording(write):
    with pytest.raises(ValueError, match="the format is unknown"):
        read(write(as_csv(sides={})))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"port": None, "starboard": None}, "port and starboard are missing; at least one"),
        ({"port": np.zeros((5, 3))}, r"have the shapes \(5, 3\) and \(5, 4\); one shape"),
        ({"port": np.zeros(5), "starboard": np.zeros(5)}, r"have the shapes \(5,\) and \(5,\)"),
        ({"x": np.zeros(4)}, r"x has the shape \(4,\); \(5,\), one value a ping, is wanted"),
        ({"x": np.array(["a"] * 5)}, "x is of type <U1; numbers are wanted"),
        ({"time": None}, "time is missing; seconds since 1970 for each ping are wanted"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(write, change, words):
    arrays = {name: a for name, a in {**SERIES, **SIDES, **change}.items() if a is not None}
    with pytest.raises(ValueError, match=words):
        read(write(as_npz(arrays, {}, {})))


def test_one_value_serves_all_pings(write):
    recording = read(write(as_npz(but(sample_spacing=np.array(0.25)))))
    np.testing.assert_array_equal(recording.sample_spacing, 0.25)


def test_nothing_is_unpickled(write):
    buffer = io.BytesIO()
    np.savez(buffer, **SIDES, **but(x=np.array([print, 1, 2, 3, 4], dtype=object)))
    with pytest.raises(ValueError, match="Object arrays cannot be loaded"):
        read(write(buffer.getvalue()))


def test_an_archive_that_unpacks_to_far_more_than_itself_is_refused(write):
    bomb = as_npz(sides={"port": np.zeros((5, 4_000_000), np.float32)})
    with pytest.raises(ValueError, match=r"the archive says it unpacks to 8e\+07 bytes from \d+; less is wanted"):
        read(write(bomb))


def test_an_entry_that_is_no_array_is_refused(write):
    content = as_npz()
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as whole, zipfile.ZipFile(buffer, "w") as archive:
        for name in whole.namelist():
            archive.writestr(name, whole.read(name) if name != "x.npy" else b"no array")
    with pytest.raises(ValueError, match="x is no array but 8 bytes; an array is wanted"):
        read(write(buffer.getvalue()))


def test_an_array_that_claims_more_than_it_holds_is_refused(write):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 1000), }\n"
        archive.writestr("port.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(80))
    path = write(buffer.getvalue())
    with pytest.raises(ValueError, match=str(path)) as caught:
        read(path)
    assert "\n" not in str(caught.value)


@FORMATS
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_no_damage_makes_anything_but_a_recording_or_one_line(write, written, seed):
    path: Path = write(damaged(written(), np.random.default_rng(seed), keep=4))
    check_survival(path, 40)
