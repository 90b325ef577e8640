"""Tests of the errors of a track; evo is the judge."""

from dataclasses import replace

import numpy as np
import pytest
from evo.core import metrics
from evo.core.trajectory import Plane, PosePath3D
from hypothesis import given, settings
from hypothesis import strategies as st

from frontend.frames import planar_pose
from frontend.trajectory import Trajectory
from sssslam.evaluation.trajectory import (
    ate,
    ate_se3,
    ate_unaligned,
    end_point_error,
    evaluate_tracks,
    rpe,
    track_coverage,
    track_nees,
)


def evo_path(trajectory: Trajectory, is_planar: bool) -> PosePath3D:
    path = PosePath3D(poses_se3=list(trajectory.poses))
    if is_planar:
        path.project(Plane.XY)
    return path


def evo_ate(trajectory: Trajectory, trajectory_ref: Trajectory, is_planar: bool, is_aligned: bool) -> float:
    ours, ref = (evo_path(t, is_planar) for t in (trajectory, trajectory_ref))
    if is_aligned:
        ours.align(ref)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((ref, ours))
    return float(ape.get_statistic(metrics.StatisticsType.rmse))


def evo_rpe(
    trajectory: Trajectory, trajectory_ref: Trajectory, distance: float, relation: metrics.PoseRelation
) -> float:
    pair = tuple(evo_path(t, True) for t in (trajectory_ref, trajectory))
    tolerance = {"rel_delta_tol": 0.1, "all_pairs": True, "pairs_from_reference": True}
    theirs = metrics.RPE(relation, distance, metrics.Unit.meters, **tolerance)
    theirs.process_data(pair)
    return float(theirs.get_statistic(metrics.StatisticsType.rmse))


def test_evo_finds_the_same_absolute_errors(track: Trajectory, track_ref: Trajectory) -> None:
    assert ate(track, track_ref).value == pytest.approx(evo_ate(track, track_ref, True, True), rel=1e-9)
    assert ate_unaligned(track, track_ref).value == pytest.approx(evo_ate(track, track_ref, True, False), rel=1e-9)
    assert ate_se3(track, track_ref).value == pytest.approx(evo_ate(track, track_ref, False, True), rel=1e-9)


@pytest.mark.parametrize("distance", [50.0, 100.0])
def test_evo_finds_the_same_relative_errors(track: Trajectory, track_ref: Trajectory, distance: float) -> None:
    translation, yaw = rpe(track, track_ref, distance)
    relations = (metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_rad)
    theirs = [evo_rpe(track, track_ref, distance, relation) for relation in relations]
    assert translation.value == pytest.approx(theirs[0], rel=1e-9)
    assert yaw.value == pytest.approx(theirs[1], rel=1e-6)  # the angle of a matrix near one half turn's cosine


