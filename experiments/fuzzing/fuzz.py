"""Fuzz a reader: damaged files for a given time, each in a process that may die without harm.

python -m experiments.fuzzing.fuzz JSF --seconds 240          from the root of the repository
python -m experiments.fuzzing.fuzz StarFish --file dive.logdoc --seconds 60
"""

import argparse
import io
import resource
import subprocess
import sys
import tempfile
import time
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from frontend.arrays import FloatArray
from frontend.georeference import Georeference
from sssslam.readers import formats, read
from sssslam.readers.netcdf import write_netcdf
from tests.sssslam.readers.conftest import XtfScene
from tests.sssslam.readers.damage import check_survival, damaged
from tests.sssslam.readers.humminbird_files import HumminbirdScene
from tests.sssslam.readers.jsf_files import START, JsfScene, attitude, nmea
from tests.sssslam.readers.lowrance_files import LowranceScene
from tests.sssslam.readers.starfish_files import StarfishScene
from tests.sssslam.readers.test_tables import as_csv, as_npz

OUT = Path(__file__).parent / "out"
# An input may take this long, and the process this much memory beyond what it starts with.
MAX_SECONDS, MAX_BYTES = 5.0, 1 << 30
GGA = "GPGGA,120000.00,4530.0000,N,00515.0000,W,1,10,0.9,10.0,M,,M,,"


def container() -> bytes:
    """The XTF scene in the open container."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "dive.xtf", Path(folder) / "dive.nc"
        source.write_bytes(XtfScene(n_pings=8, n_samples=30).to_bytes())
        write_netcdf(read(source), target)
        return target.read_bytes()


def jsf() -> bytes:
    """Two subsystems, attitude and NMEA messages."""
    return attitude(START, 1, 1) + nmea(START, GGA) + JsfScene(n_pings=8, n_samples=30, subsystems=(20, 21)).to_bytes()


# Format: how many bytes at the start stay, by which it is told; and whole files of it.
FORMATS: dict[str, tuple[int, Callable[[], list[bytes]]]] = {
    "XTF": (1, lambda: [XtfScene(n_pings=8, n_samples=30, n_bytes=n).to_bytes() for n in (1, 2, 4)]),
    "NetCDF": (8, lambda: [container()]),
    "StarFish": (20, lambda: [StarfishScene(n_pings=8, n_samples=30).to_bytes()]),
    "Humminbird": (4, lambda: [HumminbirdScene(n_pings=8, n_samples=30).son(2)]),
    "JSF": (16, lambda: [jsf()]),
    "Lowrance": (
        12,
        lambda: [
            LowranceScene(kind=k, n_pings=8, n_samples=30, channels=c).to_bytes()
            for k in (2, 3)
            for c in ((5,), (3, 4))
        ],
    ),
    "NumPy": (4, lambda: [as_npz()]),
    "CSV": (0, lambda: [as_csv()]),
}


def peak_bytes() -> int:
    """The most memory that this process has held."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def judge(path: Path, max_pings: int, baseline: int) -> str:
    """How the reading of one file ends: read, refused, or what was wrong with that."""
    started = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            outcome = check_survival(path, max_pings)
    except AssertionError as error:
        outcome = f"unsound: {error}"
    except Exception as error:
        outcome = f"{type(error).__name__}: {error}"
    if time.perf_counter() - started > MAX_SECONDS:
        return f"slow: {time.perf_counter() - started:.1f} s"
    if peak_bytes() > baseline + MAX_BYTES:
        return f"memory: {(peak_bytes() - baseline) / 1e9:.2f} GB"
    return outcome.splitlines()[0][:150]


def plane_chart(self: Georeference, latitude: FloatArray, longitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Metres east and north of an origin, by latitude and longitude alone."""
    east = np.cos(np.radians(self.latitude)) * (np.asarray(longitude) - self.longitude)
    return 111.2e3 * east, 111.2e3 * (np.asarray(latitude) - self.latitude)


def leave_out_the_slow() -> None:
    """Set aside PROJ and the search for readers of other packages: nine tenths of the time, and not under test."""
    Georeference.to_local = plane_chart
    formats.entry_points = lambda group: []  # noqa: ARG005


def wounded(content: bytes, rng: np.random.Generator, keep: int) -> bytes:
    """Damage; in half of the archives it is done to an array inside, for behind a wrong checksum nothing is read."""
    if not content.startswith(b"PK") or rng.random() < 0.5:
        return damaged(content, rng, keep)
    result = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as whole, zipfile.ZipFile(result, "w") as archive:
        names = whole.namelist()
        chosen = names[rng.integers(len(names))]
        for name in names:
            archive.writestr(name, damaged(whole.read(name), rng) if name == chosen else whole.read(name))
    return result.getvalue()


def fuzz(name: str, files: list[Path], seconds: float, seed: int) -> None:
    """Read damaged files until the time is over; prints each outcome with its number, keeps what failed."""
    leave_out_the_slow()
    keep, make = FORMATS[name]
    contents = [file.read_bytes() for file in files] or make()
    rng, counts, failures = np.random.default_rng(seed), Counter[str](), 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "current"
        path.write_bytes(contents[0])
        judge(path, 10**9, 0)
        baseline, ends = peak_bytes(), time.monotonic() + seconds
        while time.monotonic() < ends:
            content = wounded(contents[rng.integers(len(contents))], rng, keep)
            path.write_bytes(content)
            (OUT / "current").write_bytes(content)
            outcome = judge(path, len(content), baseline)
            counts[outcome] += 1
            if outcome not in ("read", "refused") and failures < 50:
                failures += 1
                (OUT / f"{name}-{seed}-{failures}").write_bytes(content)
    for outcome, n in counts.most_common():
        print(f"{n}\t{outcome}")


def main() -> None:
    """Fuzz in a child, and start another where it dies."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("format", choices=FORMATS)
    parser.add_argument("--file", type=Path, action="append", default=[], help="whole file to damage, not a made one")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    OUT.mkdir(exist_ok=True)
    if options.child:
        fuzz(options.format, options.file, options.seconds, options.seed)
        return
    ends, counts, seed = time.monotonic() + options.seconds, Counter[str](), options.seed
    while (left := ends - time.monotonic()) > 0:
        command = [sys.executable, "-m", "experiments.fuzzing.fuzz", options.format, "--child", "--seed", str(seed)]
        command += [word for file in options.file for word in ("--file", str(file))] + ["--seconds", str(left)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            counts[f"died with {done.returncode}: {done.stderr.strip().splitlines()[-1:]}"] += 1
            (OUT / "current").rename(OUT / f"{options.format}-died-{seed}")
        for line in done.stdout.splitlines():
            n, outcome = line.split("\t", 1)
            counts[outcome] += int(n)
        seed += 1000
    total = sum(counts.values())
    print(f"{options.format}: {total} inputs in {options.seconds:g} s, seed {options.seed}")
    for outcome, n in counts.most_common():
        print(f"{n:9d}  {outcome}")


if __name__ == "__main__":
    main()
