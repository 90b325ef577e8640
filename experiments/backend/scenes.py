"""Surveys for the back end alone: a lawn mower with tie lines, its drift, loop closures true and false."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from backend.arrays import FloatArray
from backend.dead_reckoning import DeadReckoning, DeadReckoningConfig
from backend.poses import RelativePose, invert

SPEED = 1.5  # [m/s]
SIGMAS = np.array([0.005, 0.005, 0.015, 0.3, 0.3, 0.15])  # of a closure: rotation [rad], then translation [m]
MODEL = DeadReckoningConfig(
    heading_walk=1.2e-3, heading_deviation_sd=0.012, velocity_scale_sd=0.006, velocity_misalignment_sd=0.006
)  # between a tactical and a MEMS vehicle
WORST_OFFSET = np.array([20.0, 20.0, 0.15])  # of an independent false closure: x, y [m] and yaw [rad]
REPEATED_OFFSET = np.array([20.0, 20.0, 0.05])  # of a group of them, and 4 m more along x and y


@dataclass(frozen=True)
class Survey:
    """A drifted survey: true and dead-reckoned anchors, odometry and the covariance it claims, and when."""

    T_true: FloatArray
    T_dr: FloatArray
    odometry: list[RelativePose]
    time: FloatArray

    def revisits(self, radius: float, separation: int) -> list[tuple[int, int]]:
        """Pairs of anchors that truly lie near each other, though not along the track."""
        near = cKDTree(self.T_true[:, :2, 3]).query_pairs(radius, output_type="ndarray")
        near = np.sort(near, axis=1)
        near = near[near[:, 1] - near[:, 0] >= separation]
        return [(int(t), int(s)) for t, s in near[np.lexsort(near.T[::-1])]]

    def closure(self, pair: tuple[int, int], offset: FloatArray, rng: np.random.Generator) -> RelativePose:
        """A closure with errors as its sigmas say, and wrong by an offset (x, y, yaw) along the world's axes."""
        target, source = pair
        wrong = planar(*offset)
        wrong[:3, 3] += self.T_true[source][:3, 3] - wrong[:3, :3] @ self.T_true[source][:3, 3]  # about the source
        T, error = invert(self.T_true[target]) @ wrong @ self.T_true[source], SIGMAS * rng.normal(size=6)
        T[:3, :3] = Rotation.from_rotvec(error[:3]).as_matrix() @ T[:3, :3]
        T[:3, 3] += error[3:]
        return RelativePose(target, source, T, np.diag(SIGMAS**2))

    def ate(self, T: FloatArray) -> float:
        """Root-mean-square horizontal error [m] of the anchors after the best planar rigid alignment."""
        a, b = (poses[:, :2, 3] - poses[:, :2, 3].mean(axis=0) for poses in (T, self.T_true))
        angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
        turned = a @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return float(np.sqrt(((turned - b) ** 2).sum(axis=1).mean()))


def planar(x: float, y: float, yaw: float) -> FloatArray:
    """A level pose."""
    T = np.eye(4)
    T[:3, :3], T[:2, 3] = Rotation.from_euler("z", yaw).as_matrix(), [x, y]
    return T


def make_survey(
    seed: int, drift_factor: float, shape: tuple[int, float, float, int] = (6, 200.0, 30.0, 2), step: float = 30.0
) -> Survey:
    """A survey of (legs, leg length, spacing, ties); its drift is a factor worse than its model."""
    return drifted_survey(*lawn_mower(*shape, step), drift_factor, np.random.default_rng(seed))


def drifted_survey(time: FloatArray, T_true: FloatArray, drift_factor: float, rng: np.random.Generator) -> Survey:
    """A survey along true poses; its drift is a factor worse than its model."""
    names = ("heading_walk", "heading_deviation_sd", "velocity_scale_sd", "velocity_misalignment_sd", "velocity_noise")
    worse = MODEL.model_copy(update={name: drift_factor * getattr(MODEL, name) for name in names})
    T_dr = drifted(time, T_true, worse, rng)
    reckoning = DeadReckoning(time, T_dr, MODEL)
    steps = range(len(time) - 1)
    odometry = [
        RelativePose(k, k + 1, invert(T_dr[k]) @ T_dr[k + 1], reckoning.odometry_covariance(k, k + 1)) for k in steps
    ]
    return Survey(T_true, T_dr, odometry, time)


