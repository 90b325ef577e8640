"""Tests of reading a run back."""

from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from frontend.frames import wrap_angle
from sssslam.products.grids import format_geotiff
from sssslam.products.result import Result
from sssslam.products.run import read_run


def test_a_run_is_read_back_as_it_was(result: Result, written: Path) -> None:
    run = read_run(written)
    np.testing.assert_allclose(run.trajectory.positions, result.trajectory.positions, atol=6e-7)
    turn = wrap_angle(run.trajectory_dr.yaw - result.recording.trajectory_dr.yaw)
    np.testing.assert_allclose(turn, 0.0, atol=4e-6)  # six decimals of a quaternion
    np.testing.assert_allclose(run.sigmas, result.sigmas, atol=6e-7)
    assert [s.number for s in run.submaps] == [s.number for s in result.submaps]
    assert len(run.loop_closures) == len(result.loop_closures)
    assert run.seafloor.z.shape == run.seafloor_sigma.shape
    assert run.crs is not None


def test_anchor_times_are_rows_of_the_trajectory(written: Path) -> None:
    run = read_run(written)
    assert set(run.anchor_time.values()) <= set(run.trajectory.time)


def test_a_folder_without_a_finished_run_is_refused(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(ValueError, match=r"the folder of a finished run is wanted, it has no run\.json"):
            read_run(folder)


def drop_last_line(path: Path) -> None:
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("trajectory.tum", "must have the same times, they differ"),
        ("trajectory.csv", "one row a pose of trajectory.tum is wanted"),
    ],
)
def test_products_that_do_not_belong_together_are_refused(
    written: Path, tmp_path: Path, name: str, message: str
) -> None:
    copytree(written, tmp_path / "out")
    drop_last_line(tmp_path / "out" / name)
    with pytest.raises(ValueError, match=message):
        read_run(tmp_path / "out")


def test_a_foreign_table_or_map_is_refused(written: Path, tmp_path: Path) -> None:
    out = Path(copytree(written, tmp_path / "out"))
    (out / "seafloor.tif").write_bytes(format_geotiff({"z": np.ones((3, 3))}, 1.0, (0.0, 0.0), None))
    with pytest.raises(ValueError, match="a height and a sigma band are wanted, got 1 bands"):
        _ = read_run(out).seafloor
    (out / "trajectory.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ValueError, match=r"a table time,x,y,z.* is wanted, cannot read it"):
        read_run(out)
