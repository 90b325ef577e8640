"""Pairs of submaps with what is known of them beforehand, and the truth."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import invert, planar_parameters, planar_pose, wrap_angle
from frontend.overlap import Layers, lay_over
from frontend.priors import Prior

HEADING_DIFFERENCES = (0, 30, 90, 150, 180)  # [deg]; others count as random
SIGMA_SHIFT, LARGEST_SHIFT = 40.0 / 3, 40.0  # [m] of the initial guess
SIGMA_YAW = {"known": np.radians(2.0), "unknown": np.pi / np.sqrt(3)}  # [rad]; the second is that of any heading
_N_ELSEWHERE = 40  # pairs of two different floors, a dive
_NEAR = 3.0  # [deg] within which a heading difference is one of the list


@dataclass(frozen=True)
class Pair:
    """Positions of two submaps in a dive; the source may be of another dive, where there is no truth."""

    target: int
    source: int
    elsewhere: bool
    T_target_source: FloatArray
    overlap: float
    turn: str
    shift: tuple[float, float]
    turn_error: dict[str, float]

    def prior(self, heading: str) -> Prior:
        """What dead reckoning says, the heading known or not."""
        x, y, yaw = planar_parameters(self.T_target_source)
        T = planar_pose(x + self.shift[0], y + self.shift[1], yaw + self.turn_error[heading])
        return Prior(T, np.diag([1e-4, 1e-4, SIGMA_YAW[heading] ** 2, SIGMA_SHIFT**2, SIGMA_SHIFT**2, 1.0]))


def pairs_of(layers: list[Layers], T_world_submap: FloatArray, seed: int) -> list[Pair]:
    """All pairs of a dive, then as many of its submaps with those of another floor."""
    rng = np.random.default_rng([seed, 2])
    pairs = []
    for target, source in combinations(range(len(layers)), 2):
        T = invert(T_world_submap[target]) @ T_world_submap[source]
        x, y, yaw = planar_parameters(T)
        overlap = lay_over(layers[target], layers[source], (x, y, yaw)).share
        turn = heading_difference(yaw)
        pairs.append(Pair(target, source, False, planar_pose(x, y, yaw), overlap, turn, *_errors(rng)))
    for _ in range(_N_ELSEWHERE):
        target, source = rng.integers(len(layers), size=2)
        T = planar_pose(*rng.uniform(-30.0, 30.0, 2), rng.uniform(-np.pi, np.pi))
        pairs.append(Pair(int(target), int(source), True, T, 0.0, "none", *_errors(rng)))
    return pairs


def heading_difference(yaw: float) -> str:
    """The class of a turn [rad]."""
    degrees = abs(np.degrees(wrap_angle(yaw)))
    return next((str(h) for h in HEADING_DIFFERENCES if abs(degrees - h) <= _NEAR), "random")


def _errors(rng: np.random.Generator) -> tuple[tuple[float, float], dict[str, float]]:
    """Errors of the initial guess: normal up to the largest in shift and, where it is known, in heading."""
    shift = rng.normal(0.0, SIGMA_SHIFT, 2)
    while np.hypot(*shift) > LARGEST_SHIFT:
        shift = rng.normal(0.0, SIGMA_SHIFT, 2)
    turns = {"known": rng.normal(0.0, SIGMA_YAW["known"]), "unknown": rng.uniform(-np.pi, np.pi)}
    return (float(shift[0]), float(shift[1])), {name: float(turn) for name, turn in turns.items()}
