"""Tests of the 3D viewer: what it shows is what the run left, in one page, and what is missing is said."""

from dataclasses import replace
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.heightfield import Heightfield
from sssslam.products.grids import format_geotiff
from sssslam.products.result import Result
from sssslam.products.run import read_run
from sssslam.products.shape import write_shape
from sssslam.products.viewer import View, read_view, thin_grid, write_view
from sssslam.products.viewer_page import EXAGGERATIONS, draw_view, render_view

_MOST = 15_000_000  # bytes: a page that can be sent by mail


@pytest.fixture
def finished(written: Path, tmp_path: Path) -> Path:
    return Path(copytree(written, tmp_path / "out"))


@pytest.fixture(scope="module")
def view(written: Path) -> View:
    return read_view(written)


def make_view(n: int) -> View:
    """A wavy floor of n x n cells of 1 m about -50 m with a track over it."""
    z = -50.0 + np.sin(np.arange(n) / 5.0)[:, None] * np.ones(n)
    track = np.stack([np.linspace(0, n - 1, 5), np.zeros(5), np.full(5, -40.0)], axis=-1)
    ends = np.array([[[0.0, 0.0, -40.0], [n - 1.0, 0.0, -40.0]]])
    return View("wave", Heightfield(z, 1.0, (0.0, 0.0)), np.ones((n, n)), {"corrected track": track}, ends)


def test_a_run_is_shown_as_it_was_written(written: Path, view: View) -> None:
    run = read_run(written)
    np.testing.assert_array_equal(view.surface.z, run.seafloor.z)  # small enough to be shown whole
    np.testing.assert_array_equal(view.tracks["corrected track"], run.trajectory.positions)
    np.testing.assert_array_equal(view.tracks["dead-reckoned track"], run.trajectory_dr.positions)
    assert view.title.startswith("dive <7> & more.xtf: ")


def test_a_loop_closure_joins_the_corrected_positions_of_its_anchors(result: Result, view: View) -> None:
    pings = {submap.number: submap.anchor_ping for submap in result.submaps}
    accepted = [closure for closure in result.loop_closures if closure.accepted]
    wanted = {tuple(result.trajectory.x[[pings[c.target], pings[c.source]]].round(3)) for c in accepted}
    assert {tuple(ends[:, 0].round(3)) for ends in view.loop_closures} == wanted
    assert len(view.loop_closures) == len(accepted)


def test_the_figure_holds_the_surface_twice_both_tracks_and_one_line_of_all_closures(view: View) -> None:
    by_height, by_reflectivity, dead_reckoned, corrected, closures = draw_view(view).data
    np.testing.assert_allclose(by_height.surfacecolor, view.surface.z, rtol=1e-6)  # 24 bits
    np.testing.assert_allclose(by_reflectivity.surfacecolor, 10.0 * np.log10(view.reflectivity), rtol=1e-5, atol=1e-6)
    assert (by_height.visible, by_reflectivity.visible) == (None, False)
    assert (dead_reckoned.name, corrected.name) == ("dead-reckoned track", "corrected track")
    lifted = np.flatnonzero(np.isnan(closures.x))
    assert closures.name == f"loop closures ({len(lifted)})"
    np.testing.assert_array_equal(lifted % 3, 2)  # after every second end


def test_a_metre_up_is_drawn_as_long_as_a_metre_east_times_what_the_control_says() -> None:
    layout = draw_view(make_view(60)).layout
    axes = [layout.scene.xaxis.range, layout.scene.yaxis.range, layout.scene.zaxis.range]
    metres = [high - low for low, high in axes]
    for step, times in zip(layout.sliders[0].steps, EXAGGERATIONS, strict=True):
        up = step.args[0]["scene.aspectratio.z"] / metres[2]
        east = layout.scene.aspectratio.x / metres[0]
        assert up / east == pytest.approx(times)
        assert layout.scene.aspectratio.y / metres[1] == pytest.approx(east)
    chosen = layout.sliders[0].steps[layout.sliders[0].active].args[0]["scene.aspectratio.z"]
    assert layout.scene.aspectratio.z == chosen


def test_everything_lies_in_the_box(view: View) -> None:
    scene = draw_view(view).layout.scene
    for axis, positions in zip((scene.xaxis, scene.yaxis, scene.zaxis), view.tracks["corrected track"].T, strict=True):
        assert axis.range[0] < positions.min()
        assert axis.range[1] > positions.max()
    assert scene.zaxis.range[0] < np.nanmin(view.surface.z)


