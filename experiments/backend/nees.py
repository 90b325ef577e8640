"""Are the track's own sigmas right? Many drifts of each grade, true closures, no echoes: errors over sigmas."""

import argparse
import itertools
import os
import sys
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[1] / "navigation"))
from scenes import GRADES, PATTERNS, data_sheet, make_scene  # the surveys of the navigation experiment

from backend.consistency import suit_overlap
from backend.correction import spread_correction, spread_sigmas
from backend.dead_reckoning import DeadReckoning
from backend.drift_model import DeadReckoningConfig
from backend.pose_graph import PoseGraph, PoseGraphSolution
from frontend.arrays import FloatArray, IntArray
from frontend.frames import invert, wrap_angle
from frontend.trajectory import Trajectory
from frontend.window_defaults import suit_track
from frontend.windows import WindowConfig, resolve_windows, sliding_windows
from sssslam.config import Config
from sssslam.dead_reckoning import first_pose_sigmas
from sssslam.evaluation.trajectory import ate
from sssslam.simulation.simulator import prepare

NEAR, FAR = 75.0, 150.0  # m between anchors whose swaths overlap; m along the track that are two windows
TILT_SD, YAW_SD = 0.005, 0.003  # rad, of a closure
N_RESAMPLED = 2000


@dataclass(frozen=True)
class Draw:
    """One dive without echoes: its dead-reckoned and its true track, one pose a ping."""

    trajectory_dr: Trajectory
    truth: Trajectory
    errors: DeadReckoningConfig
    slant_range: float

    @cached_property
    def dead_reckoning(self) -> DeadReckoning:
        """The track's uncertainty."""
        return DeadReckoning(self.trajectory_dr.time, self.trajectory_dr.poses, self.errors)

    @cached_property
    def windows(self) -> WindowConfig:
        """How the dive is cut, as `sssslam.config.resolve` has it."""
        suited = suit_track(WindowConfig(), self.slant_range, self.trajectory_dr)
        return resolve_windows(suited, self.slant_range, self.trajectory_dr.ping_spacing)

    @cached_property
    def anchors(self) -> IntArray:
        """Pings of the anchors."""
        windows = sliding_windows(self.trajectory_dr, self.slant_range, self.windows)
        return np.array([window.anchor_ping for window in windows])


def draw_dive(pattern: str, grade: str, seed: int, factor: float, bias: float) -> Draw:
    """Draw the errors of a dive's equipment, and dead-reckon with them; the data sheet is off by a factor."""
    scene = make_scene("mud", pattern, grade, seed)
    drift = scene.drift.model_copy(update={"heading_bias_deg": bias * scene.drift.heading_bias_deg})
    scene = scene.model_copy(update={"drift": drift})
    sheet = data_sheet(scene.drift, "recorded")
    dive = prepare(scene)
    names = [name for name in DeadReckoningConfig.model_fields if name.startswith(("heading", "velocity"))]
    wrong = sheet.model_copy(update={name: factor * getattr(sheet, name) for name in names})
    return Draw(dive.trajectory_dr, dive.motion.trajectory(dive.time), wrong, scene.sonar.range_max)


def solve(draw: Draw, closure_sd: float, rng: np.random.Generator) -> PoseGraphSolution:
    """The default back end with every true closure between overlapping submaps that are not neighbours."""
    T_dr, T, anchors = draw.trajectory_dr.poses[draw.anchors], draw.truth.poses[draw.anchors], draw.anchors
    config, reckoning = Config(), draw.dead_reckoning
    assert draw.windows.overlap is not None
    consistency = suit_overlap(config.consistency, draw.windows.overlap)
    graph = PoseGraph(T_dr, config.pose_graph, consistency, config.do_no_harm)
    graph.add_first_pose(first_pose_sigmas(reckoning, int(anchors[0])))
    for k in range(len(anchors)):
        graph.add_depth_and_tilt(k, draw.errors.depth_sd, draw.errors.tilt_sd)
    for k in range(len(anchors) - 1):
        covariance = reckoning.odometry_covariance(anchors[k], anchors[k + 1])
        graph.add_odometry(k, k + 1, invert(T_dr[k]) @ T_dr[k + 1], covariance)
    constants = reckoning.constant_errors(anchors)
    if constants is not None:
        graph.add_constant_errors(constants)
    sigmas = np.array([TILT_SD, TILT_SD, YAW_SD, closure_sd, closure_sd, closure_sd])
    for target, source in overlapping(T, draw.truth.distance[anchors]):
        error, measured = sigmas * rng.standard_normal(6), invert(T[target]) @ T[source]
        measured[:3, :3] = Rotation.from_rotvec(error[:3]).as_matrix() @ measured[:3, :3]
        measured[:3, 3] += error[3:]
        graph.add_closure(int(target), int(source), measured, sigmas)
    return graph.solve()


