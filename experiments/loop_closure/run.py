"""Place recognition on reconstructed relief: one JSON a row and dive, made once; then the report of all."""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import peers
import report
from dives import FLOORS, INFORMATIVE, REPORTING_SEEDS, TUNING_SEEDS, Dive, load_dive
from pairs import Pair, pairs_of
from rows import ROWS, Place

from frontend.frames import planar_parameters, wrap_angle

Record = dict[str, Any]
HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Job:
    """A row over the dives of some floors and seeds, so many pairs of each."""

    row: str
    surface: str
    headings: tuple[str, ...]
    floors: tuple[str, ...]
    seeds: tuple[int, ...]
    n_pairs: int

    def file(self, floor: str, seed: int, folder: Path) -> Path:
        """Where its records of a dive are kept."""
        return folder / f"{self.row}-{self.surface}-{'-'.join(self.headings)}-{floor}-{seed}.json"


_SOME = ("fractal-0.8", "boulders")  # for the slow rows
_PEERS = ("ransac", "fgr", "kiss-matcher", "map-closures")
_RELIEF = (*INFORMATIVE, "falls")
_FIRST = REPORTING_SEEDS[:1]
JOBS = (
    Job("chain", "reconstructed", ("known",), tuple(FLOORS), TUNING_SEEDS + REPORTING_SEEDS, 100),
    Job("chain", "true", ("known",), _RELIEF, _FIRST, 40),
    Job("correlation", "reconstructed", ("known",), _RELIEF, _FIRST, 40),
    *(Job(row, "reconstructed", ("known", "unknown"), _SOME, _FIRST, 12) for row in _PEERS),
    Job("chain", "reconstructed", ("unknown",), tuple(FLOORS), REPORTING_SEEDS, 24),
    *(Job(row, "true", ("known", "unknown"), _SOME, _FIRST, 12) for row in _PEERS),
    Job("correlation", "reconstructed", ("unknown",), _SOME, _FIRST, 12),
)


class Workshop:
    """Dives and their places, kept while the same ones are asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._places: dict[tuple[str, int, str], tuple[Dive, list[Place]]] = {}

    def places(self, floor: str, seed: int, surface: str) -> tuple[Dive, list[Place]]:
        """A dive and the places of its submaps."""
        key = (floor, seed, surface)
        if key not in self._places:
            if len(self._places) > 3:
                self._places.pop(next(iter(self._places)))
            dive = load_dive(floor, seed, self._folder)
            submaps = dive.submaps if surface == "reconstructed" else dive.true_submaps
            self._places[key] = dive, [Place(submap) for submap in submaps]
        return self._places[key]


def run(job: Job, floor: str, seed: int, workshop: Workshop) -> list[Record]:
    """All records of a row over one dive."""
    dive, places = workshop.places(floor, seed, job.surface)
    _, others = workshop.places(floor, other_seed(seed), job.surface)
    pairs = chosen(pairs_of([place.layers for place in places], dive.T_world_submap, seed), job.n_pairs, seed)
    records = []
    for pair in pairs:
        target, source = places[pair.target], (others if pair.elsewhere else places)[pair.source]
        records += [record(job, pair, heading, (target, source)) for heading in job.headings]
    return [{"floor": floor, "seed": seed, "row": job.row, "surface": job.surface, **r} for r in records]


def other_seed(seed: int) -> int:
    """The seed whose floor stands for another place; it shares nothing with this one."""
    seeds = TUNING_SEEDS + REPORTING_SEEDS
    return seeds[(seeds.index(seed) + 1) % len(seeds)]


def chosen(pairs: Sequence[Pair], n: int, seed: int) -> list[Pair]:
    """So many pairs, the classes of overlap by turns; fewer are a part of more."""
    order = np.random.default_rng([seed, 3]).permutation(len(pairs))
    classes: dict[str, list[Pair]] = {}
    for k in order:
        classes.setdefault(report.overlap_class(pairs[k].overlap, pairs[k].elsewhere), []).append(pairs[k])
    queues = [classes[name] for name in sorted(classes)]
    turns = [queue[k] for k in range(len(pairs)) for queue in queues if k < len(queue)]
    return turns[:n]


def record(job: Job, pair: Pair, heading: str, places: tuple[Place, Place]) -> Record:
    """What a row finds of a pair, and how far it is from the truth."""
    start = time.perf_counter()
    found = ROWS[job.row](*places, pair.prior(heading))
    seconds = time.perf_counter() - start
    x, y, yaw = planar_parameters(found.T_target_source)
    x_ref, y_ref, yaw_ref = planar_parameters(pair.T_target_source)
    away = {"error_x": x - x_ref, "error_y": y - y_ref, "error_yaw": float(wrap_angle(yaw - yaw_ref))}
    return {
        "heading": heading,
        "target": pair.target,
        "source": pair.source,
        "elsewhere": pair.elsewhere,
        "true_overlap": pair.overlap,
        "turn": pair.turn,
        "score": float(found.score),
        "ms": 1e3 * seconds,
        **away,
        **found.numbers,
    }


def main() -> None:
    """Make the records that are not there, then the report of all that are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", nargs="+", choices=list(ROWS), default=list(ROWS))
    parser.add_argument("--surfaces", nargs="+", choices=("reconstructed", "true"), default=["reconstructed", "true"])
    parser.add_argument("--headings", nargs="+", choices=("known", "unknown"), default=["known", "unknown"])
    parser.add_argument("--floors", nargs="+", choices=list(FLOORS), default=list(FLOORS))
    parser.add_argument("--seeds", nargs="+", type=int, default=[*TUNING_SEEDS, *REPORTING_SEEDS])
    parser.add_argument("--out", type=Path, default=HERE / "out")
    parser.add_argument("--report", action="store_true", help="only the report of what is there")
    arguments = parser.parse_args()
    folder = arguments.out / "pairs"
    folder.mkdir(parents=True, exist_ok=True)
    workshop = Workshop(arguments.out / "dives")
    for job in [] if arguments.report else JOBS:
        wanted = job.row in arguments.rows and job.surface in arguments.surfaces
        if not wanted or not set(job.headings) & set(arguments.headings):
            continue
        if not peers.is_installed(job.row):
            print(f"{job.row} is not installed: left out", flush=True)
            continue
        for seed in (seed for seed in job.seeds if seed in arguments.seeds):
            for floor in (floor for floor in job.floors if floor in arguments.floors):
                make(job, (floor, seed), folder, workshop)
    report.write(sorted(folder.glob("*.json")), arguments.out)


def make(job: Job, dive: tuple[str, int], folder: Path, workshop: Workshop) -> None:
    """Make the records of a row and dive where they are not there."""
    file = job.file(*dive, folder)
    if file.exists():
        return
    try:
        records = run(job, *dive, workshop)
    except ValueError as error:
        print(f"{file.stem}: left out: {error}", flush=True)
        return
    partial = file.with_suffix(".part")
    partial.write_text(json.dumps(records, indent=0))
    partial.replace(file)
    print(f"{file.stem}: {len(records)} pairs, {np.median([r['ms'] for r in records]):.0f} ms a pair", flush=True)


if __name__ == "__main__":
    main()
