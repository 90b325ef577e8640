"""The one door to all formats: content decides, files make one dive, anything else is one line."""

import os
import stat
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from frontend.georeference import Georeference
from frontend.heightfield import Heightfield
from frontend.recording import Quantity, Recording, Truth
from frontend.trajectory import Trajectory
from sssslam.readers import Reader, formats, read
from sssslam.readers.joining import join
from sssslam.readers.netcdf import write_netcdf


def _recording(start: float = 0.0, n: int = 5, m: int = 4, **changes) -> Recording:
    k = np.arange(float(n))
    trajectory = Trajectory(start + k, k, 0 * k, 0 * k, 0 * k, 0 * k, 0 * k)
    side = np.full((n, m), start, dtype=np.float32)
    rows = {"sample_spacing": k + 1, "sound_speed": 1500 + k, "altitude": k, "depth": k, "speed": k}
    return replace(Recording(port=side, starboard=side + 1, trajectory_dr=trajectory, **rows), **changes)


def _refusal(*paths, **options) -> str:
    with pytest.raises(ValueError) as caught:  # noqa: PT011  the words are checked by the caller
        read(*paths, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_the_format_is_told_by_content_and_not_by_name(scene, write):
    dive = scene().to_bytes()
    recording = read(write(dive, "dive.nc"))
    container = write(b"", "dive.xtf")
    write_netcdf(recording, container)
    np.testing.assert_array_equal(read(container).port, recording.port)
    assert read(write(dive, "noname")).n_pings == 40


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty; a recording is wanted"),
        (b"Dear diary,\nno sonar today.\n", "the format is unknown (it is text); XTF, NetCDF (.nc)"),
        (b"{\x22a\x22: 1}", "the format is unknown (it is text)"),
        (b"\x00\x01\x02\x03\x04", "the format is unknown (it starts with the bytes 00 01 02 03)"),
    ],
)
def test_what_is_no_recording_is_refused(write, content, words):
    path = write(content)
    assert _refusal(path) == f"{path}: {words}" or words in _refusal(path)


def test_paths_that_are_no_files_are_refused(tmp_path):
    assert _refusal(tmp_path) == f"{tmp_path}: this is a directory; a recording is wanted"
    assert "there is no such file" in _refusal(tmp_path / "none.xtf")
    os.mkfifo(tmp_path / "pipe")
    assert "no regular file" in _refusal(tmp_path / "pipe")
    assert "no regular file" in _refusal(Path("/dev/zero"))
    too_long = _refusal(tmp_path / ("a" * 5000))
    assert "aaaaa: cannot be opened (File name too long); a recording is wanted" in too_long
    assert len(too_long) < 200
    assert "no file was given" in _refusal()


