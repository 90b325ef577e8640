"""Tests of true, false and missed loop closures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.frames import invert, level, planar_pose
from frontend.loop_closures import LoopClosure
from frontend.trajectory import Trajectory
from sssslam.evaluation.loop_closures import evaluate_loop_closures, judge_loop_closures

ANCHORS = {0: 10.0, 1: 50.0, 2: 90.5}
SIGMAS = np.array([0.1, 0.1, 0.01, 0.5, 0.25, 0.1])


def reference() -> Trajectory:
    """Round a circle of 30 m, rolling and pitching: the level frames must not care."""
    t = np.arange(0.0, 101.0, 0.5)
    angle = t / 20.0
    x, y = 30.0 * np.cos(angle), 30.0 * np.sin(angle)
    return Trajectory(t, x, y, np.zeros(t.size), 0.2 * np.sin(t), 0.1 * np.cos(t), angle + np.pi / 2)


def closure(error: np.ndarray, accepted: bool = True, pair: tuple[int, int] = (0, 2)) -> LoopClosure:
    """The true transform between two anchors, times an error in the source's frame."""
    poses = dict(zip(reference().time, level(reference().poses), strict=True))
    T_true = invert(poses[ANCHORS[pair[0]]]) @ poses[ANCHORS[pair[1]]]
    return LoopClosure(*pair, T_true @ error, SIGMAS, 10, 5, 0.8, 0.5, accepted, "" if accepted else "no")


def values(*closures: LoopClosure) -> dict[str, float]:
    return {m.name: m.value for m in evaluate_loop_closures(closures, ANCHORS, reference())}


@given(st.floats(-4, 4), st.floats(-4, 4), st.floats(-0.12, 0.12))
def test_a_closure_is_true_within_three_metres_and_five_degrees(x: float, y: float, yaw: float) -> None:
    judged = judge_loop_closures([closure(planar_pose(x, y, yaw))], ANCHORS, reference())
    assert judged.shift_error[0] == pytest.approx(np.hypot(x, y), abs=1e-9)
    assert judged.turn_error[0] == pytest.approx(yaw, abs=1e-9)
    shift, turn = np.hypot(x, y) - 3.0, abs(yaw) - np.deg2rad(5.0)
    if min(abs(shift), abs(turn)) > 1e-6:
        assert judged.is_right[0] == (shift < 0 and turn < 0)


def test_an_anchor_between_two_reference_poses_is_interpolated() -> None:
    t = reference().time
    halved = reference()[np.flatnonzero((t != 90.5) & (t != 10.0))]
    judged = judge_loop_closures([closure(np.eye(4))], ANCHORS, halved)
    # The chord over 1 s at 1.5 m/s lies (1.5 m)^2 / (8 * 30 m) = 1 cm inside the circle, at either anchor; rolling by
    # 0.2 rad and pitching by 0.1 rad a second, half their product of second order turns the frame by 1e-3 rad, 55 m on.
    # The nearest pose would be 0.75 m away.
    assert judged.shift_error[0] < 0.1


def test_counts_and_shares_of_a_small_table() -> None:
    right, wrong = np.eye(4), planar_pose(5.0, 0.0, 0.0)
    found = values(closure(right), closure(right), closure(wrong), closure(right, False), closure(wrong, False))
    assert (found["closures_true"], found["closures_false"], found["closures_missed"]) == (2, 1, 1)
    assert found["closure_precision"] == pytest.approx(200 / 3)
    assert found["closure_recall"] == pytest.approx(200 / 3)


def test_a_candidate_without_a_transform_is_neither_true_nor_missed() -> None:
    found = values(closure(np.full((4, 4), np.nan), accepted=False))
    assert (found["closures_true"], found["closures_false"], found["closures_missed"]) == (0, 0, 0)
    assert np.isnan(found["closure_precision"])


def test_an_accepted_closure_without_a_transform_is_false() -> None:
    assert values(closure(np.full((4, 4), np.nan)))["closures_false"] == 1


def test_anchors_that_the_reference_does_not_cover_count_nowhere() -> None:
    early = reference()[reference().time < 60.0]
    metrics = evaluate_loop_closures([closure(np.eye(4)), closure(np.eye(4), pair=(0, 1))], ANCHORS, early)
    found = {m.name: m.value for m in metrics}
    assert (found["closures_true"], found["closures_false"]) == (1, 0)
    assert "1 of 2 rows judged" in metrics[0].how


def test_errors_of_one_sigma_have_a_score_of_one() -> None:
    measured = closure(np.eye(4))
    moved = np.array(measured.T_target_source) @ np.eye(4)
    moved[:2, 3] += [0.5, 0.25]
    turned = moved @ planar_pose(0.0, 0.0, 0.01)
    score = judge_loop_closures([LoopClosure(0, 2, turned, SIGMAS, 1, 1, 1, 1, True, "")], ANCHORS, reference()).z_score
    # sigma_x is row 3, sigma_y row 4 and sigma_yaw row 2, in the target's frame
    assert score[0] == pytest.approx(1.0)


def test_no_candidates_give_counts_of_zero() -> None:
    found = values()
    assert found["closures_true"] == found["closures_false"] == found["closures_missed"] == 0
    assert np.isnan(found["closure_shift_error"])


def test_exactness_is_that_of_the_true_ones() -> None:
    found = values(closure(planar_pose(0.6, 0.8, 0.0)), closure(planar_pose(50.0, 0.0, 0.0)))
    assert found["closure_shift_error"] == pytest.approx(1.0)
    assert found["closure_yaw_error"] == pytest.approx(0.0, abs=1e-9)
