"""How much faster than real time the 400 kHz preset is simulated. Usage: speed.py."""

import os
import time

import numpy as np

from sssslam.simulation import Scene
from sssslam.simulation.simulator import CHUNK, _sound, prepare

SCENE = {
    "terrain": {
        "size": (420.0, 300.0),
        "layers": [{"kind": "fractal", "longest": 120.0}, {"kind": "sediment"}, {"kind": "objects", "count": 400}],
    },
    "survey": {"pattern": "legs", "legs": [(-120.0, 0.0, 120.0, 0.0)]},
}


def main() -> None:
    """Print wall and processor time of the echoes, compilation and terrain apart."""
    started = time.perf_counter()
    dive = prepare(Scene.model_validate(SCENE))
    print(f"terrain, motion, sensors: {time.perf_counter() - started:.1f} s")
    _sound(dive, slice(0, 2))
    wall, cpu = time.perf_counter(), time.process_time()
    for start in range(0, dive.time.size, CHUNK):
        _sound(dive, slice(start, start + CHUNK))
    wall, cpu, dive_time = time.perf_counter() - wall, time.process_time() - cpu, float(np.ptp(dive.time))
    sonar, n_pings = dive.scene.sonar, dive.time.size
    print(f"{n_pings} pings, 2 x {sonar.n_samples} samples, {sonar.n_sub_beams} rays a side, {dive_time:.0f} s of dive")
    print(f"echoes: {wall:.2f} s wall, {dive_time / wall:.0f} x real time; {cpu:.2f} s of processor")
    print(f"other work on the machine: load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    print(f"{1e3 * cpu / n_pings:.2f} ms of processor a ping: {2 * dive_time / cpu:.0f} x on two idle cores")


if __name__ == "__main__":
    main()
