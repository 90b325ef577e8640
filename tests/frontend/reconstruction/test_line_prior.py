"""Slopes are freer about a shadow, as much for a long one as for a short one."""

import numpy as np
import pytest

from frontend.reconstruction.line_prior import LinePriorConfig, _shadow_lengths, _trust

CONFIG = LinePriorConfig(shadow_slope=4.0)


def test_a_shadow_is_as_long_as_its_cells_on_its_own_line() -> None:
    dark = np.array([[1, 1, 0, 1, 0], [0, 1, 1, 1, 0]], dtype=np.bool_)
    np.testing.assert_array_equal(_shadow_lengths(dark), [[2, 2, 0, 1, 0], [0, 3, 3, 3, 0]])
    np.testing.assert_array_equal(_shadow_lengths(np.zeros((2, 4), dtype=np.bool_)), 0)


def test_slopes_are_freer_in_a_shadow_and_two_cells_about_it() -> None:
    dark = np.zeros((1, 12), dtype=np.bool_)
    dark[0, 6] = True
    # the slope beyond cell k joins it to cell k + 1
    np.testing.assert_array_equal(np.flatnonzero(_trust(dark, CONFIG)[0] < 1), np.arange(3, 9))
    assert _trust(dark, CONFIG)[0, 6] == 1 / 4.0


@pytest.mark.parametrize("n", [1, 4, 9, 16])
def test_a_long_shadow_may_hide_no_higher_a_step_than_a_short_one(n: int) -> None:
    dark = np.zeros((1, 40), dtype=np.bool_)
    dark[0, 10 : 10 + n] = True
    steeper = 1 / _trust(dark, CONFIG)[0, 10 : 10 + n]
    # independent slopes walk by the root of their number
    assert np.sqrt((steeper**2).sum()) == pytest.approx(4.0)


def test_without_a_shadow_all_slopes_are_believed_alike() -> None:
    np.testing.assert_array_equal(_trust(np.zeros((3, 8), dtype=np.bool_), CONFIG), 1.0)
