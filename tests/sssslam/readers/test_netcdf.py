"""The open container: what goes in comes out, to the bit, and twice the same bytes."""

import hashlib
import resource
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from frontend.georeference import Georeference
from frontend.heightfield import Heightfield
from frontend.recording import Quantity, Recording, SonarGeometry, Truth
from frontend.trajectory import Trajectory
from sssslam.readers import netcdf_layout, read
from sssslam.readers.netcdf import read_netcdf, write_netcdf
from sssslam.readers.netcdf_writing import write_netcdf_chunks
from tests.sssslam.readers.damage import damaged, survivor


def assert_same(one: object, other: object) -> None:
    """Equal in type, in shape and to the bit."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert one.tobytes() == other.tobytes()
    elif is_dataclass(one):
        for f in fields(one):
            assert_same(getattr(one, f.name), getattr(other, f.name))
    elif isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_same(one[key], other[key])
    elif isinstance(one, float):
        assert np.float64(one).tobytes() == np.float64(other).tobytes()
    else:
        assert one == other


def _trajectory(n: int, rng: np.random.Generator) -> Trajectory:
    return Trajectory(1.7e9 + np.cumsum(rng.uniform(0.05, 0.2, n)), *rng.normal(size=(6, n)))


def _recording(n: int = 30, m: int = 17, seed: int = 3) -> Recording:
    """Every field filled, with NaN where it may be."""
    rng = np.random.default_rng(seed)
    port, starboard = rng.gamma(1.0, 100.0, (2, n, m)).astype(np.float32)
    port[0, -1] = starboard[-1] = np.nan
    altitude = rng.uniform(3, 9, n)
    altitude[-1] = np.nan
    terrain = Heightfield(rng.normal(size=(5, 7)), 0.5, (-3.0, 0.1))
    terrain.z[1, 1] = np.nan
    imu = {"time": np.arange(4.0), "gyro": rng.normal(size=(4, 3)), "acceleration": rng.normal(size=(4, 3))}
    dvl = {"time": np.arange(2.0), "velocity": rng.normal(size=(2, 3)), "covariance": rng.normal(size=(2, 3, 3))}
    return Recording(
        port=port,
        starboard=starboard,
        sample_spacing=rng.uniform(0.02, 0.03, n),
        sound_speed=rng.uniform(1480, 1500, n),
        trajectory_dr=_trajectory(n, rng),
        altitude=altitude,
        depth=np.full(n, np.nan),
        speed=rng.uniform(1, 2, n),
        sonar=SonarGeometry(6e5, np.nan, 0.9, 0.3, (1.0, 0.1, -0.2), (1.0, -0.1, -0.2), Quantity.AMPLITUDE),
        georeference=Georeference(48.123456789012345, -68.98765432109876),
        source="dive ä.xtf",
        source_sha256="ab" * 32,
        notes=("one\nnote", "zweite, Ähre", ""),
        n_dropped=7,
        truth=Truth(_trajectory(n, rng), terrain),
        sensors={"imu": imu, "dvl": dvl, "gnss": {"time": np.zeros(0), "latitude": np.zeros(0)}},
    )


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_recording_comes_back_to_the_bit(tmp_path):
    recording = _recording()
    write_netcdf(recording, tmp_path / "a.nc")
    assert_same(recording, read_netcdf(tmp_path / "a.nc"))


@pytest.mark.parametrize("notes", [(), ("",), ("one",), ("a", "b")])
def test_a_bare_recording_comes_back_to_the_bit(tmp_path, notes):
    bare = replace(
        _recording(1, 1),
        sonar=SonarGeometry(),
        georeference=None,
        source="",
        source_sha256="",
        notes=notes,
        n_dropped=0,
        truth=None,
        sensors={},
    )
    write_netcdf(bare, tmp_path / "a.nc")
    assert_same(bare, read_netcdf(tmp_path / "a.nc"))
    assert read_netcdf(tmp_path / "a.nc").sonar == bare.sonar


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    port=npst.arrays(np.float32, (3, 4), elements=st.floats(width=32)),
    altitude=npst.arrays(np.float64, 3, elements=st.floats()),
    notes=st.lists(st.text()),
)
def test_any_floats_and_any_words_come_back_to_the_bit(tmp_path, port, altitude, notes):
    recording = replace(_recording(3, 4), port=port, altitude=altitude, notes=tuple(notes), truth=None, sensors={})
    write_netcdf(recording, tmp_path / "a.nc")
    assert_same(recording, read_netcdf(tmp_path / "a.nc"))


def test_truth_without_terrain_comes_back(tmp_path):
    recording = replace(_recording(), truth=replace(_recording().truth, terrain=None))
    write_netcdf(recording, tmp_path / "a.nc")
    assert_same(recording.truth, read_netcdf(tmp_path / "a.nc").truth)


def test_the_same_recording_makes_the_same_bytes(tmp_path):
    for name in ("a.nc", "b.nc"):
        write_netcdf(_recording(), tmp_path / name)
    assert _sha256(tmp_path / "a.nc") == _sha256(tmp_path / "b.nc")


def test_what_was_read_is_written_as_the_same_bytes(tmp_path):
    write_netcdf(_recording(), tmp_path / "a.nc")
    write_netcdf(read_netcdf(tmp_path / "a.nc"), tmp_path / "b.nc")
    assert _sha256(tmp_path / "a.nc") == _sha256(tmp_path / "b.nc")


def test_every_variable_says_its_unit_and_its_name(tmp_path):
    write_netcdf(_recording(), tmp_path / "a.nc")

    def check(group: netCDF4.Group) -> None:
        for variable in group.variables.values():
            assert variable.units
            assert variable.long_name
        for child in group.groups.values():
            check(child)

    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        check(file)
        assert file["sensors/imu/gyro"].units == "rad/s"
        assert file["sensors/dvl/velocity"].units == "m/s"
        assert file["truth/terrain"].units == "m"
        assert file.variables["yaw"].units == "rad"


def test_time_opens_as_dates_elsewhere(tmp_path):
    recording = _recording()
    write_netcdf(recording, tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc") as dataset:
        assert str(dataset["ping_time"].values[0]).startswith("2023-11-14T22:13")


def test_a_file_that_exists_is_replaced_and_no_part_stays(tmp_path):
    path = tmp_path / "a.nc"
    path.write_text("old")
    write_netcdf(_recording(), path)
    assert read(path).n_pings == 30
    assert [p.name for p in tmp_path.iterdir()] == ["a.nc"]


def test_a_failure_leaves_the_old_file_and_no_part(tmp_path, monkeypatch):
    path = tmp_path / "a.nc"
    path.write_text("old")

    def fail(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("sssslam.readers.netcdf_writing._truth", fail)
    with pytest.raises(KeyboardInterrupt):
        write_netcdf(_recording(), path)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.nc"]


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    with pytest.raises(ValueError, match=r"a\.nc: cannot be written"):
        write_netcdf(_recording(), tmp_path / "none" / "a.nc")


def _pieces(recording: Recording, *cuts: int) -> list[Recording]:
    """A recording cut before some of its pings, its sensors' answers shared out by time."""
    edges = [0, *cuts, recording.n_pings]
    starts = [-np.inf, *recording.ping_time[list(cuts)], np.inf]
    pieces = []
    for k in range(len(edges) - 1):
        heard = {}
        for name, series in recording.sensors.items():
            inside = (series["time"] >= starts[k]) & (series["time"] < starts[k + 1])
            heard[name] = {key: values[inside] for key, values in series.items()}
        pieces.append(replace(recording[edges[k] : edges[k + 1]], sensors=heard))
    return pieces


