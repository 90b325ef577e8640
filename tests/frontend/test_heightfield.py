"""Heights between the cells of a grid."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from frontend.heightfield import Heightfield


def plane(slope_x: float, slope_y: float, height: float) -> Heightfield:
    grid = Heightfield(np.zeros((6, 9)), 0.5, (-2.0, 3.0))
    return Heightfield(height + slope_x * grid.x[None, :] + slope_y * grid.y[:, None], 0.5, (-2.0, 3.0))


def test_axes_are_the_cell_centres_x_along_columns() -> None:
    field = plane(0.0, 0.0, 0.0)
    np.testing.assert_array_equal(field.x, [-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0])
    np.testing.assert_array_equal(field.y, [3.0, 3.5, 4.0, 4.5, 5.0, 5.5])


@given(*[st.floats(-2.0, 2.0)] * 3, st.floats(-2.0, 2.0), st.floats(3.0, 5.5))
def test_a_plane_is_sampled_exactly(slope_x: float, slope_y: float, height: float, x: float, y: float) -> None:
    z = plane(slope_x, slope_y, height).sample(x, y)
    np.testing.assert_allclose(z, height + slope_x * x + slope_y * y, atol=1e-12)


def test_the_middle_of_four_cells_is_their_mean() -> None:
    assert Heightfield(np.array([[1.0, 2.0], [3.0, 6.0]]), 2.0, (0.0, 0.0)).sample(1.0, 1.0) == 3.0


def test_outside_the_grid_nothing_is_known() -> None:
    field = plane(0.1, 0.1, 1.0)
    assert np.isnan(field.sample([-2.1, 2.1, 0.0, 0.0], [4.0, 4.0, 2.9, 5.6])).all()
    assert np.isfinite(field.sample([-2.0, 2.0], [3.0, 5.5])).all()


def test_beside_an_unknown_cell_nothing_is_known() -> None:
    z = np.zeros((3, 3))
    z[1, 1] = np.nan
    field = Heightfield(z, 1.0, (0.0, 0.0))
    assert np.isnan(field.sample(0.5, 0.5))
    assert np.isnan(field.sample(1.0, 1.0))


def test_samples_have_the_shape_of_the_positions() -> None:
    field = plane(0.0, 0.0, 1.0)
    assert field.sample(np.zeros((2, 3)), np.full((2, 3), 4.0)).shape == (2, 3)