def test_the_page_needs_no_other_file_and_is_the_same_every_time(finished: Path) -> None:
    page = write_view(finished)
    content = page.read_bytes()
    assert page == finished / "view.html"
    assert b"<script src" not in content
    assert b"<link" not in content
    assert write_view(finished).read_bytes() == content
    assert not list(finished.glob(".view*"))


def test_a_hostile_name_stays_text() -> None:
    page = render_view(replace(make_view(4), title="</script><script>alert(1)</script>"))
    assert "alert(1)" in page
    assert "<script>alert" not in page
    assert "</script><script>" not in page.replace("\n", "")[page.rindex("Plotly.newPlot") :]


def test_a_large_map_gives_a_page_that_can_be_sent() -> None:
    view = make_view(2000)
    surface, reflectivity = thin_grid(view.surface, view.reflectivity, 250_000)
    assert len(render_view(replace(view, surface=surface, reflectivity=reflectivity))) < _MOST


@given(rows=st.integers(1, 90), columns=st.integers(1, 90), most=st.integers(1, 400))
def test_a_thinned_plane_is_the_same_plane(rows: int, columns: int, most: int) -> None:
    x, y = np.meshgrid(np.arange(columns) * 0.5, np.arange(rows) * 0.5)
    plane = Heightfield(2.0 * x - 3.0 * y, 0.5, (0.0, 0.0))
    thinned, values = thin_grid(plane, plane.z, most)
    assert thinned.z.size <= most
    np.testing.assert_array_equal(thinned.z, values)
    n = round(thinned.spacing / 0.5)
    whole = (slice(0, rows // n), slice(0, columns // n))  # blocks at the far rim may be smaller
    X, Y = np.meshgrid(thinned.x, thinned.y)
    np.testing.assert_allclose(thinned.z[whole], (2.0 * X - 3.0 * Y)[whole], atol=1e-9)


def test_a_track_of_many_pings_keeps_its_ends(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sssslam.products.viewer._MAX_POINTS", 100)
    whole, shown = read_run(written).trajectory, read_view(written).tracks["corrected track"]
    assert len(whole) > len(shown) == 100
    np.testing.assert_array_equal(shown[[0, -1]], whole.positions[[0, -1]])


def test_a_reconstruction_by_itself_is_shown_without_tracks(result: Result, tmp_path: Path) -> None:
    bottom = np.full((result.recording.n_pings, 2), 12.0)
    write_shape(result.recording, result.submaps[:3], bottom, tmp_path / "shape")
    view = read_view(tmp_path / "shape")
    assert view.title == "shape: 3 submaps at their dead-reckoned poses"
    assert not view.tracks
    assert np.isfinite(view.surface.z).any()
    assert len(draw_view(view).data) == 2


def test_a_run_whose_floor_is_unknown_is_shown_all_the_same() -> None:
    view = make_view(5)
    unknown = replace(view, surface=replace(view.surface, z=np.full((5, 5), np.nan)))
    assert "scene" in draw_view(unknown).layout


def test_a_new_run_takes_the_view_of_the_old_one_away(result: Result, finished: Path) -> None:
    write_view(finished)
    write_shape(result.recording, [], np.full((result.recording.n_pings, 2), 12.0), finished)
    assert not (finished / "view.html").exists()


def test_a_folder_that_is_none_is_said(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"none is not there; the folder of a finished run is wanted"):
        read_view(tmp_path / "none")
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match=r"file is a file; the folder of a finished run is wanted"):
        read_view(tmp_path / "file")


def test_a_folder_without_products_is_said(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"holds no run\.json and no submaps; the folder of a finished run is wanted"):
        read_view(tmp_path)


def test_half_a_run_is_said(finished: Path) -> None:
    (finished / "run.json").unlink()
    with pytest.raises(ValueError, match=r"holds a part of a run: its run\.json, written last, is missing"):
        read_view(finished)


def test_a_mosaic_of_another_run_is_said(finished: Path) -> None:
    (finished / "mosaic.tif").write_bytes(format_geotiff({"z": np.ones((3, 3))}, 1.0, (0.0, 0.0), None))
    with pytest.raises(ValueError, match=r"mosaic\.tif: a grid like seafloor\.tif, .* is wanted, got \(3, 3\)"):
        read_view(finished)


def test_a_folder_that_cannot_be_written_is_said(finished: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("sssslam.products.viewer.atomic_write", refuse)
    with pytest.raises(ValueError, match=r"view\.html: a folder that can be written is wanted \(Permission denied\)"):
        write_view(finished)
