"""How much memory a long dive takes on its way into the container. Usage: memory.py [legs ...], fewest first."""

import resource
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from frontend.recording import Recording
from sssslam.readers.netcdf_writing import write_netcdf_chunks
from sssslam.simulation import Scene, simulate_chunks

LEG = 1100.0


def scene(n_legs: int) -> Scene:
    """A lawnmower survey at 2 m/s with the 400 kHz preset, always over the same floor: nine minutes a leg."""
    survey = {"length": LEG, "spacing": 45.0, "n_legs": n_legs, "n_ties": 0}
    terrain = {"size": (LEG + 200.0, 1000.0), "spacing": 1.0, "layers": [{"kind": "fractal"}]}
    return Scene.model_validate({"terrain": terrain, "survey": survey, "drift": {"grade": "mems"}})


def peak() -> float:
    """Most memory this process has held so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def counted(pieces: Iterator[Recording], marks: list[float]) -> Iterator[Recording]:
    """Pass the pieces on; note their end and the memory when the first of them is there."""
    for piece in pieces:
        if not marks:
            marks.append(peak())
        yield piece
        marks[1:] = [float(piece.ping_time[-1]) % 86400.0]


def main(legs: list[int]) -> None:
    """Write a dive of each length and print what each took on top of the ones before."""
    print(f"nothing yet: {peak():.0f} MB")
    for n_legs in legs:
        marks: list[float] = []
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "dive.nc"
            write_netcdf_chunks(counted(simulate_chunks(scene(n_legs)), marks), path)
            size = path.stat().st_size / 1e6
        print(
            f"{marks[1] / 60:.0f} min of dive, {size:.0f} MB of file: {marks[0]:.0f} MB at the first piece, "
            f"{peak():.0f} MB at most"
        )


if __name__ == "__main__":
    main([int(n) for n in sys.argv[1:]] or [3, 18])
