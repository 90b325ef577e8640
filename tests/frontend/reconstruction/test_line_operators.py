"""Slopes, reflectivity in shadow and a beam pattern that varies, on small cases."""

import numpy as np

from frontend.reconstruction.line_operators import beam_knots, fill_shadow, slope_on_line
from tests.frontend.reconstruction.small_lines import make_lines, make_window


def test_reflectivity_in_shadow_is_that_of_the_lit_neighbours_on_the_line() -> None:
    lit = np.ones((2, 6), dtype=bool)
    lit[0, 2:4], lit[1, :2] = False, False
    values = np.array([[0.0, 3.0, 99.0, 99.0, 6.0, 7.0], [99.0, 99.0, 1.0, 2.0, 3.0, 4.0]])
    filled = (fill_shadow(lit) @ values.ravel()).reshape(2, 6)
    np.testing.assert_allclose(filled, [[0, 3, 4, 5, 6, 7], [1, 1, 1, 2, 3, 4]])


def test_a_line_all_in_shadow_keeps_its_values() -> None:
    values = np.arange(8.0)
    lit = np.array([[False] * 4, [True] * 4])
    np.testing.assert_array_equal(fill_shadow(lit) @ values, values)


def test_slopes_on_a_line_do_not_look_at_other_lines() -> None:
    slope = slope_on_line(2, 4, 0.5)
    relief = np.array([0.0, 1.0, 2.0, 3.0, 9.0, 9.0, 9.0, 9.0])
    np.testing.assert_allclose(slope @ relief, [2.0] * 4 + [0.0] * 4)


def test_one_beam_pattern_is_shared_by_all_lines_where_its_knots_agree() -> None:
    frames, image = make_lines(make_window(n=20), 1.0)
    beam, n_angles = beam_knots(frames, image.angle, 0.1, 4.0)
    n_places = beam.shape[1] // (2 * n_angles)
    assert n_places == 4  # 9.5 m of track: knots every 4 m at least, and one more at each end of what is left
    np.testing.assert_allclose(beam @ np.ones(beam.shape[1]), 1.0)
    pattern = np.tile(np.sin(0.1 * np.arange(n_angles)), 2 * n_places)
    seen = (beam @ pattern).reshape(frames.shape)
    np.testing.assert_allclose(seen, np.broadcast_to(seen[0], frames.shape), atol=1e-12)


def test_the_beam_pattern_may_change_along_the_track() -> None:
    frames, image = make_lines(make_window(n=20), 1.0)
    beam, n_angles = beam_knots(frames, image.angle, 0.1, 100.0)
    drift = np.tile(np.repeat([0.0, 1.0], n_angles), 2)
    np.testing.assert_allclose(
        (beam @ drift).reshape(frames.shape)[:, 0], np.linspace(0, 1, frames.shape[0]), atol=1e-12
    )
