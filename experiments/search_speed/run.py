"""How long does choosing the partners of a submap take as a dive grows, against looking at every pair?"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backend.dead_reckoning import DeadReckoning
from frontend.features import Features, describe_relief
from frontend.frames import planar_pose
from frontend.heightfield import Heightfield
from frontend.matching import mutual_matches
from frontend.pairs import PairConfig, PairFinder
from frontend.relief import Relief
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.graph import prior_covariance

PINGS = 40  # of a submap, 2 m apart
SIZE = 80  # cells of 1 m along each side of a place
NOISE = 3.0  # standard deviation of a descriptor's bins when a place is seen again; they sum to 200


@dataclass(frozen=True)
class Dive:
    """Submaps with features along a track that comes back to each place again and again."""

    submaps: list[Submap]
    features: list[Features]
    places: list[int]
    trajectory_dr: Trajectory


def relief_of_a_place(rng: np.random.Generator) -> Relief:
    """Fractal floor with a power spectrum of k^-4.2 below 12 m, root mean square 0.2 m."""
    k = np.maximum(np.hypot(*np.meshgrid(np.fft.fftfreq(SIZE), np.fft.fftfreq(SIZE))), 1 / 12)
    z = np.fft.ifft2(np.fft.fft2(rng.normal(size=(SIZE, SIZE))) * k**-2.1).real
    z *= 0.2 / z.std()
    ones = np.ones_like(z)
    return Relief(z, ones, 0 * z, z, 0.1 * ones, 1.0, (-SIZE / 2, -SIZE / 2))


def make_dive(n_submaps: int, n_places: int, rng: np.random.Generator) -> Dive:
    """A lawn-mower pattern over all places, flown until there are enough submaps."""
    described = [describe_relief(relief_of_a_place(rng)) for _ in range(n_places)]
    columns = int(np.sqrt(n_places))
    places = [k % n_places for k in range(n_submaps)]
    centres = np.array([divmod(place, columns) for place in places], dtype=np.float64) * SIZE
    ping = np.arange(n_submaps * PINGS)
    x, y = (np.interp(ping, np.arange(n_submaps) * PINGS + PINGS // 2, centres[:, k]) for k in (1, 0))
    zero = np.zeros(len(ping))
    track = Trajectory(ping.astype(np.float64), x, y, zero, zero, zero, zero)
    submaps = [_submap(k, centres[k]) for k in range(n_submaps)]
    return Dive(submaps, [_seen_again(described[place], rng) for place in places], places, track)


def _submap(number: int, centre: np.ndarray) -> Submap:
    """A square of floor of which only the outline counts."""
    z = np.zeros((SIZE // 4, SIZE // 4))
    first = number * PINGS
    T = planar_pose(float(centre[1]), float(centre[0]), 0.0)
    surface = Heightfield(z, 4.0, (-SIZE / 2, -SIZE / 2))
    return Submap(number, first, first + PINGS, first + PINGS // 2, float(first), T, np.eye(4), surface, z, z, z > 0)


def _seen_again(features: Features, rng: np.random.Generator) -> Features:
    """The same keypoints, seven in ten of them, with other errors."""
    kept = rng.random(len(features)) < 0.7
    descriptors = features.descriptors[kept] + rng.normal(0, NOISE, (int(kept.sum()), 33))
    return replace(
        features, keypoints=features.keypoints[kept], descriptors=descriptors, normals=features.normals[kept]
    )


def search(dive: Dive, config: PairConfig) -> tuple[list[float], float, list[int]]:
    """Seconds of CPU a hundred submaps, share of submaps whose place is among their partners, and partners a submap."""
    prior = prior_covariance(dive.submaps, DeadReckoning(dive.trajectory_dr.time, dive.trajectory_dr.poses))
    finder, distance = PairFinder(config), dive.trajectory_dr.distance
    seconds, found, counts = [], [], []
    for first in range(0, len(dive.submaps), 100):
        start = time.process_time()
        for k in range(first, min(first + 100, len(dive.submaps))):
            partners = finder.add(dive.submaps[k], dive.features[k], distance, prior)
            chosen = [dive.places[t] for t in (*partners.in_gate, *partners.anywhere)]
            counts.append(len(chosen))
            if dive.places[k] in dive.places[: max(k - 5, 0)]:
                found.append(dive.places[k] in chosen)
        seconds.append(time.process_time() - start)
    return seconds, float(np.mean(found)) if found else float("nan"), counts


def every_pair(features: Sequence[Features], n: int) -> float:
    """Seconds of CPU in which one submap's features are matched with those of each of ``n`` others."""
    start = time.process_time()
    for other in features[:n]:
        mutual_matches(features[-1], other)
    return time.process_time() - start


def main() -> None:
    """Print the table as JSON lines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--submaps", type=int, default=2000)
    parser.add_argument("--places", type=int, default=250)
    parser.add_argument("--baseline", type=int, default=200, help="submaps that the baseline matches one with")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    dive = make_dive(arguments.submaps, arguments.places, np.random.default_rng(arguments.seed))
    every_pair(dive.features, 2)  # compiles
    one = every_pair(dive.features, arguments.baseline) / arguments.baseline
    for name, config in (("gate", PairConfig()), ("gate and anywhere", PairConfig(n_anywhere=10))):
        search(replace(dive, submaps=dive.submaps[:20]), config)  # compiles
        seconds, recall, counts = search(dive, config)
        row = {
            "search": name,
            "first hundred [s]": round(seconds[0], 2),
            "second hundred [s]": round(seconds[min(1, len(seconds) - 1)], 2),
            "middle hundred [s]": round(seconds[len(seconds) // 2], 2),
            "last hundred [s]": round(seconds[-1], 2),
            "every pair, last hundred [s]": round(100 * one * len(dive.submaps), 1),
            "partners, median": float(np.median(counts)),
            "place among the partners": round(recall, 3),
        }
        print(json.dumps(row))


if __name__ == "__main__":
    main()