@settings(deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_a_rigid_motion_of_the_track_leaves_aligned_and_relative_errors(yaw: float, x: float, y: float) -> None:
    ref = _winding()
    noisy = replace(ref, x=ref.x + np.sin(ref.time), y=ref.y + np.cos(2.0 * ref.time))
    moved = Trajectory.from_poses(noisy.time, planar_pose(x, y, yaw) @ noisy.poses)
    for measure in (ate, ate_se3, lambda a, b: rpe(a, b, 50.0)[0]):
        assert measure(moved, ref).value == pytest.approx(measure(noisy, ref).value, abs=1e-7)


def _winding() -> Trajectory:
    t = np.arange(120.0)
    zeros = np.zeros(t.size)
    return Trajectory(t, t, 20.0 * np.sin(t / 20.0), zeros, zeros, zeros, np.arctan(np.cos(t / 20.0)))


def test_a_track_that_is_shifted_has_that_error_unaligned_and_none_aligned(track_ref: Trajectory) -> None:
    shifted = replace(track_ref, x=track_ref.x + 3.0, y=track_ref.y - 4.0)
    assert ate_unaligned(shifted, track_ref).value == pytest.approx(5.0)
    assert ate(shifted, track_ref).value == pytest.approx(0.0, abs=1e-9)


def test_a_track_of_twice_the_length_is_not_forgiven_by_a_scale(track_ref: Trajectory) -> None:
    doubled = replace(track_ref, x=2 * track_ref.x, y=2 * track_ref.y)
    spread = np.sqrt(np.mean(np.sum((track_ref.positions - track_ref.positions.mean(axis=0))[:, :2] ** 2, axis=1)))
    assert ate(doubled, track_ref).value == pytest.approx(spread)


def test_depth_does_not_count_horizontally(track_ref: Trajectory) -> None:
    sunk = replace(track_ref, z=track_ref.z - np.arange(len(track_ref)))
    assert ate(sunk, track_ref).value == pytest.approx(0.0, abs=1e-9)
    assert ate_se3(sunk, track_ref).value > 10.0


def test_a_straight_line_with_a_wrong_heading_drifts_by_its_sine() -> None:
    t = np.arange(201.0)
    zeros = np.zeros(t.size)
    ref = Trajectory(t, t, zeros, zeros, zeros, zeros, zeros)
    # The vehicle believes it heads 0.1 rad to port of its true heading: relative frames hide it, the end does not.
    believed = Trajectory(t, t * np.cos(0.1), t * np.sin(0.1), zeros, zeros, zeros, zeros + 0.1)
    assert rpe(believed, ref, 50.0)[0].value == pytest.approx(0.0, abs=1e-9)
    error, share = end_point_error(believed, ref)
    assert error.value == pytest.approx(2 * 200 * np.sin(0.05))
    assert share.value == pytest.approx(100 * 2 * np.sin(0.05))


def test_a_crab_angle_counts_over_any_distance() -> None:
    t = np.arange(101.0)
    zeros = np.zeros(t.size)
    ref = Trajectory(t, t, zeros, zeros, zeros, zeros, zeros)
    crabbing = replace(ref, yaw=zeros + 0.1)
    translation, yaw = rpe(crabbing, ref, 50.0)
    # 51 pairs of 50 m; towards the end of the track, as evo has it, pairs down to 45 m.
    lengths = np.array([50.0] * 51 + [49.0, 48.0, 47.0, 46.0, 45.0])
    assert translation.value == pytest.approx(2 * np.sin(0.05) * np.sqrt(np.mean(lengths**2)))
    assert yaw.value == pytest.approx(0.0, abs=1e-12)
    assert "56 pairs" in translation.how


def test_a_short_track_has_no_pair(track_ref: Trajectory) -> None:
    translation, yaw = rpe(track_ref[:20], track_ref[:20], 50.0)
    assert np.isnan(translation.value)
    assert np.isnan(yaw.value)
    assert "0 pairs" in translation.how


def test_a_vehicle_at_rest_has_no_share() -> None:
    rest = Trajectory(np.arange(3.0), *np.zeros((6, 3)))
    assert np.isnan(end_point_error(rest, rest)[1].value)
    assert ate(rest, rest).value == 0.0


def test_errors_that_are_as_large_as_claimed_are_covered_95_of_100_times(track_ref: Trajectory) -> None:
    rng, n = np.random.default_rng(0), 400
    sigmas = np.column_stack([np.full(n, 0.5), np.full(n, 2.0), np.full(n, 0.1), np.full(n, 0.01)])
    noisy = replace(track_ref, x=track_ref.x + rng.normal(0, 0.5, n), y=track_ref.y + rng.normal(0, 2.0, n))
    # The share of 400 draws has a standard deviation of 1.1 %.
    assert track_coverage(noisy, sigmas, track_ref).value == pytest.approx(95.0, abs=3.3)
    assert track_coverage(noisy, 0.1 * sigmas, track_ref).value < 10.0
    assert np.isnan(track_coverage(noisy, np.full((n, 4), np.nan), track_ref).value)


def test_the_nees_is_one_where_sigma_is_the_error(track_ref: Trajectory) -> None:
    rng, n = np.random.default_rng(0), len(track_ref)
    sigmas = np.tile([0.5, 0.2, 1.0, 0.01], (n, 1))
    shift = sigmas * rng.normal(size=(n, 4))
    x, y, yaw = (getattr(track_ref, name) + shift[:, k] for name, k in (("x", 0), ("y", 1), ("yaw", 3)))
    noisy = replace(track_ref, x=x, y=y, yaw=yaw)
    # the mean of 3 n squares of normal numbers: four of its standard deviations
    assert track_nees(noisy, sigmas, track_ref).value == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (3 * n)))
    assert track_nees(noisy, 0.1 * sigmas, track_ref).value > 50.0
    assert np.isnan(track_nees(noisy, np.full((n, 4), np.nan), track_ref).value)


def test_the_reference_may_have_another_rate(track: Trajectory, track_ref: Trajectory) -> None:
    sparse = track_ref[::3]
    # Chords of the winding track lie within (3 m)^2 / (8 * 40 m) = 3 cm of it.
    assert ate(track, sparse).value == pytest.approx(ate(track, track_ref).value, abs=0.03)


def test_every_metric_says_unit_and_how(track: Trajectory, track_ref: Trajectory) -> None:
    found = evaluate_tracks(track, track_ref, track_ref)
    names = [metric.name for metric in found]
    assert names[:2] == ["ate", "ate_dr"]
    assert len(set(names)) == len(names)
    assert {name.removesuffix("_dr") for name in names} == {name for name in names if not name.endswith("_dr")}
    assert all(metric.how and metric.unit for metric in found)
    assert next(m for m in found if m.name == "ate_dr").value == pytest.approx(0.0, abs=1e-9)
