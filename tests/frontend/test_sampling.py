import numpy as np
import pytest

from frontend import sampling as module
from frontend.sampling import normal_equations, sample_rasters


def bilinear_field(shape):
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]].astype(float)
    return 1.0 + 0.5 * x - 0.25 * y + 0.1 * x * y


def test_a_bilinear_field_is_sampled_exactly_at_turned_and_shifted_positions():
    rasters = np.stack([np.ones((8, 9)), bilinear_field((8, 9))], axis=-1)
    positions = np.array([[0.3, -0.4], [1.0, 2.0]])
    planar = (3.0, 2.5, 0.7)
    x = 3.0 + np.cos(0.7) * positions[:, 0] - np.sin(0.7) * positions[:, 1]
    y = 2.5 + np.sin(0.7) * positions[:, 0] + np.cos(0.7) * positions[:, 1]
    samples = sample_rasters(rasters, positions, (0.0, 0.0, 1.0), planar)
    assert samples[:, 1] == pytest.approx(1.0 + 0.5 * x - 0.25 * y + 0.1 * x * y)


def test_origin_and_spacing_of_the_grid_count():
    rasters = np.stack([np.ones((8, 9)), bilinear_field((8, 9))], axis=-1)
    at = np.array([[10.0 + 0.5 * 3, -4.0 + 0.5 * 2]])
    assert sample_rasters(rasters, at, (10.0, -4.0, 0.5), (0.0, 0.0, 0.0))[0, 1] == pytest.approx(1 + 1.5 - 0.5 + 0.6)


@pytest.mark.parametrize("at", [(-0.01, 3.0), (3.0, -0.01), (8.0, 3.0), (3.0, 7.0), (1e9, 0.0)])
def test_positions_outside_the_grid_have_no_trust(at):
    rasters = np.ones((8, 9, 2))
    assert not sample_rasters(rasters, np.array([at]), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)).any()


def test_positions_beside_a_cell_without_trust_have_none():
    rasters = np.ones((8, 9, 2))
    rasters[4, 4, 0] = 0
    beside, apart = sample_rasters(rasters, np.array([[3.5, 3.5], [2.5, 2.5]]), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    assert not beside.any()
    assert apart.all()


def test_the_kernel_is_its_own_python_function():
    rng = np.random.default_rng(0)
    rasters, cells, frame = rng.uniform(0, 1, (7, 6, 3)), rng.uniform(0, 6, (30, 2)), np.array([0.5, 0.25, 1.0])
    planar, compiled, plain = np.array([0.2, 0.4, 0.3]), np.zeros((30, 3)), np.zeros((30, 3))
    module._sample(rasters, cells, frame, planar, compiled)
    getattr(module._sample, "py_func", module._sample)(rasters, cells, frame, planar, plain)
    assert compiled == pytest.approx(plain, abs=1e-14)


def test_fewer_than_three_cells_that_meet_fix_nothing():
    rasters, cells = np.ones((8, 9, 4)), np.ones((2, 6))
    H, H_common, g = normal_equations(rasters, cells, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 3.0)
    assert not H.any()
    assert not H_common.any()
    assert not g.any()


def test_the_normal_equations_are_their_own_python_function():
    rng = np.random.default_rng(0)
    rasters, cells = rng.uniform(0.1, 1, (7, 6, 4)), rng.uniform(0, 5, (30, 6))
    frame, planar = np.array([0.0, 0.0, 1.0]), np.array([0.2, 0.4, 0.3])
    compiled, plain = ([np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)] for _ in range(2))
    module._normal_equations(rasters, cells, frame, planar, 3.0, *compiled)
    getattr(module._normal_equations, "py_func", module._normal_equations)(rasters, cells, frame, planar, 3.0, *plain)
    assert compiled[0].any()
    for a, b in zip(compiled, plain, strict=True):
        assert a == pytest.approx(b, rel=1e-12)
