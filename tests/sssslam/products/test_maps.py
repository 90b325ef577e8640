"""Tests of the blend of submaps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.frames import planar_pose, pose, rotation_world_body
from frontend.heightfield import Heightfield
from frontend.submaps import Submap
from sssslam.products import maps
from sssslam.products.maps import SeafloorMap, blend_submaps
from sssslam.products.result import Result


def plane(height: float, sigma: float, slope_x: float = 0.0, reflectivity: float = 1.0) -> Submap:
    """A plane of 41 x 41 cells of 1 m about the origin."""
    axis = np.arange(-20.0, 21.0)
    x, _ = np.meshgrid(axis, axis)
    ones = np.ones_like(x)
    return Submap(
        number=0,
        first_ping=0,
        end_ping=10,
        anchor_ping=5,
        anchor_time=0.0,
        T_world_submap_dr=np.eye(4),
        T_submap_body=np.eye(4),
        surface=Heightfield(height + slope_x * x, 1.0, (-20.0, -20.0)),
        sigma=sigma * ones,
        log_reflectivity=np.log(reflectivity) * ones,
        is_shadow=np.zeros(x.shape, dtype=np.bool_),
    )


def at(seafloor: SeafloorMap, layer: np.ndarray, x: float, y: float) -> float:
    grid = seafloor.height
    return float(layer[round((y - grid.origin[1]) / grid.spacing), round((x - grid.origin[0]) / grid.spacing)])


def test_one_submap_is_its_own_map_at_its_depth() -> None:
    seafloor = blend_submaps([plane(-12.0, 0.1, slope_x=0.1)], planar_pose(0, 0, 0, -48.0)[None])
    assert at(seafloor, seafloor.height.z, 5.0, 3.0) == pytest.approx(-59.5, abs=1e-9)
    assert at(seafloor, seafloor.sigma, 5.0, 3.0) == pytest.approx(0.1, abs=1e-6)  # a difference of squares at 60 m


def test_two_submaps_are_weighted_by_inverse_variance_and_their_disagreement_counts() -> None:
    seafloor = blend_submaps([plane(0.0, 1.0), plane(1.0, 2.0)], np.stack([np.eye(4)] * 2))
    # weights 1 and 1/4: (0 + 0.25) / 1.25; variance (1 (1 + 0.2^2) + 0.25 (4 + 0.8^2)) / 1.25 = 1.76
    assert at(seafloor, seafloor.height.z, 0.0, 0.0) == pytest.approx(0.2)
    assert at(seafloor, seafloor.sigma, 0.0, 0.0) == pytest.approx(np.sqrt(1.76))


def test_reflectivity_is_blended_as_its_logarithm() -> None:
    submaps = [plane(0.0, 1.0, reflectivity=1.0), plane(0.0, 1.0, reflectivity=4.0)]
    seafloor = blend_submaps(submaps, np.stack([np.eye(4)] * 2))
    assert at(seafloor, seafloor.reflectivity, 0.0, 0.0) == pytest.approx(2.0)


def test_a_submap_that_heads_north_slopes_north() -> None:
    seafloor = blend_submaps([plane(0.0, 0.1, slope_x=0.1)], planar_pose(100.0, 0.0, np.pi / 2)[None])
    assert at(seafloor, seafloor.height.z, 100.0, 10.0) == pytest.approx(1.0)
    assert at(seafloor, seafloor.height.z, 110.0, 0.0) == pytest.approx(0.0, abs=1e-9)


def test_a_tilt_that_the_optimiser_left_does_not_move_the_map() -> None:
    T = pose([0.0, 0.0, -5000.0], rotation_world_body(0.01, -0.02, 0.0))
    seafloor = blend_submaps([plane(-12.0, 0.1, slope_x=0.1)], T[None])
    assert at(seafloor, seafloor.height.z, 5.0, 3.0) == pytest.approx(-5011.5, abs=1e-6)


def test_what_only_shadow_fell_on_has_a_height_but_no_reflectivity() -> None:
    dark = np.zeros((41, 41), dtype=np.bool_)
    dark[15:26, 15:26] = True
    seafloor = blend_submaps([replace(plane(3.0, 0.1), is_shadow=dark)], np.eye(4)[None])
    assert at(seafloor, seafloor.height.z, 0.0, 0.0) == pytest.approx(3.0)
    assert np.isnan(at(seafloor, seafloor.reflectivity, 0.0, 0.0))
    assert at(seafloor, seafloor.reflectivity, 10.0, 10.0) == pytest.approx(1.0)


def test_a_seam_has_no_step() -> None:
    low, high = plane(0.0, 0.1), plane(1.0, 0.1)
    seafloor = blend_submaps([low, high], np.stack([np.eye(4), planar_pose(25.0, 0.0, 0.0)]))
    row = seafloor.height.z[20]
    # Between the two planes lies a metre, spread over the overlap of 16 cells; an untapered blend steps by a half.
    assert np.nanmax(np.abs(np.diff(row))) < 0.25


def test_a_cell_without_a_positive_sigma_has_no_weight() -> None:
    seafloor = blend_submaps([plane(0.0, 0.0), plane(1.0, 2.0)], np.stack([np.eye(4)] * 2))
    assert at(seafloor, seafloor.height.z, 0.0, 0.0) == pytest.approx(1.0)
    assert not np.isfinite(blend_submaps([plane(0.0, np.nan)], np.eye(4)[None]).height.z).any()


def test_a_dive_without_submaps_has_a_map_of_one_unknown_cell() -> None:
    seafloor = blend_submaps([], np.empty((0, 4, 4)))
    assert seafloor.height.z.shape == (1, 1)
    assert np.isnan(seafloor.height.z).all()


def test_a_dive_too_large_for_its_cells_gets_coarser_ones(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(maps, "_MAX_CELLS", 3000)
    poses = np.stack([np.eye(4), planar_pose(100.0, 0.0, 0.0)])
    seafloor = blend_submaps([plane(1.0, 0.1), plane(1.0, 0.1)], poses)
    assert seafloor.height.spacing == 2.0
    assert seafloor.height.z.size <= 3000
    assert "the map has cells of 2 m instead of 1 m" in caplog.text


@given(st.floats(-3.1, 3.1), st.floats(-100, 100), st.floats(-100, 100))
def test_a_flat_floor_stays_flat_wherever_its_submaps_lie(yaw: float, x: float, y: float) -> None:
    seafloor = blend_submaps([plane(-2.0, 0.3), plane(-2.0, 0.5)], np.stack([np.eye(4), planar_pose(x, y, yaw)]))
    known = np.isfinite(seafloor.height.z)
    np.testing.assert_allclose(seafloor.height.z[known], -2.0, atol=1e-9)
    assert known.sum() >= 38**2


def test_the_map_of_the_dive_lies_on_the_terrain(result: Result) -> None:
    seafloor = blend_submaps(result.submaps, result.T_world_submap)
    truth = result.recording.truth
    assert truth is not None
    assert truth.terrain is not None
    error = seafloor.height.z - truth.terrain.sample(*np.meshgrid(seafloor.height.x, seafloor.height.y))
    # The poses are up to 1 m off on slopes of a few degrees; the submaps' own noise averages out.
    assert np.sqrt(np.nanmean(error**2)) < 0.12
