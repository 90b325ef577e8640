"""Which loop closures are true."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from frontend.arrays import BoolArray, FloatArray
from frontend.frames import invert, level, planar_parameters, wrap_angle
from frontend.loop_closures import LoopClosure
from frontend.trajectory import Trajectory
from sssslam.evaluation.association import interpolate, is_covered
from sssslam.evaluation.metric import Metric, root_mean_square

MAX_SHIFT = 3.0  # m
MAX_TURN = np.deg2rad(5.0)


@dataclass(frozen=True)
class JudgedClosures:
    """What the reference says of every candidate.

    Parameters
    ----------
    shift_error : ndarray, shape (C,)
        Horizontal distance of the measured from the true position of the source [m]; NaN where either is unknown.
    turn_error : ndarray, shape (C,)
        The same of the yaw, signed [rad].
    z_score : ndarray, shape (C,)
        Root mean square of the errors of x, y and yaw over their sigmas; NaN where unknown.
    is_covered : ndarray of bool, shape (C,)
        Whether the reference knows both anchors.
    is_accepted : ndarray of bool, shape (C,)
        Whether the run accepted the candidate.
    """

    shift_error: FloatArray
    turn_error: FloatArray
    z_score: FloatArray
    is_covered: BoolArray
    is_accepted: BoolArray

    @property
    def is_right(self) -> BoolArray:
        """Shape (C,): measured within 3 m and 5 degrees of the truth."""
        return np.asarray((self.shift_error <= MAX_SHIFT) & (np.abs(self.turn_error) <= MAX_TURN))


def judge_loop_closures(
    loop_closures: Sequence[LoopClosure], anchor_time: Mapping[int, float], trajectory_ref: Trajectory
) -> JudgedClosures:
    """Compare every candidate with the reference poses of its two anchors.

    Parameters
    ----------
    loop_closures : sequence of LoopClosure
        C candidates, accepted or not.
    anchor_time : mapping of int to float
        Times of the submaps' anchors [s], on the reference's clock.
    trajectory_ref : Trajectory
        The reference.

    Returns
    -------
    judged : JudgedClosures
        Errors of the measured transforms between level frames.
    """
    times = np.array([[anchor_time[c.target], anchor_time[c.source]] for c in loop_closures]).reshape(-1, 2)
    T_ref = level(interpolate(trajectory_ref, times.ravel()).poses).reshape(-1, 2, 4, 4)
    covered = np.logical_and(*is_covered(trajectory_ref, times.ravel()).reshape(-1, 2).T)
    between = invert(T_ref[:, 0]) @ T_ref[:, 1]
    errors = np.array([_error(c, T) for c, T in zip(loop_closures, between, strict=True)]).reshape(-1, 3)
    errors[~covered] = np.nan
    sigmas = np.array([c.sigmas[[3, 4, 2]] for c in loop_closures]).reshape(-1, 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        z_score = np.sqrt(np.mean((errors / sigmas) ** 2, axis=1))
    accepted = np.array([c.accepted for c in loop_closures], dtype=np.bool_)
    return JudgedClosures(np.hypot(errors[:, 0], errors[:, 1]), errors[:, 2], z_score, covered, accepted)


def _error(closure: LoopClosure, T_target_source_ref: FloatArray) -> tuple[float, float, float]:
    """Errors of x and y in the target's frame and of yaw."""
    x, y, yaw = planar_parameters(closure.T_target_source)
    x_ref, y_ref, yaw_ref = planar_parameters(T_target_source_ref)
    return x - x_ref, y - y_ref, float(wrap_angle(yaw - yaw_ref))


def evaluate_loop_closures(
    loop_closures: Sequence[LoopClosure], anchor_time: Mapping[int, float], trajectory_ref: Trajectory
) -> list[Metric]:
    """Count the true, the false and the missed loop closures, and measure how exact the true ones are.

    Parameters
    ----------
    loop_closures : sequence of LoopClosure
        Candidates, accepted or not.
    anchor_time : mapping of int to float
        Times of the submaps' anchors [s], on the reference's clock.
    trajectory_ref : Trajectory
        The reference.

    Returns
    -------
    metrics : list of Metric
        Counts, precision, recall and errors; a candidate whose anchors the reference does not cover counts nowhere.
    """
    judged = judge_loop_closures(loop_closures, anchor_time, trajectory_ref)
    right, accepted = judged.is_right, judged.is_accepted & judged.is_covered
    n_true, n_false = (int(np.count_nonzero(accepted & wanted)) for wanted in (right, ~right))
    n_missed = int(np.count_nonzero(right & ~accepted))
    how = f"within 3 m and 5 deg of the reference, {np.count_nonzero(judged.is_covered)} of {right.size} rows judged"
    counts = {"true": n_true, "false": n_false, "missed": n_missed}
    metrics = [Metric(f"closures_{name}", float(n), "loop closures", how) for name, n in counts.items()]
    metrics += [
        Metric("closure_precision", _percent(n_true, n_true + n_false), "%", f"true of accepted, {how}"),
        Metric("closure_recall", _percent(n_true, n_true + n_missed), "%", f"accepted of rightly measured rows, {how}"),
    ]
    return [*metrics, *_exactness(judged, accepted & right)]


def _percent(part: int, whole: int) -> float:
    return 100.0 * part / whole if whole else float("nan")


def _exactness(judged: JudgedClosures, chosen: BoolArray) -> list[Metric]:
    how = f"root mean square over {np.count_nonzero(chosen)} true loop closures"
    return [
        Metric("closure_shift_error", root_mean_square(judged.shift_error[chosen]), "m", f"horizontal, {how}"),
        Metric("closure_yaw_error", root_mean_square(judged.turn_error[chosen]), "rad", how),
        Metric(
            "closure_z_score",
            root_mean_square(judged.z_score[chosen]),
            "",
            f"errors of x y yaw over sigma, 1 is right, {how}",
        ),
    ]
