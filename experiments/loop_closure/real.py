"""A recorded dive in which no place is seen twice: whatever is accepted is false."""

import argparse
from collections import Counter
from itertools import combinations

import numpy as np
from dives import data_folder
from pairs import SIGMA_SHIFT, SIGMA_YAW
from rows import Place, chain

import sssslam
from frontend.bottom import find_bottom
from frontend.frames import planar_parameters, planar_pose
from frontend.pairs import predicted_transform
from frontend.priors import Prior
from frontend.reconstruction import calibrate
from frontend.submaps import Submap
from frontend.windows import sliding_windows
from sssslam.config import Config, load_config, resolve
from sssslam.dead_reckoning import dead_reckon
from sssslam.stages import reconstruct_windows
from sssslam.watch import Watch

LENGTHS = (8.0, 15.0)  # of windows [m]: the default of 45 m leaves one of a dive of 56 m


def submaps_of(length: float) -> list[Submap]:
    """Submaps of the dive over the wreck Scotsman, in windows of a length [m]."""
    recording = sssslam.read(data_folder() / "recordings" / "scotsman-iver2.xtf")
    config: Config = resolve(load_config(settings=[f"windows.length={length}"]), recording)
    recording, _ = dead_reckon(recording, config.dead_reckoning)
    windows = sliding_windows(recording.trajectory_dr, float(recording.slant_range_max.max()), config.windows)
    bottom = find_bottom(recording, config.bottom)
    radiometry = calibrate(recording, windows, bottom, config.radiometry, config.reconstruction.joint)
    return reconstruct_windows(recording, windows, (bottom, radiometry), config, Watch())


def compare(submaps: list[Submap], heading: str) -> str:
    """A line of the table: all pairs that share no ping, each pulled together by its prior, none of them true."""
    places = [Place(submap) for submap in submaps]
    apart = [(a, b) for a, b in combinations(range(len(submaps)), 2) if submaps[a].end_ping <= submaps[b].first_ping]
    rng, reasons = np.random.default_rng(0), Counter[str]()
    for target, source in apart:
        yaw = planar_parameters(predicted_transform(submaps[target], submaps[source]))[2]
        covariance = np.diag([1e-4, 1e-4, SIGMA_YAW[heading] ** 2, SIGMA_SHIFT**2, SIGMA_SHIFT**2, 1.0])
        prior = Prior(planar_pose(*rng.normal(0.0, SIGMA_SHIFT, 2), yaw), covariance)
        reasons[str(chain(places[target], places[source], prior).numbers["reason"])] += 1
    accepted = reasons.pop("", 0)
    why = "; ".join(f"{n} {reason}" for reason, n in reasons.most_common())
    return f"| {heading} | {len(submaps)} | {len(apart)} | {accepted} | {why} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lengths", nargs="+", type=float, default=LENGTHS)
    arguments = parser.parse_args()
    print("| windows [m] | heading | submaps | pairs | accepted, all false | rejected |\n|---|---|---|---|---|---|")
    for length in arguments.lengths:
        submaps = submaps_of(length)
        for heading in SIGMA_YAW:
            print(f"| {length:g} {compare(submaps, heading)}", flush=True)


if __name__ == "__main__":
    main()
