"""What is fuzzed: whole files of each format, made by the writers of the tests, and how each is read and judged."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, reduce
from operator import xor
from pathlib import Path

from experiments.fuzzing.wounds import Files
from frontend.recording import Recording
from sssslam.navigation.files import read_navigation
from sssslam.navigation.joining import join_navigation
from sssslam.readers import read
from sssslam.readers.netcdf import write_netcdf
from tests.sssslam.readers.conftest import XtfScene
from tests.sssslam.readers.damage import check_sound, survivor
from tests.sssslam.readers.humminbird_files import HumminbirdScene
from tests.sssslam.readers.jsf_files import (
    START,
    JsfScene,
    attitude,
    doppler,
    nmea,
    pressure,
    situation,
    situation_2,
)
from tests.sssslam.readers.lowrance_files import LowranceScene
from tests.sssslam.readers.starfish_files import StarfishScene
from tests.sssslam.readers.test_tables import as_csv, as_npz

GGA = "GPGGA,120000.00,4530.0000,N,00515.0000,W,1,10,0.9,10.0,M,,M,,"
_NAME = "current"
# A byte is a sample at most, but one long ping makes all others as wide, and compressed files hold more.
_MAX_SAMPLES_PER_BYTE = 100


def _check_reader(path: Path, size: int) -> str:
    """Read a recording: sound and no larger than its file lets it be, or an error of one line; gives which."""
    recording = survivor(path)
    if recording is None:
        return "refused"
    check_sound(recording, size)
    n_samples = recording.port.size + recording.starboard.size
    assert n_samples <= _MAX_SAMPLES_PER_BYTE * size, f"{n_samples} samples out of {size} bytes"
    return "read"


@dataclass(frozen=True)
class Subject:
    """A format under test.

    Parameters
    ----------
    keep : int
        Bytes at the start that stay, since the format is told by them.
    make : callable
        Gives whole inputs.
    check : callable
        Takes the path and the size in bytes of an input, gives ``read`` or ``refused``; an AssertionError or any other
        exception is a failure.
    """

    keep: int
    make: Callable[[], list[Files]]
    check: Callable[[Path, int], str] = _check_reader


def _alone(*contents: bytes) -> list[Files]:
    return [{_NAME: content} for content in contents]


def _container() -> bytes:
    """The XTF scene in the open container."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "dive.xtf", Path(folder) / "dive.nc"
        source.write_bytes(XtfScene(n_pings=8, n_samples=30).to_bytes())
        write_netcdf(read(source), target)
        return target.read_bytes()


def _jsf() -> bytes:
    """Two subsystems; attitude, NMEA and messages of every sensor."""
    north, flat = (45.0, 5.0), attitude(START, 1, 1) + nmea(START, GGA)
    said = situation(START, north, 10.0) + situation_2(START, north) + doppler(START, (0, 1500)) + pressure(START, 9)
    return flat + said + JsfScene(n_pings=8, n_samples=30, subsystems=(20, 21)).to_bytes()


def _humminbird() -> list[Files]:
    """A SON by itself, and whole dives opened by their DAT."""
    alone = _alone(HumminbirdScene(n_pings=8, n_samples=30).son(2))
    scenes = [HumminbirdScene(n_pings=8, n_samples=30, dat_size=size) for size in (64, 96)]
    sons = [{f"{_NAME}d/B00{beam}.SON": scene.son(beam) for beam in (2, 3)} for scene in scenes]
    return alone + [{f"{_NAME}d.DAT": scene.dat()} | son for scene, son in zip(scenes, sons, strict=True)]


def _lowrance() -> list[Files]:
    scenes = [LowranceScene(kind=k, n_pings=8, n_samples=30, channels=c) for k in (2, 3) for c in ((5,), (3, 4))]
    return _alone(*(scene.to_bytes() for scene in scenes))


