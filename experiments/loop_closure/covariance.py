"""Whether accepted closures are as exact as they say, and where submaps lie in truth."""

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

from frontend.frames import planar_parameters
from frontend.verification import verify

Record = dict[str, Any]
HERE = Path(__file__).resolve().parent


def shifts(floor: str, seed: int, folder: Path) -> str:
    """A line of the table: how each submap of a dive lies on the true floor."""
    dive = load_dive(floor, seed, folder)
    pairs = [(Place(a).layers, Place(b).layers) for a, b in zip(dive.true_submaps, dive.submaps, strict=True)]
    found = [verify(true, made, np.eye(4), CONFIG.registration).T_target_source for true, made in pairs]
    x, y, yaw = np.array([planar_parameters(T) for T in found]).T
    cells = [f"{a.mean():+.2f} +- {a.std():.2f}" for a in (x, y, np.degrees(yaw))]
    return f"| {floor} | {seed} | {' | '.join(cells)} |"


def lines(records: Sequence[Record]) -> Iterable[str]:
    """NEES of x, y and yaw, floor by floor."""
    yield "| floor | closures | NEES / 3 | bounds | z rms x | y | yaw | median error [m] | [deg] |"
    yield "|---|---|---|---|---|---|---|---|---|"
    groups = {floor: [r for r in records if r["floor"] == floor] for floor in (*INFORMATIVE, "falls")}
    for name, group in {**groups, "all": list(records)}.items():
        if not group:
            continue
        error = np.array([[r[f"error_{n}"] for n in ("x", "y", "yaw")] for r in group]).reshape(-1, 3)
        z = error / np.array([[r[f"sigma_{n}"] for n in ("x", "y", "yaw")] for r in group]).reshape(-1, 3)
        low, high = chi2.ppf([0.025, 0.975], z.size) / z.size
        away = np.median(np.hypot(error[:, 0], error[:, 1])), np.degrees(np.median(np.abs(error[:, 2])))
        cells = [f"{cell:.2f}" for cell in (*np.sqrt(np.mean(z**2, axis=0)), *away)]
        yield f"| {name} | {len(z)} | {np.mean(z**2):.2f} | {low:.2f} to {high:.2f} | {' | '.join(cells)} |"


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
        print(f"{name} seeds:\n")
        print(*lines(accepted), "", sep="\n", flush=True)
    print("| floor | seed | x [m] | y [m] | yaw [deg] |\n|---|---|---|---|---|")
    for floor in (*INFORMATIVE, "falls"):
        print(shifts(floor, REPORTING_SEEDS[0], folder), flush=True)


if __name__ == "__main__":
    main()