def _timed_recording(n: int = 700, m: int = 17) -> Recording:
    """Longer than two of the container's chunks; its sensors speak while it runs."""
    recording = _recording(n, m)
    imu = {"time": recording.ping_time[0] + np.arange(900) * 0.05, "gyro": np.zeros((900, 3)) + np.arange(3)}
    return replace(recording, sensors={**recording.sensors, "imu": imu})


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cuts=st.sets(st.integers(1, 699), max_size=4))
def test_a_recording_written_in_pieces_comes_back_as_written_at_once(tmp_path, cuts):
    recording = _timed_recording()
    write_netcdf(recording, tmp_path / "once.nc")
    write_netcdf_chunks(_pieces(recording, *sorted(cuts)), tmp_path / "pieces.nc")
    assert_same(read_netcdf(tmp_path / "once.nc"), read_netcdf(tmp_path / "pieces.nc"))
    assert_same(recording, read_netcdf(tmp_path / "pieces.nc"))


@pytest.mark.parametrize("changes", [{"sensors": {}}, {"truth": None}, {"sonar": SonarGeometry()}])
def test_a_barer_recording_in_pieces_comes_back(tmp_path, changes):
    recording = replace(_timed_recording(), **changes)
    write_netcdf_chunks(_pieces(recording, 1, 300), tmp_path / "a.nc")
    assert_same(recording, read_netcdf(tmp_path / "a.nc"))


