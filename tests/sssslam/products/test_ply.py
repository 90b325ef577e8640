"""Tests of submaps as PLY."""

from pathlib import Path

import numpy as np
import pytest

from frontend.frames import planar_pose
from frontend.heightfield import Heightfield
from frontend.open3d_loader import load_open3d
from frontend.submaps import Submap
from sssslam.products.ply import format_ply, read_ply
from sssslam.products.result import Result


@pytest.fixture
def submap(result: Result) -> Submap:
    """One of the dive, with shadow in it."""
    return result.submaps[2]


def write(path: Path, submap: Submap) -> Path:
    path.write_bytes(format_ply(submap, planar_pose(1.0, 2.0, 0.5, -48.0)))
    return path


def test_the_header_has_the_properties_of_the_contract(submap: Submap) -> None:
    header = format_ply(submap, np.eye(4)).split(b"end_header\n")[0].decode()
    assert header.startswith("ply\nformat binary_little_endian 1.0\n")
    names = [line.split()[-1] for line in header.splitlines() if line.startswith("property")]
    assert " ".join(names) == "x y z nx ny nz sigma shadow reflectivity"


def test_open3d_reads_the_same_points_and_normals(submap: Submap, tmp_path: Path) -> None:
    cloud = load_open3d().io.read_point_cloud(str(write(tmp_path / "s.ply", submap)))
    # 24 bits of a number below 64 m: 4e-6 m.
    np.testing.assert_allclose(np.asarray(cloud.points), submap.points, atol=4e-6)
    np.testing.assert_allclose(np.asarray(cloud.normals), submap.normals, atol=1e-7)


def test_reading_gives_the_submap_back(submap: Submap, tmp_path: Path) -> None:
    read, T_world_submap = read_ply(write(tmp_path / "s.ply", submap))
    np.testing.assert_allclose(T_world_submap, planar_pose(1.0, 2.0, 0.5, -48.0), atol=1e-15)
    np.testing.assert_allclose(read.surface.z, submap.surface.z, rtol=1e-7)
    np.testing.assert_allclose(read.sigma, submap.sigma, rtol=1e-7)
    np.testing.assert_allclose(read.log_reflectivity, submap.log_reflectivity, atol=2e-7)
    np.testing.assert_array_equal(read.is_shadow, submap.is_shadow)
    np.testing.assert_allclose(read.T_submap_body, submap.T_submap_body, atol=1e-15)
    np.testing.assert_allclose(read.T_world_submap_dr, submap.T_world_submap_dr, atol=1e-12)
    assert (read.surface.spacing, read.surface.origin) == (submap.surface.spacing, submap.surface.origin)
    for name in ("number", "first_ping", "end_ping", "anchor_ping"):
        assert getattr(read, name) == getattr(submap, name)
    assert abs(read.anchor_time - submap.anchor_time) < 1e-6


def test_writing_again_what_was_read_gives_the_same_shape(submap: Submap, tmp_path: Path) -> None:
    once = write(tmp_path / "a.ply", submap)
    again = write(tmp_path / "b.ply", read_ply(once)[0])
    assert read_ply(again)[0].surface.z.tobytes() == read_ply(once)[0].surface.z.tobytes()


def test_a_submap_without_a_height_has_no_vertex(submap: Submap, tmp_path: Path) -> None:
    from dataclasses import replace

    surface = Heightfield(np.full_like(submap.surface.z, np.nan), 1.0, (0.0, 0.0))
    read, _ = read_ply(write(tmp_path / "s.ply", replace(submap, surface=surface)))
    assert not read.is_known.any()


def test_a_cut_file_is_refused(submap: Submap, tmp_path: Path) -> None:
    path = write(tmp_path / "s.ply", submap)
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(ValueError, match=r"this is none or is damaged \(.* vertices need .* bytes, got"):
        read_ply(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"binary_little_endian", b"ascii", "a binary little-endian PLY file is wanted"),
        (b"comment grid", b"comment grit", "this is none or is damaged .'grid'"),
        (b"property float sigma\n", b"", "vertices must have x y z"),
        (b"comment grid 1.0", b"comment grid 0.0", "the grid must have 1 to"),
        (b" 41 51\n", b" 9999999 9999999\n", "the grid must have 1 to"),
        (b" 41 51\n", b" 5 5\n", "vertices must lie on the grid"),
    ],
)
def test_a_foreign_or_damaged_file_is_refused(
    submap: Submap, tmp_path: Path, old: bytes, new: bytes, message: str
) -> None:
    path = write(tmp_path / "s.ply", submap)
    assert old in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        read_ply(path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"a submap \(PLY\) is wanted, cannot read it"):
        read_ply(tmp_path / "none.ply")