@cache
def _dive() -> Recording:
    """The dive that navigation is joined to."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dive.xtf"
        path.write_bytes(XtfScene(n_pings=40, n_samples=30).to_bytes())
        return read(path)


def _check_navigation(path: Path, _: int) -> str:
    """Read navigation and join it to a dive: a sound recording, or an error of one line; gives which."""
    dive = _dive()
    try:
        joined = join_navigation(dive, read_navigation(path, float(dive.ping_time[0])))
    except ValueError as error:
        assert "\n" not in str(error)  # noqa: PT017  what is not refused must be sound, which is checked below
        assert path.name in str(error)  # noqa: PT017
        return "refused"
    check_sound(joined, dive.n_pings)
    return "read"


def _rows() -> list[dict[str, float]]:
    """What a log says twice a second around the dive."""
    start = float(_dive().ping_time[0])
    return [
        {"time": start + 0.5 * k, "north": 45.0 + 1e-5 * k, "east": 5.0 + 1e-5 * k, "heading": 1.0 + k}
        for k in range(-2, 12)
    ]


def _tables() -> list[Files]:
    """Numbers with commas between, and moments with decimal commas."""
    rows = _rows()
    plain = ["time,latitude,longitude,heading,depth,speed [kn],roll [deg]"]
    plain += [f"{r['time']:.3f},{r['north']:.7f},{r['east']:.7f},{r['heading']},5.5,3,1" for r in rows]
    other = ["Time;Easting;Northing;Yaw_rad;altitude"]
    other += [f"{_moment(r):%Y-%m-%dT%H:%M:%S};{5000 + r['heading']:.0f},5;2,5;0,1;9,5" for r in rows[::2]]
    return _alone("\n".join(plain).encode(), "\n".join(other).encode())


def _moment(row: Mapping[str, float]) -> datetime:
    return datetime.fromtimestamp(row["time"], UTC)


def _tum() -> list[Files]:
    rows = [f"{r['time']:.3f} {r['heading']} 2.0 -5.0 0 0 0.6 0.8" for r in _rows()]
    return _alone("\n".join(["# t x y z qx qy qz qw", *rows]).encode())


def _nmea() -> list[Files]:
    """Positions, headings, speeds and depths as a receiver and a compass write them."""
    lines = []
    for row in _rows():
        clock = _moment(row).strftime("%H%M%S.%f")[:-4]
        place = f"{4500 + 60 * (row['north'] - 45):.5f},N,{500 + 60 * (row['east'] - 5):010.5f},E"
        for words in (
            f"GPGGA,{clock},{place},1,10,0.9,10.0,M,,M,,",
            f"GPRMC,{clock},A,{place},3.0,45.0,{_moment(row):%d%m%y},,",
            f"HEHDT,{row['heading']},T",
            "SDDPT,12.5,0.3",
            f"PASHR,{clock},{row['heading']},T,1.0,2.0,0.1,,,,1",
        ):
            lines.append(f"${words}*{reduce(xor, words.encode()):02X}")
    return _alone("\r\n".join(lines).encode())


SUBJECTS = {
    "XTF": Subject(1, lambda: _alone(*(XtfScene(n_pings=8, n_samples=30, n_bytes=n).to_bytes() for n in (1, 2, 4)))),
    "NetCDF": Subject(8, lambda: _alone(_container())),
    "StarFish": Subject(20, lambda: _alone(StarfishScene(n_pings=8, n_samples=30).to_bytes())),
    "Humminbird": Subject(4, _humminbird),
    "JSF": Subject(16, lambda: _alone(_jsf())),
    "Lowrance": Subject(12, _lowrance),
    "NumPy": Subject(4, lambda: _alone(as_npz())),
    "CSV": Subject(0, lambda: _alone(as_csv())),
    "navigation-CSV": Subject(0, _tables, _check_navigation),
    "navigation-TUM": Subject(0, _tum, _check_navigation),
    "navigation-NMEA": Subject(0, _nmea, _check_navigation),
}