def overlapping(T: FloatArray, along: FloatArray) -> IntArray:
    """Pairs of anchors whose swaths overlap although they are not neighbours along the track."""
    apart = np.linalg.norm(T[:, None, :2, 3] - T[None, :, :2, 3], axis=-1)
    is_far = np.abs(along[:, None] - along[None]) > FAR
    return np.argwhere(np.triu((apart < NEAR) & is_far, 1))


def squares(track: Trajectory, sigmas: FloatArray, truth: Trajectory) -> FloatArray:
    """Mean squared error of x, y and yaw over their variances, shape (3,)."""
    error = np.column_stack([track.positions[:, :2] - truth.positions[:, :2], wrap_angle(track.yaw - truth.yaw)])
    sigma = sigmas[:, [0, 1, 3]]
    known = np.all(sigma > 0, axis=1)
    return np.asarray(((error[known] / sigma[known]) ** 2).mean(axis=0))


def figures(draw: Draw, closure_sd: float, rng: np.random.Generator) -> FloatArray:
    """One row of a dive: squares of both tracks (3 and 3), ATE of both, and the scale of the odometry."""
    solution = solve(draw, closure_sd, rng)
    track, still, truth = draw.trajectory_dr, draw.dead_reckoning.sigmas, draw.truth
    T = spread_correction(track.time, track.poses, draw.anchors, solution.T_world_anchor)
    corrected = Trajectory.from_poses(track.time, T)
    sigmas = spread_sigmas(draw.dead_reckoning, draw.anchors, solution.sigmas)
    errors = [ate(each, truth).value for each in (track, corrected)]
    scale = solution.odometry_scale
    return np.concatenate([squares(track, still, truth), squares(corrected, sigmas, truth), errors, [scale]])


def bounds(values: FloatArray) -> tuple[float, float]:
    """Between which the mean over endless seeds lies in 95 of 100 cases: bootstrap."""
    rng = np.random.default_rng(0)
    means = rng.choice(values, (N_RESAMPLED, len(values))).mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)


def line(pattern: str, grade: str, rows: FloatArray) -> str:
    """A row of the table."""
    cells = [pattern, grade]
    for first in (0, 3):
        each = rows[:, first : first + 3]
        nees = each.mean(axis=1)
        low, high = bounds(nees)
        cells += [f"{nees.mean():.2f} ({low:.2f} to {high:.2f})", f"{np.median(nees):.2f}"]
        cells += [f"{each[:, :2].mean():.2f}, {each[:, 2].mean():.2f}"]
    ratio = np.median(rows[:, 7] / rows[:, 6])
    cells += [f"{np.median(rows[:, 6]):.2f}", f"{ratio:.2f}", f"{np.median(rows[:, 8]):.2f}"]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--patterns", nargs="+", choices=list(PATTERNS), default=list(PATTERNS))
    parser.add_argument("--grades", nargs="+", choices=GRADES, default=list(GRADES))
    parser.add_argument("--seeds", type=int, default=60)
    parser.add_argument("--closure-sd", type=float, default=0.1, help="error of a closure [m]")
    parser.add_argument(
        "--sheet", type=float, default=1.0, help="sigmas that dead reckoning is told, over the true ones"
    )
    parser.add_argument("--heading-bias", type=float, default=1.0, help="0: the heading at the start is known")
    arguments = parser.parse_args()
    start = time.process_time()
    head = ["survey", "equipment"]
    head += [f"{of}: {what}" for of in ("DR", "corrected") for what in ("NEES (95 %)", "median", "x y, yaw")]
    head += ["ATE DR [m]", "ATE / DR", "scale"]
    print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for pattern, grade in itertools.product(arguments.patterns, arguments.grades):
        # every grade and survey has seeds of its own: one seed draws the same errors for all, but for their size
        first = 10_000 * (1 + 3 * list(PATTERNS).index(pattern) + GRADES.index(grade))
        rows = []
        for seed in range(first, first + arguments.seeds):
            draw = draw_dive(pattern, grade, seed, arguments.sheet, arguments.heading_bias)
            rows.append(figures(draw, arguments.closure_sd, np.random.default_rng(seed)))
        print(line(pattern, grade, np.array(rows)), flush=True)
    print(f"\n{time.process_time() - start:.0f} s of CPU, load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
