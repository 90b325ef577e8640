"""Time of each stage a ping: the first run, which compiles what is not cached, and the median of later runs."""

import argparse
import os
import platform
import statistics
import subprocess
import tempfile
import time

import numba

import sssslam
from sssslam.simulation import load_scene, simulate
from sssslam.watch import Watch


def times(recording: sssslam.Recording) -> dict[str, float]:
    """Seconds of each stage of one run."""
    watch = Watch()
    result = sssslam.slam(recording, watch=watch)
    with tempfile.TemporaryDirectory() as folder, watch.stage("products"):
        result.write(folder)
    return dict(watch.seconds)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="demo")
    parser.add_argument("--pings", type=int, default=1500, help="first pings of the scene")
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    start = time.perf_counter()
    recording = simulate(load_scene(arguments.scene))
    simulated = 1e3 * (time.perf_counter() - start) / recording.n_pings
    part = recording[: arguments.pings]
    first, *later = [times(part) for _ in range(arguments.repeats + 1)]
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
    machine = f"{platform.machine()}, {numba.config.NUMBA_NUM_THREADS} threads, Python {platform.python_version()}"
    print(f"scene {arguments.scene}, {part.n_pings} pings of 2 x {part.n_samples} samples")
    print(f"commit {commit.stdout.strip()}, {machine}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores\n")
    print("| stage | first run [ms a ping] | median later [ms a ping] | spread [ms a ping] |\n|---|---|---|---|")
    print(f"| simulation, compilation included | | {simulated:.2f} | |")
    for stage, seconds in first.items():
        rest = [1e3 * run[stage] / part.n_pings for run in later]
        spread = f"{min(rest):.2f} to {max(rest):.2f}"
        print(f"| {stage} | {1e3 * seconds / part.n_pings:.2f} | {statistics.median(rest):.2f} | {spread} |")
    totals = [1e3 * sum(run.values()) / part.n_pings for run in later]
    spread = f"{min(totals):.2f} to {max(totals):.2f}"
    print(f"| all | {1e3 * sum(first.values()) / part.n_pings:.2f} | {statistics.median(totals):.2f} | {spread} |")


if __name__ == "__main__":
    main()
