"""Clouds of points: shadows of single lines joined to regions, and rasters of known surfaces."""

import numpy as np
import pytest

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.line_cloud import LineCloud, rasterise, shadow_regions

RASTER = Raster(41, 41, 1.0, (-20.0, -20.0))


def grid_of_points(slope: float = 0.0) -> tuple[FloatArray, IntArray]:
    """Lines along y a metre apart, points half a metre apart, on a plane that rises along x."""
    x, y = np.meshgrid(np.arange(-15.0, 16.0), np.arange(-15.0, 15.5, 0.5), indexing="ij")
    points = np.stack([x, y, slope * x - 12.0], axis=-1).reshape(-1, 3)
    return points, np.repeat(np.arange(31), 61)


def cloud(points: FloatArray, line: IntArray, is_shadow: BoolArray | None = None) -> LineCloud:
    dark = np.zeros(len(points), dtype=bool) if is_shadow is None else is_shadow
    some = np.full(len(points), 0.2)
    return LineCloud(points, line, some, -some, dark, dark.astype(np.int64))


def test_shadows_of_neighbouring_lines_are_one_region_and_distant_ones_are_not() -> None:
    points, line = grid_of_points()
    left, right = (np.hypot(points[:, 0] - x, points[:, 1]) < 3 for x in (-8, 8))
    region = shadow_regions(points, line, left | right, 0.5)
    assert set(region[left]) == {1}
    assert set(region[right]) == {2}
    assert (region[~left & ~right] == 0).all()


def test_two_shadows_on_one_line_are_two_regions() -> None:
    points, line = grid_of_points()
    near, far = ((line == 4) & (np.abs(points[:, 1] - y) < 2) for y in (-8, 8))
    region = shadow_regions(points, line, near | far, 0.5)
    assert set(region[near]) == {1}
    assert set(region[far]) == {2}


@pytest.mark.parametrize("n_dark", [0, 1])
def test_a_cloud_with_next_to_no_shadow_has_as_many_regions(n_dark: int) -> None:
    points, line = grid_of_points()
    dark = np.zeros(len(points), dtype=bool)
    dark[:n_dark] = True
    assert shadow_regions(points, line, dark, 0.5).max() == n_dark


def test_a_plane_comes_out_of_the_raster_as_it_went_in() -> None:
    points, line = grid_of_points(slope=0.1)
    z, sigma, rho, dark = rasterise(cloud(points, line), RASTER)
    x = np.arange(-20.0, 21.0)
    inner = np.s_[7:34, 7:34]
    # points lie on the cells' middles along x and spread evenly about them along y
    np.testing.assert_allclose(z[inner], np.broadcast_to(0.1 * x - 12.0, z.shape)[inner], atol=1e-9)
    np.testing.assert_allclose(sigma[inner], 0.2)
    np.testing.assert_allclose(rho[inner], -0.2)
    assert not dark.any()


def test_what_no_line_passes_is_unknown() -> None:
    points, line = grid_of_points()
    z, sigma, rho, _ = rasterise(cloud(points, line), RASTER)
    assert np.isnan(z[:4]).all()
    for values in (sigma, rho):
        np.testing.assert_array_equal(np.isnan(values), np.isnan(z))


def test_gaps_between_lines_that_fan_out_are_bridged_with_more_doubt() -> None:
    points, line = grid_of_points(slope=0.5)
    keep = np.abs(points[:, 0] - 0.0) > 1.5  # three lines are missing
    z, sigma, _, _ = rasterise(cloud(points[keep], line[keep]), RASTER)
    assert np.isfinite(z[20, 18:23]).all()
    assert abs(z[20, 20] + 12.0) < 0.05
    assert sigma[20, 20] > sigma[20, 10]


def test_cells_mostly_in_shadow_are_shadow() -> None:
    points, line = grid_of_points()
    dark = (points[:, 1] > 2.6) & (points[:, 1] < 7.4)
    _, _, _, is_shadow = rasterise(cloud(points, line, dark), RASTER)
    y = np.arange(-20.0, 21.0)
    assert is_shadow[(y > 3.5) & (y < 6.5)][:, 6:35].all()
    assert not is_shadow[(y < 1.5) | (y > 8.5)].any()