def lawn_mower(n_legs: int, leg: float, spacing: float, n_ties: int, step: float) -> tuple[FloatArray, FloatArray]:
    """Times and true poses of anchors every so many metres: parallel legs, then tie lines across them."""
    corners = [(side * leg, k * spacing) for k in range(n_legs) for side in ((0, 1) if k % 2 == 0 else (1, 0))]
    for tie in range(n_ties):
        x = leg * (tie + 1) / (n_ties + 1)
        ends = [(x, n_legs * spacing), (x, -spacing)]
        corners += ends if tie % 2 == 0 else ends[::-1]
    points = [np.array(corners[0])]
    for start, end in pairwise(corners):
        n = max(round(float(np.hypot(end[0] - start[0], end[1] - start[1])) / step), 1)
        points += [np.add(start, np.subtract(end, start) * (k + 1) / n) for k in range(n)]
    return along(np.array(points, dtype=np.float64))


def repeated_line(n_passes: int, leg: float, step: float) -> tuple[FloatArray, FloatArray]:
    """One line flown in the same direction again and again, the way back 60 m beside it."""
    n, back, points = round(leg / step), 60.0, list[FloatArray]()
    x, turn = np.linspace(0.0, leg, n + 1), np.pi * np.arange(1, 4) / 4.0
    for _ in range(n_passes):
        points += [np.stack([x, np.zeros(n + 1)], axis=1)]
        points += [np.stack([leg + 0.5 * back * np.sin(turn), 0.5 * back * (1.0 - np.cos(turn))], axis=1)]
        points += [np.stack([x[::-1], np.full(n + 1, back)], axis=1)]
        points += [np.stack([-0.5 * back * np.sin(turn), 0.5 * back * (1.0 + np.cos(turn))], axis=1)]
    return along(np.concatenate(points))


def figure_of_eight(n_rounds: int, radius: float, step: float) -> tuple[FloatArray, FloatArray]:
    """Two circles that touch, flown in turns."""
    n = round(2.0 * np.pi * radius / step)
    turn = 2.0 * np.pi * np.arange(n) / n
    left = radius * np.stack([np.sin(turn), 1.0 - np.cos(turn)], axis=1)
    return along(np.tile(np.concatenate([left, left * [1.0, -1.0]]), (n_rounds, 1)))