@pytest.fixture
def _somebody():
    """One who may not read every file, even where the tests run as one who may."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    yield
    os.seteuid(user)


@pytest.mark.parametrize("is_locked", ["file", "folder"])
def test_what_may_not_be_read_is_refused(write, request, is_locked):
    path = write(b"x")
    (path if is_locked == "file" else path.parent).chmod(stat.S_IWUSR)
    request.getfixturevalue("_somebody")
    assert "cannot be opened (Permission denied); a recording is wanted" in _refusal(path)
    os.seteuid(os.getuid())
    path.parent.chmod(stat.S_IRWXU)


def test_channels_of_a_container_cannot_be_chosen(scene, write):
    container = write(b"", "dive.nc")
    write_netcdf(read(write(scene().to_bytes())), container)
    assert "this container holds one pair only" in _refusal(container, channels="1,2")


def test_several_files_make_one_dive_in_the_order_of_time_and_in_one_frame(scene, write):
    whole = read(write(scene(n_pings=60).to_bytes()))
    packets = scene(n_pings=60).packets()
    header = scene().header()
    early = write(header + b"".join(packets[:25]), "b.xtf")
    late = write(header + b"".join(packets[25:]), "a.xtf")
    joined = read(late, early)
    for side in ("port", "starboard"):
        np.testing.assert_array_equal(getattr(joined, side), getattr(whole, side))
    for name in ("time", "x", "y", "z", "roll", "pitch", "yaw"):
        # Same packets in the same frame; only the projection's last digits may differ.
        np.testing.assert_allclose(getattr(joined.trajectory_dr, name), getattr(whole.trajectory_dr, name), atol=1e-9)
    assert joined.georeference == whole.georeference
    assert joined.source == "b.xtf, a.xtf"
    assert len(joined.source_sha256.split(", ")) == 2
    assert all(note.startswith(("a.xtf: ", "b.xtf: ")) for note in joined.notes)


def test_files_in_grid_metres_share_the_origin_of_the_first(scene, write):
    east = 4000.0 + np.arange(60.0)
    dive = scene(n_pings=60, nav_units=0, ping={"SensorXcoordinate": east, "SensorYcoordinate": 100.0})
    packets, header = dive.packets(), dive.header()
    early = write(header + b"".join(packets[:25]), "b.xtf")
    late = write(header + b"".join(packets[25:]), "a.xtf")
    np.testing.assert_allclose(read(late, early).trajectory_dr.x, np.arange(60.0), atol=1e-9)


def test_formats_mix_in_the_frame_of_the_first(scene, write):
    packets, header = scene(n_pings=60).packets(), scene().header()
    early = read(write(header + b"".join(packets[:25]), "early.xtf"))
    container = write(b"", "early.nc")
    write_netcdf(early, container)
    joined = read(write(header + b"".join(packets[25:]), "late.xtf"), container)
    # The second file's own frame starts 5 m north of the first: the same metres to a micrometre when brought over.
    np.testing.assert_allclose(joined.trajectory_dr.y, 0.2 * np.arange(60), atol=1e-3)
    assert joined.georeference == early.georeference


def test_the_same_file_twice_is_refused(scene, write):
    path = write(scene().to_bytes())
    assert "overlap in time" in _refusal(path, path)


def test_degrees_and_metres_do_not_mix(scene, write):
    paths = [write(scene(nav_units=units, ping={"Year": 2020 + units}).to_bytes(), f"{units}.xtf") for units in (0, 3)]
    assert "one has positions in degrees and one in metres" in _refusal(*paths)


def test_a_frame_that_lies_elsewhere_is_moved_and_turned_by_the_meridians_convergence():
    west, east = Georeference(60.0, 5.0), Georeference(60.0, 5.1)
    first = _recording(georeference=west)
    second = _recording(100.0, georeference=east)
    joined = join([first, second])
    # 0.1 degree of longitude at 60 degrees north: 6378137 / sqrt(1 - e2 sin2) cos(60) rad(0.1) = 5580.7 m.
    assert joined.trajectory_dr.x[5] == pytest.approx(5580.7, abs=1.0)
    # A track along the eastern frame's x axis runs the same way on the Earth: its positions tell its yaw.
    step = np.arctan2(np.diff(joined.trajectory_dr.y)[6], np.diff(joined.trajectory_dr.x)[6])
    assert joined.trajectory_dr.yaw[6] == pytest.approx(step, abs=1e-5)
    assert joined.trajectory_dr.yaw[6] != 0


def test_shorter_pings_are_filled_with_nan_and_all_else_is_chained():
    joined = join([_recording(100.0, m=3, n_dropped=2), _recording(0.0, m=4, n_dropped=1)])
    assert joined.port.shape == (10, 4)
    assert np.isnan(joined.port[5:, 3]).all()
    assert np.isfinite(joined.port[:5]).all()
    assert joined.n_dropped == 3
    np.testing.assert_array_equal(joined.sample_spacing, np.tile(np.arange(5) + 1.0, 2))
    assert "filled with NaN up to 4" in joined.notes[-1]


@pytest.mark.parametrize("name", ["frequency", "quantity"])
def test_different_sonars_do_not_mix(name):
    value = {"frequency": 4e5, "quantity": Quantity.LOG}[name]
    other = _recording(100.0)
    with pytest.raises(ValueError, match=f"differ in {name}: .*; one sonar is wanted"):
        join([_recording(), replace(other, sonar=replace(other.sonar, **{name: value}))])


def test_a_recording_without_place_does_not_mix_with_one_that_has():
    with pytest.raises(ValueError, match="no position on the Earth"):
        join([_recording(), _recording(100.0, georeference=Georeference(1.0, 2.0))])


def test_truth_and_sensors_are_chained_where_all_files_have_them():
    terrain = Heightfield(np.zeros((2, 2)), 1.0, (0.0, 0.0))
    parts = [
        _recording(start, sensors={"imu": {"time": np.array([start]), "gyro": np.ones((1, 3))}, **extra})
        for start, extra in ((0.0, {"dvl": {"time": np.zeros(1)}}), (100.0, {}))
    ]
    parts = [replace(part, truth=Truth(part.trajectory_dr, terrain)) for part in parts]
    joined = join(parts)
    np.testing.assert_array_equal(joined.truth.trajectory.time, joined.ping_time)
    np.testing.assert_array_equal(joined.sensors["imu"]["time"], [0.0, 100.0])
    assert joined.sensors["imu"]["gyro"].shape == (2, 3)
    assert "dvl" not in joined.sensors
    assert join([parts[0], replace(parts[1], truth=None)]).truth is None
    elsewhere = Truth(parts[1].trajectory_dr, replace(terrain, z=np.ones((2, 2))))
    assert join([parts[0], replace(parts[1], truth=elsewhere)]).truth is None


@pytest.fixture(autouse=True)
def _ask_anew():
    """What other packages offer is asked once: for each test anew."""
    formats.known_readers.cache_clear()
    yield
    formats.known_readers.cache_clear()


def _offer(monkeypatch, loaded) -> None:
    """Pretend that another package has an entry point that loads this."""

    class Offer(EntryPoint):
        def load(self):
            if isinstance(loaded, Exception):
                raise loaded
            return loaded

    monkeypatch.setattr(formats, "entry_points", lambda group: [Offer("diary", "diary:reader", group)])


def test_another_package_can_offer_a_reader(monkeypatch, write):
    reader = Reader("diary", lambda head: head.startswith(b"Dear"), lambda paths, _: [_recording() for _ in paths])
    _offer(monkeypatch, reader)
    assert read(write(b"Dear diary")).n_pings == 5
    assert " or diary is wanted" in _refusal(write(b"other", "other"))


@pytest.mark.parametrize("name", ["NetCDF (.nc)", "StarFish", "Humminbird (DAT or SON)", "NumPy (.npz)", "CSV"])
def test_where_there_is_one_pair_only_no_channels_are_chosen(name):
    (reader,) = (reader for reader in formats.BUILT_IN if reader.name == name)
    with pytest.raises(ValueError, match=r"^dive\.x: channels '3,4' were asked for; .* holds one pair only$"):
        reader.read([Path("dive.x")], "3,4")


def test_other_packages_are_asked_once(monkeypatch):
    asked = []
    monkeypatch.setattr(formats, "entry_points", lambda group: asked.append(group) or [])
    assert formats.known_readers() is formats.known_readers()
    assert asked == [formats.ENTRY_POINTS]


@pytest.mark.parametrize(
    ("loaded", "words"), [(RuntimeError("broken"), "cannot be loaded: broken"), ("text", "is a str")]
)
def test_a_reader_that_cannot_be_loaded_is_a_warning(monkeypatch, write, caplog, loaded, words):
    _offer(monkeypatch, loaded)
    assert "; XTF, NetCDF (.nc)" in _refusal(write(b"Dear diary"))
    assert words in caplog.text
