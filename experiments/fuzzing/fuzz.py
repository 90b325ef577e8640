"""Fuzz readers: damaged inputs in turns, each in a process that may die without harm; turns add up in a ledger.

python -m experiments.fuzzing.fuzz JSF --seconds 240          from the root of the repository
python -m experiments.fuzzing.fuzz --rounds 5 --seconds 120   every format in turn, five times
python -m experiments.fuzzing.fuzz StarFish --file dive.logdoc --seconds 60
python -m experiments.fuzzing.fuzz JSF --seed 7 --first 1234 --inputs 1     one input again
python -m experiments.fuzzing.totals                          the table of all turns
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.fuzzing.subjects import SUBJECTS, Subject
from experiments.fuzzing.wounds import Files, wounded
from frontend.arrays import FloatArray
from frontend.georeference import Georeference
from sssslam.readers import formats

OUT = Path(__file__).parent / "out"
LEDGER = OUT / "ledger.jsonl"
# An input may take this long, the process this much memory beyond what it starts with, and a turn so much more time.
MAX_SECONDS, MAX_BYTES, PATIENCE = 5.0, 1 << 30, 60.0
GOOD = ("read", "refused")
_MAX_KEPT = 20
# Of a given file, which may be large, the beginning is taken: a StarFish log starts with 64 kB of settings.
_FIRST_BYTES = 1 << 17


@dataclass(frozen=True)
class Turn:
    """Inputs `first`, `first + 1`, ... of a seed, until the time is over or so many were read."""

    name: str
    seed: int
    first: int
    seconds: float
    inputs: int
    files: tuple[Path, ...] = ()

    @property
    def key(self) -> str:
        """What is fuzzed, with the names of given files."""
        return ":".join((self.name, *(file.name for file in self.files)))

    def whole(self) -> list[Files]:
        """The inputs before they are damaged."""
        made = SUBJECTS[self.name].make
        return [{"current": file.read_bytes()[:_FIRST_BYTES]} for file in self.files] or made()

    def input(self, wholes: list[Files], number: int) -> Files:
        """One damaged input; the same for the same seed and number."""
        rng = np.random.default_rng([self.seed, number])
        return wounded(wholes[rng.integers(len(wholes))], rng, SUBJECTS[self.name].keep)


def peak_bytes() -> int:
    """The most memory that this process has held."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def judge(subject: Subject, path: Path, size: int, baseline: int) -> str:
    """How the reading of one input ends: read, refused, or what was wrong with that."""
    started = time.perf_counter()
    try:
        outcome = subject.check(path, size)
    except AssertionError as error:
        outcome = f"unsound: {error}"
    except Exception as error:
        outcome = f"{type(error).__name__}: {error}"
    if time.perf_counter() - started > MAX_SECONDS:
        return f"slow: {time.perf_counter() - started:.1f} s"
    if peak_bytes() > baseline + MAX_BYTES:
        return f"memory: {(peak_bytes() - baseline) / 1e9:.2f} GB"
    return (outcome.splitlines() or ["no words"])[0][:150]


