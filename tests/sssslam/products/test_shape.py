"""Tests of what a reconstruction by itself leaves."""

from pathlib import Path
from shutil import copytree

import numpy as np

from sssslam.products.ply import read_ply
from sssslam.products.result import Result
from sssslam.products.shape import write_shape


def test_submaps_lie_at_their_dead_reckoned_poses_beside_two_figures(result: Result, tmp_path: Path) -> None:
    bottom = np.full((result.recording.n_pings, 2), 12.0)
    write_shape(result.recording, result.submaps[:2], bottom, tmp_path)
    names = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    assert names == ["figures/submaps.png", "figures/waterfall.png", "submaps/0000.ply", "submaps/0001.ply"]
    submap, T_world_submap = read_ply(tmp_path / "submaps" / "0001.ply")
    np.testing.assert_allclose(T_world_submap, submap.T_world_submap_dr)


def test_nothing_of_an_earlier_run_is_left(result: Result, written: Path, tmp_path: Path) -> None:
    out = Path(copytree(written, tmp_path / "out"))
    write_shape(result.recording, (), np.full((result.recording.n_pings, 2), np.nan), out)
    names = sorted(str(path.relative_to(out)) for path in out.rglob("*") if path.is_file())
    assert names == ["figures/waterfall.png"]
