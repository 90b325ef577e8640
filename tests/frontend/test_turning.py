import numpy as np
import pytest

from frontend.relief import Relief
from frontend.turning import TurnedRelief, turn


def relief_of(z, weight=None, spacing=1.0, origin=(-20.0, -30.0)):
    weight = np.ones_like(z) if weight is None else weight
    return Relief(z, weight, z, z, np.ones_like(z), spacing, origin)


def plane(slope_x, slope_y):
    x, y = np.meshgrid(np.arange(-20.0, 21.0), np.arange(-30.0, 31.0))
    return relief_of(slope_x * x + slope_y * y)


@pytest.mark.parametrize("yaw", [0.0, 0.4, np.pi / 2, -2.5])
def test_a_plane_slopes_along_the_turned_axes(yaw):
    turned = turn(plane(0.1, 0.02), yaw, 2.0)
    x, y = np.meshgrid(*(turned.origin[k] + 2.0 * np.arange(turned.shape[1 - k]) for k in (0, 1)))
    slope = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]) @ [0.1, 0.02]
    whole = turned.weight == 1.0  # blocks at the edge are centred elsewhere
    assert whole.sum() > 400
    assert turned.values[0][whole] == pytest.approx((slope[0] * x + slope[1] * y)[whole], abs=1e-9)


def test_all_of_a_relief_lies_on_the_turned_grid():
    turned = turn(plane(0.0, 0.0), 0.7, 2.0)
    # bilinear samples want four cells around, so the outer half cell is lost: 40 x 60 of 41 x 61 m^2
    assert turned.weight.sum() * 4.0 == pytest.approx(40 * 60, rel=0.02)


def test_cells_without_trust_have_none_when_turned():
    weight = np.ones((61, 41))
    weight[:, :20] = 0.0
    relief = relief_of(np.where(weight > 0, 1.0, 0.0), weight)
    turned = turn(relief, np.pi, 1.0)
    assert not turned.weight[:, -19:].any()
    assert turned.values[0][turned.weight > 0] == pytest.approx(1.0)


def test_a_copy_is_made_once_and_the_oldest_go():
    relief = TurnedRelief(plane(0.1, 0.0), 0.3, 0.05, 2.0)
    assert relief.yaw(4) == pytest.approx(0.5)
    first = relief.at(0)
    assert relief.at(0) is first
    assert relief.spectra(0, (72, 72)) is relief.spectra(0, (72, 72))
    for k in range(1, 100):
        relief.at(k)
    assert relief.at(0) is not first
    assert np.array_equal(relief.at(0).values, first.values)
