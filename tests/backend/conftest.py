"""Surveys with known truth for the back end: a lawn mower with tie lines, its drift, loop closures true and false."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from backend.arrays import FloatArray, IntArray
from backend.dead_reckoning import DeadReckoning, DeadReckoningConfig
from backend.innovations import Innovations, innovations
from backend.pose_graph import PoseGraph
from backend.poses import RelativePose, invert
from backend.stacks import stacked

CLOSURE_SIGMAS = np.array([0.005, 0.005, 0.015, 0.3, 0.3, 0.15])
DRIFTING = (
    "heading_bias_sd",
    "heading_walk",
    "heading_deviation_sd",
    "velocity_scale_sd",
    "velocity_misalignment_sd",
    "velocity_noise",
)

# between a tactical and a MEMS vehicle; the figures that these tests expect hold for it, whatever the defaults are
MODEL = DeadReckoningConfig(
    heading_walk=1.2e-3, heading_deviation_sd=0.012, velocity_scale_sd=0.006, velocity_misalignment_sd=0.006
)


def make_poses(positions: FloatArray, yaw: FloatArray, tilt: FloatArray | None = None) -> FloatArray:
    """Poses from positions (N, 3), yaw (N,) and, if any, roll and pitch (N, 2)."""
    roll, pitch = np.zeros((2, len(yaw))) if tilt is None else tilt.T
    T = np.tile(np.eye(4), (len(yaw), 1, 1))
    T[:, :3, :3] = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1)).as_matrix()
    T[:, :3, 3] = positions
    return T


def planar(x: float, y: float, yaw: float) -> FloatArray:
    """A level pose."""
    return make_poses(np.array([[x, y, 0.0]]), np.array([yaw]))[0]


def lawn_mower(n_legs: int, leg: float, spacing: float, n_ties: int) -> tuple[FloatArray, FloatArray]:
    """Times and true poses at 1.5 m/s, one ping a second: parallel legs, then tie lines across them."""
    corners = [(side * leg, k * spacing) for k in range(n_legs) for side in ((0, 1) if k % 2 == 0 else (1, 0))]
    for tie in range(n_ties):
        x = leg * (tie + 1) / (n_ties + 1)
        ends = [(x, n_legs * spacing), (x, -spacing)]
        corners += ends if tie % 2 == 0 else ends[::-1]
    points = [np.array(corners[0], dtype=np.float64)]
    for start, end in pairwise(corners):
        n = max(int(np.hypot(end[0] - start[0], end[1] - start[1]) / 1.5), 1)
        points += [np.add(start, np.subtract(end, start) * (k + 1) / n) for k in range(n)]
    xy = np.array(points)
    course = np.unwrap(np.arctan2(*np.gradient(xy, axis=0).T[::-1]))
    return np.arange(len(xy), dtype=np.float64), make_poses(np.pad(xy, ((0, 0), (0, 1)), constant_values=-20.0), course)


def drift(
    time: FloatArray, T_world_body: FloatArray, config: DeadReckoningConfig, rng: np.random.Generator
) -> FloatArray:
    """Integrate measured velocities along measured headings: the errors of the config, and not to first order only."""
    yaw, step = np.arctan2(T_world_body[:, 1, 0], T_world_body[:, 0, 0]), np.diff(T_world_body[:, :2, 3], axis=0)
    dt, n = np.diff(time), len(time)
    bias, scale, turn = rng.normal(size=3) * [
        config.heading_bias_sd,
        config.velocity_scale_sd,
        config.velocity_misalignment_sd,
    ]
    a, b = config.heading_deviation_sd * rng.normal(size=2)
    walk = np.concatenate([[0.0], np.cumsum(config.heading_walk * np.sqrt(dt) * rng.normal(size=n - 1))])
    error = bias + walk + a * np.cos(yaw) + b * np.sin(yaw)
    turned = 0.5 * (error[1:] + error[:-1]) + turn
    noise = config.velocity_noise * np.sqrt(dt)[:, None] * rng.normal(size=(n - 1, 2))
    cos, sin = (1.0 + scale) * np.cos(turned), (1.0 + scale) * np.sin(turned)
    moved = np.stack([cos * step[:, 0] - sin * step[:, 1], sin * step[:, 0] + cos * step[:, 1]], axis=1) + noise
    xy = T_world_body[0, :2, 3] + np.concatenate([np.zeros((1, 2)), np.cumsum(moved, axis=0)])
    z = T_world_body[:, 2, 3] + config.depth_sd * rng.normal(size=n)
    return make_poses(np.column_stack([xy, z]), yaw + error, config.tilt_sd * rng.normal(size=(n, 2)))


@dataclass(frozen=True)
class Survey:
    """A drifted survey: pings, anchors and what joins them."""

    time: FloatArray
    T_world_body: FloatArray
    T_world_body_dr: FloatArray
    anchor_pings: IntArray
    dead_reckoning: DeadReckoning

    @property
    def true_anchors(self) -> FloatArray:
        return self.T_world_body[self.anchor_pings]

    @property
    def dr_anchors(self) -> FloatArray:
        return self.T_world_body_dr[self.anchor_pings]

    def odometry(self) -> list[RelativePose]:
        T, pings, reckoning = self.dr_anchors, self.anchor_pings, self.dead_reckoning
        steps = range(len(pings) - 1)
        covariances = [reckoning.odometry_covariance(pings[k], pings[k + 1]) for k in steps]
        return [RelativePose(k, k + 1, invert(T[k]) @ T[k + 1], covariances[k]) for k in steps]

    def revisits(self, radius: float = 20.0, separation: int = 5) -> list[tuple[int, int]]:
        """Pairs of anchors that truly lie near each other, though not along the track."""
        xy = self.true_anchors[:, :2, 3]
        distance = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
        return [(int(t), int(s)) for t, s in np.argwhere(distance < radius) if s - t >= separation]

    def closure(self, target: int, source: int, rng: np.random.Generator) -> RelativePose:
        """A true closure with errors as its sigmas say, along the target's axes."""
        T, error = invert(self.true_anchors[target]) @ self.true_anchors[source], CLOSURE_SIGMAS * rng.normal(size=6)
        T[:3, :3] = Rotation.from_rotvec(error[:3]).as_matrix() @ T[:3, :3]
        T[:3, 3] += error[3:]
        return RelativePose(target, source, T, np.diag(CLOSURE_SIGMAS**2))

    def true_closures(self, rng: np.random.Generator) -> list[RelativePose]:
        return [self.closure(target, source, rng) for target, source in self.revisits()]

    def false_closure(self, target: int, source: int, offset: FloatArray, rng: np.random.Generator) -> RelativePose:
        """A closure that is wrong by an offset in x, y and yaw along the world's axes."""
        right = self.closure(target, source, rng)
        T, to_target = right.T_target_source.copy(), self.true_anchors[target][:3, :3].T
        T[:3, 3] += to_target @ [offset[0], offset[1], 0.0]
        T[:3, :3] = to_target @ planar(0.0, 0.0, offset[2])[:3, :3] @ to_target.T @ T[:3, :3]
        return RelativePose(target, source, T, right.covariance)

    def independent_false(self, n: int, rng: np.random.Generator) -> list[RelativePose]:
        """Closures between places near each other, each wrong by its own offset."""
        near = self.revisits(60.0)
        offsets = rng.uniform(-1.0, 1.0, (n, 3)) * [20.0, 20.0, 0.15]
        return [self.false_closure(*near[rng.integers(len(near))], offset, rng) for offset in offsets]

    def repeated_false(self, n: int, group: int, rng: np.random.Generator) -> list[RelativePose]:
        """Closures in groups, between the same two stretches, that share one wrong offset."""
        near, false = self.revisits(60.0), []
        while len(false) < n:
            offset, start = rng.uniform(-1.0, 1.0, 3) * [20.0, 20.0, 0.05], rng.integers(len(near))
            offset[:2] += 4.0 * np.sign(offset[:2])
            pairs = [near[(start + k) % len(near)] for k in range(min(group, n - len(false)))]
            false += [self.false_closure(*pair, offset, rng) for pair in pairs]
        return false

    def compared(self, closures: list[RelativePose]) -> Innovations:
        return innovations(self.dr_anchors, stacked(self.odometry()), stacked(closures))

    def graph(
        self,
        closures: list[RelativePose],
        first_pose: tuple[float, ...] = (0.005, 0.005, 0.02, 0.01, 0.01, 0.1),
        **configs: object,
    ) -> PoseGraph:
        graph = PoseGraph(self.dr_anchors, **configs)
        graph.add_first_pose(first_pose)
        for relative in self.odometry():
            graph.add_odometry(relative.target, relative.source, relative.T_target_source, relative.covariance)
        for anchor in range(len(self.anchor_pings)):
            graph.add_depth_and_tilt(anchor, 0.1, 0.005)
        for relative in closures:
            sigmas = np.sqrt(np.diag(relative.covariance))
            graph.add_closure(relative.target, relative.source, relative.T_target_source, sigmas)
        return graph

    def error(self, T_world_anchor: FloatArray) -> float:
        """Root-mean-square horizontal error of the anchors [m] after the best planar rigid alignment."""
        a, b = T_world_anchor[:, :2, 3], self.true_anchors[:, :2, 3]
        a, b = a - a.mean(axis=0), b - b.mean(axis=0)
        angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
        turned = a @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return float(np.sqrt(((turned - b) ** 2).sum(axis=1).mean()))


@pytest.fixture(scope="session")
def make_survey() -> Callable[..., Survey]:
    """Surveys by seed; the drift may be a factor worse than its model, and the pings between anchors differ."""

    def make(seed: int, drift_factor: float = 1.0, every: int = 20, n_legs: int = 6, n_ties: int = 2) -> Survey:
        time, T = lawn_mower(n_legs, 200.0, 30.0, n_ties)
        config = MODEL
        worse = config.model_copy(update={name: getattr(config, name) * drift_factor for name in DRIFTING})
        T_dr = drift(time, T, worse, np.random.default_rng(seed))
        return Survey(time, T, T_dr, np.arange(every // 2, len(time), every), DeadReckoning(time, T_dr, config))

    return make


@pytest.fixture(scope="session")
def poses() -> Callable[..., FloatArray]:
    """Poses from positions (N, 3), yaw (N,) and, if any, roll and pitch (N, 2)."""
    return make_poses
