"""Tests of the TUM format."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from evo.tools.file_interface import read_tum_trajectory_file
from hypothesis import given
from hypothesis import strategies as st

from frontend.trajectory import Trajectory
from sssslam.products.tum import format_tum, read_tum

angles = st.floats(-3.1, 3.1)


def one_pose(**values: float) -> Trajectory:
    names = ("time", "x", "y", "z", "roll", "pitch", "yaw")
    return Trajectory(*(np.array([values.get(name, 0.0)]) for name in names))


def test_a_pose_turned_north_is_half_a_turn_of_half_angles() -> None:
    text = format_tum(one_pose(time=1.5, x=1, y=-2, z=-30, yaw=np.pi / 2))
    assert text == "1.500000 1.000000 -2.000000 -30.000000 0.000000 0.000000 0.707107 0.707107\n"


def test_zero_has_no_sign() -> None:
    assert "-0.000000" not in format_tum(one_pose(x=-1e-9, y=-0.0))


def test_evo_reads_the_same_poses(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    trajectory = Trajectory(1.7e9 + np.arange(20.0), *rng.normal(0, 50, (3, 20)), *rng.uniform(-1, 1, (3, 20)))
    (tmp_path / "t.tum").write_text(format_tum(trajectory))
    theirs = read_tum_trajectory_file(str(tmp_path / "t.tum"))
    np.testing.assert_array_equal(theirs.timestamps, trajectory.time)
    # Six decimals: 5e-7 m, and 2e-6 rad of a quaternion whose parts are off by 5e-7 each.
    np.testing.assert_allclose(np.array(theirs.poses_se3)[:, :3, 3], trajectory.positions, atol=6e-7)
    np.testing.assert_allclose(np.array(theirs.poses_se3)[:, :3, :3], trajectory.poses[:, :3, :3], atol=3e-6)


@given(st.floats(-1e4, 1e4), st.floats(-1.5, 1.5), angles, angles)
def test_reading_gives_back_what_was_written(x: float, pitch: float, roll: float, yaw: float) -> None:
    before = one_pose(time=1.7e9, x=x, pitch=pitch, roll=roll, yaw=yaw)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "t.tum"
        path.write_text(format_tum(before))
        np.testing.assert_allclose(read_tum(path).poses, before.poses, atol=3e-6)


def test_comments_and_empty_lines_are_skipped(tmp_path: Path) -> None:
    (tmp_path / "t.tum").write_text("# t x y z\n\n1 2 3 4 0 0 0 1 # start\n2 2 3 4 0 0 0 2\n")
    trajectory = read_tum(tmp_path / "t.tum")
    assert len(trajectory) == 2
    np.testing.assert_array_equal(trajectory.positions[0], [2, 3, 4])


ROW = "1 2 3 4 0 0 0 1\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "needs at least one row"),
        (b"\xff\xfe\x00", "it is not text"),
        (b"1 2 3\n", r"line 1: a TUM row has 8 numbers .* got 3 words"),
        (b"1 2 3 4 0 0 0 one\n", r"line 1: a TUM row has 8 numbers .* got '1 2 3"),
        (b"1 2 3 nan 0 0 0 1\n", "line 1: the numbers of a TUM row must be finite"),
        (b"1 2 3 4 1e300 0 0 1\n", "line 1: the numbers of a TUM row must be finite and below 1e"),
        (ROW.encode() * 2, "row 2 is not later than the one before"),
        (b"1 2 3 4 0 0 0 0\n", "quaternions must have length 1, row 1 has"),
    ],
)
def test_a_broken_file_is_refused_with_its_place(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "t.tum").write_bytes(content)
    with pytest.raises(ValueError, match=message):
        read_tum(tmp_path / "t.tum")


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.tum", tmp_path):
        with pytest.raises(ValueError, match=r"a TUM trajectory \(text\) is wanted, cannot read it"):
            read_tum(path)
