"""Time of each stage a ping: the first run, which compiles what is not cached, and the median of later runs."""

import argparse
import os
import platform
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numba

import sssslam
from sssslam.simulation import load_scene, simulate
from sssslam.watch import Watch


class ProcessorWatch(Watch):
    """Keeps processor time of all threads beside the time of the clock: on a busy machine only that compares."""

    def __init__(self) -> None:
        super().__init__()
        self.processor: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a stage."""
        start = time.process_time()
        with super().stage(name):
            yield
        self.processor[name] = self.processor.get(name, 0.0) + time.process_time() - start


def times(recording: sssslam.Recording) -> tuple[dict[str, float], dict[str, float]]:
    """Seconds of each stage of one run, by the clock and of the processors."""
    watch = ProcessorWatch()
    result = sssslam.slam(recording, watch=watch)
    with tempfile.TemporaryDirectory() as folder, watch.stage("products"):
        result.write(folder)
    return dict(watch.seconds), watch.processor


def row(stage: str, first: float, later: list[float], processor: list[float]) -> str:
    """A row of the table, of milliseconds a ping."""
    spread = f"{min(later):.2f} to {max(later):.2f}"
    return f"| {stage} | {first:.2f} | {statistics.median(later):.2f} | {spread} | {statistics.median(processor):.2f} |"


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
    print("Milliseconds a ping.\n\n| stage | first run | median later | spread | processor |\n|---|---|---|---|---|")
    print(f"| simulation, compilation included | | {simulated:.2f} | | |")
    scale = 1e3 / part.n_pings
    for stage, seconds in first[0].items():
        later_of_stage = [[scale * kind[stage] for kind in kinds] for kinds in zip(*later, strict=True)]
        print(row(stage, scale * seconds, *later_of_stage))
    totals = [[scale * sum(kind.values()) for kind in kinds] for kinds in zip(*later, strict=True)]
    print(row("all", scale * sum(first[0].values()), *totals))


if __name__ == "__main__":
    main()
