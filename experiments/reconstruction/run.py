"""The reconstruction experiment: scenes x motions x passes x seeds, every method; writes a table and figures."""

import argparse
import csv
import platform
import statistics
import subprocess
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import figures
import numpy as np
from fusion import Fused, Target, fuse, target
from metrics import as_row, columns, names
from rows import ROWS
from scenes import CALIBRATIONS, FLOORS, MOTIONS, PASSES, REPORTING_SEEDS, Dive, make_dive, rougher

Result = dict[str, str | float]
CASE = ("scene", "motion", "passes", "seed", "split", "method")
SHOWN = {
    "rmse": "RMSE [m]",
    "rmse_without_plane": "without plane [m]",
    "rmse_without_plane_over_altitude": "of altitude [%]",
    "rmse_over_relief": "of relief [%]",
    "correlation_20m": "corr. 20 m",
    "correlation_10m": "corr. 10 m",
    "slope_correlation_across": "slopes across",
    "slope_correlation_along": "slopes along",
    "normal_error": "normals [deg]",
    "z_score": "z rms",
    "ms_a_ping": "CPU ms a ping",
}


@dataclass(frozen=True)
class Case:
    """One dive to be reconstructed by every method."""

    scene: str
    motion: str
    passes: str
    seed: int


def cases(arguments: argparse.Namespace) -> list[Case]:
    """All that was asked for."""
    chosen = product(arguments.scenes, arguments.motions, arguments.passes, arguments.seeds)
    return [Case(*values) for values in chosen]


def results(case: Case, dive: Dive, wanted: Target, methods: Sequence[str]) -> Iterator[tuple[Result, Fused]]:
    """One row a method, and its map."""
    truth = dive.recording.truth
    assert truth is not None
    split = "reporting" if case.seed in REPORTING_SEEDS else "tuning"
    altitude = float(np.median(dive.bottom.altitude))
    for method in methods:
        start = time.process_time()
        submaps = ROWS[method](dive)
        seconds = time.process_time() - start
        fused = fuse(submaps, truth.trajectory, wanted.surface)
        found = as_row(columns(fused, wanted, altitude))
        key = dict(zip(CASE, (case.scene, case.motion, case.passes, case.seed, split, method), strict=True))
        yield {**key, **found, "ms_a_ping": 1e3 * seconds / dive.n_pings}, fused


def table(rows: Sequence[Result]) -> str:
    """Medians over the seeds, as markdown."""
    lines = [f"| scene | motion | passes | seeds | method | {' | '.join(SHOWN.values())} |"]
    lines.append("|---" * (5 + len(SHOWN)) + "|")
    groups: dict[tuple[str, ...], list[Result]] = {}
    for row in rows:
        key = (str(row["scene"]), str(row["motion"]), str(row["passes"]), str(row["split"]), str(row["method"]))
        groups.setdefault(key, []).append(row)
    for (scene, motion, passes, split, method), group in groups.items():
        medians = [statistics.median(float(row[name]) for row in group) for name in SHOWN]
        values = " | ".join(f"{value:.3g}" for value in medians)
        lines.append(f"| {scene} | {motion} | {passes} | {len(group)} {split} | {method} | {values} |")
    return "\n".join(lines) + "\n"


def write_rows(rows: Sequence[Result], path: Path) -> None:
    """All rows as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*CASE, *names(), "ms_a_ping"])
        writer.writeheader()
        writer.writerows(rows)


def where() -> str:
    """Commit and machine."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
    return f"commit {commit.stdout.strip()}, {platform.machine()}, Python {platform.python_version()}"


def run(arguments: argparse.Namespace) -> None:
    """Simulate, reconstruct, judge, write after every case."""
    arguments.out.mkdir(parents=True, exist_ok=True)
    rows: list[Result] = []
    warm = False
    for case in cases(arguments):
        try:
            dive = make_dive(case.scene, case.motion, case.passes, case.seed, CALIBRATIONS[arguments.calibration])
        except ValueError as error:
            print(f"{case} skipped: {error}", flush=True)
            continue
        dive = rougher(dive, arguments.roughness)
        wanted = target(dive)
        if not warm:  # compilation is not the methods' time
            list(results(case, dive, wanted, arguments.methods))
            warm = True
        found = list(results(case, dive, wanted, arguments.methods))
        rows += [row for row, _ in found]
        maps = {str(row["method"]): fused for row, fused in found}
        if case.seed == arguments.seeds[0]:
            figures.draw_case(dive, wanted, maps, (f"{case.scene} {case.motion} {case.passes}", arguments.out))
        write_rows(rows, arguments.out / "results.csv")
        (arguments.out / "table.md").write_text(f"{where()}\n\n{table(rows)}", encoding="utf-8")
        print(table([row for row, _ in found]).split("\n", 2)[2], end="", flush=True)
    if rows:
        figures.draw_summary(rows, arguments.out / "summary.jpg")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", choices=FLOORS, default=list(FLOORS))
    parser.add_argument("--motions", nargs="+", choices=MOTIONS, default=list(MOTIONS))
    parser.add_argument("--passes", nargs="+", choices=PASSES, default=list(PASSES))
    parser.add_argument(
        "--seeds", nargs="+", type=int, default=[10, 11, 12], help="0-3 for tuning, 10 and on to report."
    )
    parser.add_argument("--calibration", choices=CALIBRATIONS, default="mission", help="Where the sonar is calibrated.")
    parser.add_argument(
        "--roughness", type=float, default=1.0, help="Times the roughness [1] that calibration found of the seafloor."
    )
    parser.add_argument("--methods", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "out")
    run(parser.parse_args())


if __name__ == "__main__":
    main()