def test_a_sensor_that_speaks_late_or_falls_silent_is_kept(tmp_path):
    first, second, third = _pieces(_timed_recording(), 200, 400)
    fix = {"time": second.ping_time[:2], "latitude": np.ones(2)}
    pieces = [replace(first, sensors={}), replace(second, sensors={"gnss": fix}), replace(third, sensors={})]
    write_netcdf_chunks(pieces, tmp_path / "a.nc")
    assert_same({"gnss": fix}, read_netcdf(tmp_path / "a.nc").sensors)


def test_the_same_pieces_make_the_same_bytes(tmp_path):
    for name in ("a.nc", "b.nc"):
        write_netcdf_chunks(_pieces(_timed_recording(), 256, 512), tmp_path / name)
    assert _sha256(tmp_path / "a.nc") == _sha256(tmp_path / "b.nc")


def test_pieces_say_units_and_names_as_a_whole_recording_does(tmp_path):
    write_netcdf(_timed_recording(), tmp_path / "once.nc")
    write_netcdf_chunks(_pieces(_timed_recording(), 300), tmp_path / "pieces.nc")
    for group in (None, "truth", "sensors/imu"):
        once, pieces = (xr.open_dataset(tmp_path / name, group=group) for name in ("once.nc", "pieces.nc"))
        with once, pieces:
            xr.testing.assert_identical(once, pieces)


def _refusal(pieces, path: Path) -> str:
    """What is said of pieces that cannot be joined; no file is left."""
    with pytest.raises(ValueError) as caught:  # noqa: PT011  the words are checked by the caller
        write_netcdf_chunks(pieces, path)
    assert list(path.parent.iterdir()) == []
    return str(caught.value)


def test_pieces_that_do_not_follow_each_other_are_refused(tmp_path):
    first, second, third = _pieces(_timed_recording(), 200, 400)
    path = tmp_path / "a.nc"
    assert _refusal([], path) == "no recording given, at least one wanted"
    assert "a later one wanted" in _refusal([first, third, second], path)
    assert "a later one wanted" in _refusal([first, first], path)
    bare = replace(_timed_recording(), sensors={})
    assert "a later one wanted" in _refusal([bare[:201], bare[200:]], path)
    for changes in ({"sonar": SonarGeometry(1e5)}, {"truth": None}, {"georeference": None}):
        assert "pieces of one recording wanted" in _refusal([first, replace(second, **changes)], path)
    narrow = replace(second, port=second.port[:, :-1], starboard=second.starboard[:, :-1])
    assert "pieces of one recording wanted" in _refusal([first, narrow], path)


def test_sensors_that_repeat_themselves_or_change_are_refused(tmp_path):
    recording = _timed_recording()
    assert "given again, only those of the piece wanted" in _refusal([recording[:200], recording[200:]], tmp_path / "a")
    first, second = _pieces(recording, 200)
    other = replace(second, sensors={"imu": {"time": second.ping_time}})
    assert "the imu's series ['time'] given, ['gyro', 'time'] wanted as before" in _refusal(
        [first, other], tmp_path / "a"
    )


def test_a_failure_between_pieces_leaves_the_old_file_and_no_part(tmp_path):
    def interrupted():
        yield _pieces(_timed_recording(), 200)[0]
        raise KeyboardInterrupt

    path = tmp_path / "a.nc"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        write_netcdf_chunks(interrupted(), path)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.nc"]


def test_pieces_at_a_place_that_cannot_be_written_are_one_line(tmp_path):
    with pytest.raises(ValueError, match=r"a\.nc: cannot be written"):
        write_netcdf_chunks([_recording()], tmp_path / "none" / "a.nc")


