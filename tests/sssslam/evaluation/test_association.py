"""Tests of pairing poses by time."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.trajectory import Trajectory
from sssslam.evaluation.association import associate, interpolate, is_covered


def line(time: list[float]) -> Trajectory:
    """East at 1 m/s, turning left by 0.1 rad/s through the seam at pi."""
    t = np.array(time)
    zeros = np.zeros(t.size)
    return Trajectory(t, t, zeros, zeros, zeros, zeros, 3.0 + 0.1 * t)


def test_positions_lie_on_lines_and_turns_on_arcs_across_the_seam() -> None:
    between = interpolate(line([0.0, 2.0, 4.0]), [1.0, 3.0])
    np.testing.assert_allclose(between.x, [1.0, 3.0])
    np.testing.assert_allclose(np.exp(1j * between.yaw), np.exp(1j * np.array([3.1, 3.3])), atol=1e-12)


def test_the_poses_themselves_are_given_back(track_ref: Trajectory) -> None:
    np.testing.assert_allclose(interpolate(track_ref, track_ref.time).poses, track_ref.poses, atol=1e-9)


def test_a_reference_of_one_pose_stands_for_its_own_time_only() -> None:
    assert is_covered(line([1.0]), [0.0, 1.0, 2.0]).tolist() == [False, True, False]
    assert interpolate(line([1.0]), [1.0]).x.tolist() == [1.0]


def test_a_long_pause_of_the_reference_covers_nothing() -> None:
    time = [*range(10), *range(40, 50)]
    covered = is_covered(line([float(t) for t in time]), [-1.0, 0.0, 8.5, 9.0, 20.0, 39.9, 40.0, 49.0, 49.5])
    assert covered.tolist() == [False, True, True, True, False, False, True, True, False]


def test_a_sparse_but_regular_reference_covers_all() -> None:
    assert is_covered(line([0.0, 60.0, 120.0]), [30.0, 90.0]).all()


def test_rounded_times_at_the_ends_are_covered() -> None:
    covered = is_covered(line([0.0000004, 1.0, 1.9999996]), [0.0, 2.0])
    assert covered.all()


def test_only_poses_with_a_partner_are_paired(track_ref: Trajectory) -> None:
    matched, matched_ref, is_matched = associate(track_ref, track_ref[100:200])
    assert len(matched) == len(matched_ref) == 100
    assert np.flatnonzero(is_matched)[[0, -1]].tolist() == [100, 199]
    np.testing.assert_allclose(matched.positions, matched_ref.positions, atol=1e-9)


def test_tracks_on_different_clocks_are_refused(track_ref: Trajectory) -> None:
    other = replace(track_ref, time=track_ref.time - 1.7e9)
    run, reference = r"1700000000\.000 to 1700000399\.000 s", r"0\.000 to 399\.000 s"
    with pytest.raises(ValueError, match=f"same clock: the run goes from {run}, the reference from {reference}"):
        associate(track_ref, other)


def test_one_common_pose_is_not_enough(track_ref: Trajectory) -> None:
    with pytest.raises(ValueError, match="must cover at least two poses of the run"):
        associate(track_ref, track_ref[:1])