def plane_chart(self: Georeference, latitude: FloatArray, longitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Metres east and north of an origin, by latitude and longitude alone."""
    east = np.cos(np.radians(self.latitude)) * (np.asarray(longitude) - self.longitude)
    return 111.2e3 * east, 111.2e3 * (np.asarray(latitude) - self.latitude)


def leave_out_the_slow() -> None:
    """Set aside PROJ and the search for readers of other packages: nine tenths of the time, and not under test."""
    Georeference.to_local = plane_chart
    formats.entry_points = lambda group: []  # noqa: ARG005


def put(files: Files, folder: Path) -> Path:
    """Write an input over the one before; gives the file to open."""
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    return folder / next(iter(files))


def clear(files: Files, folder: Path) -> None:
    """Take an input of several files away, so that none is left beside the next."""
    for name in files if len(files) > 1 else ():
        (folder / name).unlink()


def fuzz(turn: Turn, progress: Path) -> None:
    """Read damaged inputs; prints how many and each outcome with its number, keeps what failed."""
    leave_out_the_slow()
    wholes, counts, number = turn.whole(), Counter[str](), turn.first
    with tempfile.TemporaryDirectory() as name, progress.open("r+b", buffering=0) as at, warnings.catch_warnings():
        warnings.simplefilter("error")
        folder, ends = Path(name), time.monotonic() + turn.seconds
        baseline = 0
        while time.monotonic() < ends and number < turn.first + turn.inputs:
            at.seek(0)
            at.write(b"%20d" % number)
            files = turn.input(wholes, number)
            outcome = judge(SUBJECTS[turn.name], put(files, folder), sum(map(len, files.values())), baseline or 1 << 60)
            clear(files, folder)
            baseline = baseline or peak_bytes()
            counts[outcome] += 1
            if outcome not in GOOD and sum(n for what, n in counts.items() if what not in GOOD) <= _MAX_KEPT:
                put(files, _made(OUT / f"{turn.key}-{turn.seed}-{number}"))
            number += 1
    print(json.dumps({"n": number - turn.first, "outcomes": counts}))


def _made(folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    return folder


def take_turn(turn: Turn) -> None:
    """Fuzz in a child; a ledger row whatever becomes of it."""
    progress = OUT / f"progress-{turn.key}"
    progress.write_bytes(b"%20d" % turn.first)
    command = [sys.executable, "-m", "experiments.fuzzing.fuzz", turn.name, "--child", "--seed", str(turn.seed)]
    command += ["--first", str(turn.first), "--seconds", str(turn.seconds), "--inputs", str(turn.inputs)]
    command += [word for file in turn.files for word in ("--file", str(file))]
    started = time.monotonic()
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=turn.seconds + PATIENCE, cwd=OUT.parents[2]
        )
        said = json.loads(done.stdout) if not done.returncode else _died(turn, progress, done.stderr)
    except subprocess.TimeoutExpired:
        said = _died(turn, progress, f"hung for {PATIENCE:g} s")
    row = {"key": turn.key, "seed": turn.seed, "first": turn.first, "seconds": round(time.monotonic() - started, 1)}
    with LEDGER.open("a") as ledger:
        ledger.write(json.dumps(row | {"commit": _commit()} | said) + "\n")
    print(turn.key, said, flush=True)


def _died(turn: Turn, progress: Path, words: str) -> dict[str, object]:
    """Counts of a turn whose process died: those before it are not known to be good, so only the last is counted."""
    number = int(progress.read_bytes())
    put(turn.input(turn.whole(), number), _made(OUT / f"{turn.key}-{turn.seed}-{number}"))
    last = (words.strip().splitlines() or ["no words"])[-1]
    return {"n": number + 1 - turn.first, "outcomes": {f"died: {last[:150]}": 1}}


def _commit() -> str:
    command = ["git", "-C", str(OUT.parent), "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def next_input(key: str, seed: int) -> int:
    """The first input of a seed that no turn has read."""
    lines = LEDGER.read_text().splitlines() if LEDGER.exists() else []
    rows = [row for row in map(json.loads, lines) if (row["key"], row["seed"]) == (key, seed)]
    return max((row["first"] + row["n"] for row in rows), default=0)


def _known(name: str) -> str:
    if name not in SUBJECTS:
        raise argparse.ArgumentTypeError(f"{name!r} is no format; one of {', '.join(SUBJECTS)} is wanted")
    return name


def main() -> None:
    """Take turns, each in a child."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("formats", type=_known, nargs="*", metavar="FORMAT", help=f"of {', '.join(SUBJECTS)}; or all")
    parser.add_argument("--file", type=Path, action="append", default=[], help="whole file to damage, not a made one")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a turn")
    parser.add_argument("--rounds", type=int, default=1, help="turns of each format")
    parser.add_argument("--seed", type=int, default=0, help="a turn goes on where the last one of this seed ended")
    parser.add_argument("--first", type=int, help="number of the first input, in place of that")
    parser.add_argument("--inputs", type=int, default=1_000_000, help="of a turn at most")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    OUT.mkdir(exist_ok=True)
    for name in list(options.formats or SUBJECTS) * options.rounds:
        turn = Turn(name, options.seed, 0, options.seconds, options.inputs, tuple(options.file))
        first = next_input(turn.key, turn.seed) if options.first is None else options.first
        turn = Turn(name, options.seed, first, options.seconds, options.inputs, tuple(options.file))
        if options.child:
            fuzz(turn, OUT / f"progress-{turn.key}")
        else:
            take_turn(turn)


if __name__ == "__main__":
    main()