def along(xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times and poses of a vehicle that goes through points, heading where it goes."""
    distance = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    course = np.unwrap(np.arctan2(*np.gradient(xy, axis=0).T[::-1]))
    return distance / SPEED, _poses(np.pad(xy, ((0, 0), (0, 1)), constant_values=-20.0), course, np.zeros((len(xy), 2)))


def drifted(time: FloatArray, T_true: FloatArray, errors: DeadReckoningConfig, rng: np.random.Generator) -> FloatArray:
    """Integrate wrong velocities along wrong headings."""
    yaw, step = np.arctan2(T_true[:, 1, 0], T_true[:, 0, 0]), np.diff(T_true[:, :2, 3], axis=0)
    n, dt = len(time), np.diff(time)
    scale, turn = rng.normal(size=2) * [errors.velocity_scale_sd, errors.velocity_misalignment_sd]
    a, b = errors.heading_deviation_sd * rng.normal(size=2)
    walk = np.concatenate([[0.0], np.cumsum(errors.heading_walk * np.sqrt(dt) * rng.normal(size=n - 1))])
    error = walk + a * np.cos(yaw) + b * np.sin(yaw)
    turned = 0.5 * (error[1:] + error[:-1]) + turn
    cos, sin = (1.0 + scale) * np.cos(turned), (1.0 + scale) * np.sin(turned)
    moved = np.stack([cos * step[:, 0] - sin * step[:, 1], sin * step[:, 0] + cos * step[:, 1]], axis=1)
    moved += errors.velocity_noise * np.sqrt(dt)[:, None] * rng.normal(size=(n - 1, 2))
    xy = T_true[0, :2, 3] + np.concatenate([np.zeros((1, 2)), np.cumsum(moved, axis=0)])
    z = T_true[:, 2, 3] + errors.depth_sd * rng.normal(size=n)
    return _poses(np.column_stack([xy, z]), yaw + error, errors.tilt_sd * rng.normal(size=(n, 2)))


def independent(survey: Survey, n: int, _: int, rng: np.random.Generator) -> list[RelativePose]:
    """False closures between places near each other, each wrong by its own offset."""
    near = survey.revisits(60.0, 5)
    offsets = rng.uniform(-1.0, 1.0, (n, 3)) * WORST_OFFSET
    return [survey.closure(near[rng.integers(len(near))], offset, rng) for offset in offsets]


def neighbouring(survey: Survey, n: int, group: int, rng: np.random.Generator) -> list[RelativePose]:
    """False closures in groups of neighbouring pairs, as one repeated structure makes them; each with one offset."""
    near, false = survey.revisits(60.0, 5), []
    while len(false) < n:
        offset, start = _repeated_offset(rng), rng.integers(len(near))
        pairs = [near[(start + k) % len(near)] for k in range(min(group, n - len(false)))]
        false += [survey.closure(pair, offset, rng) for pair in pairs]
    return false


def scattered(survey: Survey, n: int, group: int, rng: np.random.Generator) -> list[RelativePose]:
    """False closures in groups from all over the survey, as a regular pattern makes them; a group shares an offset."""
    near, false = survey.revisits(60.0, 5), []
    while len(false) < n:
        offset, size = _repeated_offset(rng), min(group, n - len(false), len(near))
        pairs = [near[k] for k in np.sort(rng.choice(len(near), size, replace=False))]
        false += [survey.closure(pair, offset, rng) for pair in pairs]
    return false


def ahead(survey: Survey, n: int, group: int, rng: np.random.Generator) -> list[RelativePose]:
    """False closures in groups, from all over, wrong by one way ahead, as traces of the sonar itself make them.

    Such traces lie at the same place of the sonar's frame wherever it is, so windows agree best where they do not truly
    lie: each as far ahead or behind where the vehicle passes again.
    """
    near, false = _passed_again(survey), []
    while near and len(false) < n:
        pairs = [near[k] for k in np.sort(rng.choice(len(near), min(group, n - len(false), len(near)), replace=False))]
        way = rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 15.0)
        false += [survey.closure(pair, np.append(way * survey.T_true[pair[0]][:2, 0], 0.0), rng) for pair in pairs]
    return false


def _passed_again(survey: Survey) -> list[tuple[int, int]]:
    """Pairs of anchors near each other that head the same way or back."""
    heading = survey.T_true[:, :2, 0]
    near = survey.revisits(41.0, 5)
    return [(t, s) for t, s in near if abs(heading[t] @ heading[s]) > 0.9]


def _repeated_offset(rng: np.random.Generator) -> FloatArray:
    """What a group is wrong by: at least 4 m, or nothing would be wrong with it."""
    offset = rng.uniform(-1.0, 1.0, 3) * REPEATED_OFFSET
    offset[:2] += 4.0 * np.sign(offset[:2])
    return offset


def _poses(positions: FloatArray, yaw: FloatArray, tilt: FloatArray) -> FloatArray:
    """Poses from positions (N, 3), yaw (N,), roll and pitch (N, 2)."""
    T = np.tile(np.eye(4), (len(yaw), 1, 1))
    T[:, :3, :3] = Rotation.from_euler("ZYX", np.column_stack([yaw, tilt[:, 1], tilt[:, 0]])).as_matrix()
    T[:, :3, 3] = positions
    return T


KINDS = {
    "independent": independent,
    "neighbouring": neighbouring,
    "scattered": scattered,
    "ahead": ahead,
}
