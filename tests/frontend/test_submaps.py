import numpy as np
import pytest

from frontend.heightfield import Heightfield
from frontend.submaps import Submap, surface_normals


def small_submap(z, shadow=None):
    z = np.asarray(z, dtype=np.float64)
    cells = np.arange(z.size, dtype=np.float64).reshape(z.shape)
    shadow = np.zeros(z.shape, dtype=bool) if shadow is None else shadow
    surface = Heightfield(z, 0.5, (-1.0, 2.0))
    return Submap(0, 0, 10, 5, 0.0, np.eye(4), np.eye(4), surface, 0.1 + cells, 10 + cells, shadow)


def test_points_lie_at_the_cell_centres_with_x_along_the_columns():
    points = small_submap([[1.0, 2.0], [3.0, 4.0]]).points
    assert np.array_equal(points, [[-1, 2, 1], [-0.5, 2, 2], [-1, 2.5, 3], [-0.5, 2.5, 4]])


def test_unknown_cells_are_no_points_and_everything_a_point_has_keeps_its_order():
    shadow = np.array([[False, False], [True, False]])
    submap = small_submap([[1.0, np.nan], [3.0, 4.0]], shadow)
    assert submap.points[:, 2].tolist() == [1, 3, 4]
    assert submap.sigmas.tolist() == [0.1, 2.1, 3.1]
    assert submap.reflectivity.tolist() == [10, 12, 13]
    assert submap.shadow.tolist() == [False, True, False]
    assert submap.normals.shape == (3, 3)


def test_normals_of_a_plane_are_perpendicular_to_it_everywhere():
    y, x = np.mgrid[0:6, 0:7] * 0.5
    normals = surface_normals(Heightfield(0.3 * x - 0.2 * y + 5, 0.5, (0.0, 0.0)))
    expected = np.array([-0.3, 0.2, 1.0]) / np.linalg.norm([0.3, 0.2, 1.0])
    assert normals == pytest.approx(np.broadcast_to(expected, (6, 7, 3)), abs=1e-12)


def test_normals_beside_unknown_cells_use_the_neighbour_that_is_known():
    z = 0.5 * np.arange(5.0) * np.ones((5, 1))
    z[2, 2] = np.nan
    normals = surface_normals(Heightfield(z, 1.0, (0.0, 0.0)))
    expected = np.array([-0.5, 0.0, 1.0]) / np.hypot(0.5, 1.0)
    assert np.isnan(normals[2, 2]).all()
    assert normals[2, 1] == pytest.approx(expected)
    assert normals[2, 3] == pytest.approx(expected)


def test_normals_of_a_lonely_cell_point_up():
    z = np.full((3, 3), np.nan)
    z[1, 1] = -4.0
    normals = surface_normals(Heightfield(z, 1.0, (0.0, 0.0)))
    assert normals[1, 1].tolist() == [0, 0, 1]
    assert np.isnan(normals[0, 0]).all()


def test_the_error_of_normals_falls_with_the_square_of_the_spacing():
    errors = []
    for spacing in (0.4, 0.2):
        x = np.arange(0, 12.0, spacing)
        normals = surface_normals(Heightfield(np.sin(x) * np.ones((3, 1)), spacing, (0.0, 0.0)))[1, 1:-1]
        errors.append(np.abs(-normals[:, 0] / normals[:, 2] - np.cos(x[1:-1])).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)  # central differences are of second order
