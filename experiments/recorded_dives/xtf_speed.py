"""How fast an XTF file is read: one of half a gigabyte, written first, read on one core."""

import argparse
import os
import resource
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from frontend.georeference import Georeference
from frontend.recording import Recording
from frontend.trajectory import Trajectory
from sssslam.readers.xtf import read_xtf
from sssslam.simulation.xtf_writer import write_xtf


def chunks(n_chunks: int, n: int = 4000, m: int = 2048) -> Iterator[Recording]:
    """A straight dive 8 m above a flat floor, speckled, in pieces of 33 MB."""
    rng, slant_range = np.random.default_rng(0), (np.arange(m) + 0.5) * 0.05
    level = np.where(slant_range < 8, 5.0, 8000 / np.maximum(slant_range, 8.0))
    echoes = [np.rint(rng.gamma(2.0, 0.5, (n, m)) * level).astype(np.float32) for _ in "ps"]
    zero = np.zeros(n)
    wave = 0.01 * np.sin(np.arange(n))
    track = Trajectory(1.7e9 + 0.1 * np.arange(n), 0.2 * np.arange(n), zero, -20 + wave, wave, wave, 0.3 * wave)
    geometry = {"sample_spacing": np.full(n, 0.05), "sound_speed": np.full(n, 1500.0)}
    fields = {"altitude": 8 + zero, "depth": 20 + zero, "speed": 2 + zero, "georeference": Georeference(60.0, 5.0)}
    first = Recording(echoes[0], echoes[1], trajectory_dr=track, **geometry, **fields)
    for k in range(n_chunks):
        later = replace(track, time=track.time + 0.1 * n * k, x=track.x + 0.2 * n * k)
        yield replace(first, trajectory_dr=later)


def main() -> None:
    """Write, read three times, print, remove."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where the file may lie for a minute")
    path = parser.parse_args().folder / "speed.xtf"
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    try:
        write_xtf(chunks(15), path, "<u2")
        size = path.stat().st_size / 1e6
        for _ in range(3):
            wall, cpu = time.perf_counter(), time.process_time()
            recording = read_xtf(path)
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
            print(
                f"{size:.0f} MB, {recording.n_pings} pings of {recording.n_samples} samples a side: {wall:.2f} s wall "
                f"({size / wall:.0f} MB/s), {cpu:.2f} s of processor ({size / cpu:.0f} MB/s), peak {memory:.0f} MB"
            )
    finally:
        path.unlink(missing_ok=True)


if __name__ == "__main__":
    main()
