"""Why accepted closures are less exact than they say: what each assumption is worth, and where submaps lie in truth."""

import argparse
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from dives import INFORMATIVE, REPORTING_SEEDS, TUNING_SEEDS, load_dive
from report import is_right
from rows import CONFIG, Place
from scipy.stats import chi2

from frontend.arrays import FloatArray
from frontend.frames import invert, planar_parameters, planar_pose, wrap_angle
from frontend.verification import verify

Record = dict[str, Any]
HERE = Path(__file__).resolve().parent
HALF_STEP = 0.2  # [m] between the middle of two pings and the second of them, at 2 m/s and 5 Hz
MISALIGNMENT = np.radians(0.5)  # of the velocity against the compass in grade `mems`
_FLOOR = np.array([CONFIG.registration.min_sigma, CONFIG.registration.min_sigma, CONFIG.registration.min_sigma_yaw])


def shifts(floor: str, seed: int, folder: Path) -> str:
    """A line of the table: how each submap of a dive lies on the true floor."""
    dive = load_dive(floor, seed, folder)
    pairs = [(Place(a).layers, Place(b).layers) for a, b in zip(dive.true_submaps, dive.submaps, strict=True)]
    found = [verify(true, made, np.eye(4), CONFIG.registration).T_target_source for true, made in pairs]
    x, y, yaw = np.array([planar_parameters(T) for T in found]).T
    cells = [f"{a.mean():+.2f} +- {a.std():.2f}" for a in (x, y, np.degrees(yaw))]
    return f"| {floor} | {seed} | {' | '.join(cells)} |"


def errors_of(records: Sequence[Record], folder: Path) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Errors, the same with every line half a step back, sigmas without their floor, and true shifts; each (R, .)."""
    frames = {key: load_dive(*key, folder).T_world_submap for key in {(r["floor"], r["seed"]) for r in records}}
    rows = [_errors(r, frames[r["floor"], r["seed"]]) for r in records]
    as_is, moved, shift = (np.array(column) for column in zip(*rows, strict=True))
    sigmas = np.array([[r[f"sigma_{name}"] for name in ("x", "y", "yaw")] for r in records])
    bare = np.sqrt(np.maximum(sigmas**2 - _FLOOR**2, 0.0)) / CONFIG.registration.sigma_factor
    return as_is, moved, bare, shift


def _errors(record: Record, frames: FloatArray) -> tuple[list[float], list[float], list[float]]:
    x, y, yaw = planar_parameters(invert(frames[record["target"]]) @ frames[record["source"]])
    error = [record["error_x"], record["error_y"], record["error_yaw"]]
    found = planar_pose(x + error[0], y + error[1], yaw + error[2])
    back = planar_pose(-HALF_STEP, 0.0, 0.0)
    a, b, c = planar_parameters(back @ found @ invert(back))
    return error, [a - x, b - y, float(wrap_angle(c - yaw))], [x, y]


def lines(records: Sequence[Record], folder: Path) -> Iterable[str]:
    """NEES under one assumption after the other."""
    as_is, moved, bare, shift = errors_of(records, folder)
    lever = MISALIGNMENT * np.abs(np.column_stack([shift[:, 1], shift[:, 0], np.zeros(len(shift))]))
    factor, wide = CONFIG.registration.sigma_factor, np.array([0.1, 0.1, 0.005])
    cases = {
        "as it is": (as_is, np.hypot(factor * bare, _FLOOR)),
        "lines at the middle of their pings": (moved, np.hypot(factor * bare, _FLOOR)),
        "and misalignment times the distance of the anchors": (moved, np.hypot(np.hypot(factor * bare, _FLOOR), lever)),
        "and sigma_factor 2.5, min_sigma_yaw 0.005": (moved, np.hypot(np.hypot(2.5 * bare, wide), lever)),
        "or sigma_factor 3, min_sigma_yaw 0.005": (moved, np.hypot(np.hypot(3 * bare, wide), lever)),
    }
    low, high = chi2.ppf([0.025, 0.975], 3 * len(records)) / (3 * len(records))
    yield f"{len(records)} accepted and right; NEES / 3 within {low:.2f} to {high:.2f} wanted.\n"
    yield "| | NEES / 3 | z rms x | y | yaw | median error [m] | [deg] |\n|---|---|---|---|---|---|---|"
    for name, (error, sigma) in cases.items():
        z = error / sigma
        away = np.median(np.hypot(error[:, 0], error[:, 1])), np.degrees(np.median(np.abs(error[:, 2])))
        cells = [np.mean(z**2), *np.sqrt(np.mean(z**2, axis=0)), *away]
        yield f"| {name} | {' | '.join(f'{cell:.2f}' for cell in cells)} |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE / "out")
    arguments = parser.parse_args()
    folder = arguments.out / "dives"
    for name, seeds in (("Tuning", TUNING_SEEDS), ("Reporting", REPORTING_SEEDS)):
        files = [f for s in seeds for f in (arguments.out / "pairs").glob(f"chain-reconstructed-known-*-{s}.json")]
        records = [record for file in sorted(files) for record in json.loads(file.read_text())]
        accepted = [r for r in records if r.get("accepted") and is_right(r)]
        print(f"{name} seeds: ", end="")
        print(*lines(accepted, folder), "", sep="\n", flush=True)
    print("| floor | seed | x [m] | y [m] | yaw [deg] |\n|---|---|---|---|---|")
    for floor in (*INFORMATIVE, "falls"):
        print(shifts(floor, REPORTING_SEEDS[0], folder), flush=True)


if __name__ == "__main__":
    main()