@pytest.fixture
def full_disk():
    """No file grows beyond 60 kB."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_is_one_line_and_leaves_no_part(tmp_path):
    path = tmp_path / "a.nc"
    assert "a.nc: cannot be written" in _refusal(_pieces(_timed_recording(), 256, 512), path)
    with pytest.raises(ValueError, match=r"a\.nc: cannot be written"):
        write_netcdf(_timed_recording(), path)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def foreign(tmp_path):
    """Writes what a stranger would: only what is required, changed as asked."""

    def write(drop=(), **changes) -> Path:
        n = 3
        rows = {name: ("ping", np.arange(n, dtype="i4")) for name in ("x", "y", "z", "roll", "pitch", "yaw")}
        dataset = {
            "ping_time": ("ping", np.arange(n, dtype=float), {"units": "seconds since 1970-01-01T00:00:00Z"}),
            "port": (("ping", "sample"), np.ones((n, 4), dtype="u2")),
            "starboard": (("ping", "sample"), np.ones((n, 4), dtype="u2")),
            "sample_spacing": ("ping", np.full(n, 0.5)),
            "sound_speed": ("ping", np.full(n, 1500.0)),
            **rows,
            **changes,
        }
        attributes = dataset.pop("attrs", {})
        truth = dataset.pop("truth", None)
        path = tmp_path / "foreign.nc"
        xr.Dataset({k: v for k, v in dataset.items() if k not in drop}, attrs=attributes).to_netcdf(path)
        if truth is not None:
            xr.Dataset({**{k: dataset[k] for k in (*rows, "ping_time")}, **truth}).to_netcdf(
                path, group="truth", mode="a"
            )
        return path

    return write


def test_only_what_is_required_is_required(foreign):
    recording = read(foreign())
    assert recording.port.dtype == np.float32
    assert recording.trajectory_dr.x.dtype == np.float64
    assert np.isnan(recording.altitude).all()
    assert recording.georeference is None
    assert recording.notes == ()
    assert recording.sonar == SonarGeometry()


def test_the_range_may_stand_for_the_spacing(foreign):
    recording = read(foreign(drop=["sample_spacing"], slant_range_max=("ping", np.full(3, 30.0), {"units": "metres"})))
    np.testing.assert_array_equal(recording.sample_spacing, 7.5)


def test_packed_and_transposed_echoes_are_unpacked(foreign):
    packed = np.arange(12, dtype="i2").reshape(4, 3)
    attributes = {"scale_factor": 0.5, "add_offset": 1.0, "_FillValue": np.int16(5)}
    recording = read(foreign(port=(("sample", "ping"), packed, attributes)))
    expected = packed.T * 0.5 + 1.0
    expected[2, 1] = np.nan
    np.testing.assert_array_equal(recording.port, expected)


@pytest.mark.parametrize(
    ("units", "first"), [("s", 0.0), ("seconds since 2020-01-01", 1577836800.0), ("milliseconds since 1970-01-01", 0.0)]
)
def test_times_from_another_date_are_converted(foreign, units, first):
    recording = read(foreign(ping_time=("ping", np.arange(3.0), {"units": units})))
    assert recording.ping_time[0] == first
    assert recording.ping_time[1] - first == (1.0 if units != "milliseconds since 1970-01-01" else 0.001)


def test_notes_of_another_writer_are_taken_as_they_are(foreign):
    assert read(foreign(attrs={"notes": "calm sea"})).notes == ("calm sea",)
    assert read(foreign(attrs={"notes": "12"})).notes == ("12",)


def test_the_grid_of_a_terrain_may_be_told_by_its_axes(foreign):
    truth = {
        "terrain": (("terrain_y", "terrain_x"), np.zeros((2, 3))),
        "terrain_x": ("terrain_x", [1.0, 3.0, 5.0]),
        "terrain_y": ("terrain_y", [0.0, 2.0]),
    }
    terrain = read(foreign(truth=truth)).truth.terrain
    assert (terrain.spacing, terrain.origin) == (2.0, (1.0, 0.0))
    truth["terrain_x"] = ("terrain_x", [1.0, 3.0, 6.0])
    with pytest.raises(ValueError, match="not evenly spaced"):
        read(foreign(truth=truth))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"drop": ["port"]}, "the variable port is missing; port(ping, sample) is wanted"),
        ({"drop": ["ping_time"]}, "the variable ping_time is missing; ping_time(ping) is wanted"),
        ({"drop": ["yaw"]}, "the variable yaw is missing"),
        ({"drop": ["sample_spacing"]}, "the variable sample_spacing is missing"),
        ({"yaw": ("ping", np.zeros(3), {"units": "degrees"})}, "yaw is in 'degrees'; 'rad' is wanted"),
        ({"x": ("easting", np.zeros(3))}, "x has the dimensions (easting); (ping) is wanted"),
        ({"x": ("ping", ["a", "b", "c"])}, "numbers are wanted"),
        ({"x": ("ping", [0.0, np.nan, 0.0])}, "navigation must be finite: x of ping 1 is not"),
        ({"ping_time": ("ping", [1.0, 1.0, 2.0])}, "ping times must increase strictly: ping 1"),
        ({"ping_time": ("ping", np.arange(3.0), {"units": "fortnights since then"})}, "unable to decode time"),
        ({"attrs": {"quantity": "loudness"}}, "quantity is 'loudness'; intensity, amplitude, log, unknown is wanted"),
        ({"attrs": {"lever_arm_port": [1.0, 2.0]}}, "lever_arm_port has 2 numbers; forward, port and up are wanted"),
    ],
)
def test_what_a_stranger_got_wrong_is_one_line(foreign, changes, words):
    path = foreign(**changes)
    with pytest.raises(ValueError) as caught:  # noqa: PT011  the words are checked below
        read(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("pings", "said"), [(1 << 22, "1.1e+06 MB"), (1 << 14, "4295 MB")])
def test_a_container_that_says_it_holds_more_than_fits_is_refused(tmp_path, pings, said):
    path = tmp_path / "huge.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("ping", pings)
        file.createDimension("sample", 1 << 16)
        file.createVariable("port", "f4", ("ping", "sample"), zlib=True)
    with pytest.raises(ValueError) as caught:  # noqa: PT011  the words are checked below
        read(path)
    assert f"{path}: the container says it holds {said}; at most " in str(caught.value)


def test_a_container_of_zeros_is_no_bomb(tmp_path):
    recording = _recording()
    zeros = np.zeros((recording.n_pings, 100_000), dtype=np.float32)
    write_netcdf(replace(recording, port=zeros, starboard=zeros), tmp_path / "zeros.nc")
    # More than fits in a small file without deflation of a hundred to one and more.
    assert 2 * zeros.nbytes > max(1 << 24, 100 * (tmp_path / "zeros.nc").stat().st_size)
    assert read(tmp_path / "zeros.nc").n_samples == 100_000


@pytest.mark.parametrize("error", [AttributeError("NetCDF: Can't open\nHDF5 attribute"), ZeroDivisionError("by zero")])
def test_whatever_the_library_says_of_damage_is_one_line(tmp_path, monkeypatch, error):
    def fail(*_, **__):
        raise error

    write_netcdf(_recording(), tmp_path / "dive.nc")
    monkeypatch.setattr(xr, "open_dataset", fail)
    with pytest.raises(ValueError, match=r"dive\.nc: the container is damaged \((NetCDF: Can't open HDF5|by zero)"):
        read(tmp_path / "dive.nc")


def test_a_cut_container_is_one_line(tmp_path):
    whole, path = tmp_path / "a.nc", tmp_path / "cut.nc"
    write_netcdf(_recording(), whole)
    content = whole.read_bytes()
    for cut in np.random.default_rng(5).integers(8, len(content), 10):
        path.write_bytes(content[:cut])
        with pytest.raises(ValueError, match=r"cut\.nc") as caught:
            read(path)
        assert "\n" not in str(caught.value)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_no_damage_makes_anything_but_a_recording_or_one_line(tmp_path, seed):
    whole, path = tmp_path / "whole.nc", tmp_path / "damaged.nc"
    if not whole.exists():
        write_netcdf(_recording(), whole)
    path.write_bytes(damaged(whole.read_bytes(), np.random.default_rng(seed), keep=8))
    # What is not refused holds the numbers it holds: a container is its own word for them.
    survivor(path)


def test_the_layout_knows_a_unit_for_what_sensors_are_called():
    assert netcdf_layout.sensor_unit("time") == netcdf_layout.TIME_UNITS
    assert netcdf_layout.sensor_unit("heading") == "rad"
    assert netcdf_layout.sensor_unit("temperature") == "1"
