import numpy as np
import pytest

from frontend import sampling as module
from frontend.sampling import Descent, correlations, descend, normal_equations, sample_rasters


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


def plain(kernel):
    return getattr(kernel, "py_func", kernel)


def met_of(meet, rasters, cells, frame, planar):
    """Samples and cells that a kernel finds."""
    samples, which = np.empty((len(cells), rasters.shape[2])), np.empty(len(cells), dtype=np.int64)
    n = meet(rasters, cells, np.array(frame), np.array(planar), samples, which)
    return samples[:n], which[:n]


def test_the_kernel_is_its_own_python_function():
    rng = np.random.default_rng(0)
    rasters, cells = rng.uniform(0, 1, (7, 6, 3)), rng.uniform(0, 6, (30, 2))
    found = [met_of(f, rasters, cells, (0.5, 0.25, 1.0), (0.2, 0.4, 0.3)) for f in (module._meet, plain(module._meet))]
    assert 0 < len(found[0][1]) < 30
    assert found[0][1].tolist() == found[1][1].tolist()
    assert found[0][0] == pytest.approx(found[1][0], abs=1e-14)


def test_correlations_are_those_of_the_samples():
    rng = np.random.default_rng(1)
    rasters, cells = rng.uniform(0.1, 1, (9, 8, 3)), rng.uniform(0, 7, (60, 5))
    frame, planar = (0.5, 0.25, 1.0), (0.2, 0.4, 0.3)
    samples = sample_rasters(rasters, cells, frame, planar)
    met = samples[:, 0] > 0
    weight = (samples[:, 0] * cells[:, 2])[met]
    found, coincidences, n_cells = correlations(rasters, cells, frame, planar)
    assert n_cells == met.sum()
    for k in (0, 1):  # numpy's own, the means taken away
        C = np.cov(samples[met, 1 + k], cells[met, 3 + k], aweights=weight)
        assert found[k] == pytest.approx(C[0, 1] / np.sqrt(C[0, 0] * C[1, 1]), abs=1e-12)
        aa, bb = samples[met, 1 + k] ** 2, cells[met, 3 + k] ** 2
        mean = [np.average(a, weights=weight) for a in (aa * bb, aa, bb)]
        assert coincidences[k] == pytest.approx(mean[0] / (mean[1] * mean[2]), rel=1e-12)


def test_the_sums_of_correlations_are_their_own_python_function():
    rng = np.random.default_rng(2)
    samples, cells, which = rng.uniform(size=(5, 3)), rng.uniform(size=(9, 5)), np.array([0, 2, 3, 7, 8])
    sums = [np.zeros((3, 6)) for _ in range(2)]
    module._sum_up(samples, cells, which, sums[0])
    plain(module._sum_up)(samples, cells, which, sums[1])
    assert sums[0] == pytest.approx(sums[1], rel=1e-12)


@pytest.mark.parametrize("height", [0.0, 3.0])
def test_what_is_constant_correlates_with_nothing(height):
    rng = np.random.default_rng(3)
    rasters, cells = rng.uniform(0.1, 1, (9, 8, 2)), rng.uniform(0, 7, (60, 4))
    cells[:, 3] = height
    found, coincidences, n_cells = correlations(rasters, cells, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    assert found.tolist() == coincidences.tolist() == [0.0]
    assert n_cells > 40


def test_places_that_do_not_meet_do_not_correlate():
    found, coincidences, n_cells = correlations(np.ones((4, 4, 2)), np.ones((5, 4)), (0.0, 0.0, 1.0), (50.0, 0.0, 0.0))
    assert found.tolist() == coincidences.tolist() == [0.0]
    assert n_cells == 0


def test_fewer_than_three_cells_that_meet_fix_nothing():
    rasters, cells = np.ones((8, 9, 4)), np.ones((2, 6))
    H, H_common, g = normal_equations(rasters, cells, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 3.0)
    assert not H.any()
    assert not H_common.any()
    assert not g.any()


def test_the_normal_equations_are_their_own_python_function():
    rng = np.random.default_rng(0)
    rasters, cells = rng.uniform(0.1, 1, (7, 6, 4)), rng.uniform(0, 5, (30, 6))
    samples, which = met_of(module._meet, rasters, cells, (0.0, 0.0, 1.0), (0.2, 0.4, 0.3))
    compiled, interpreted = ([np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)] for _ in range(2))
    module._normal_equations(samples, cells, which, 0.3, 3.0, *compiled)
    plain(module._normal_equations)(samples, cells, which, 0.3, 3.0, *interpreted)
    assert compiled[0].any()
    for a, b in zip(compiled, interpreted, strict=True):
        assert a == pytest.approx(b, rel=1e-12)


DESCENT = Descent(n_steps=20, max_step=1.0, max_turn=0.035, still=1e-6, still_turn=1e-8, tuning=30.0, damping=0.2)


def bowl_layers(n=41):
    """Weight, relief and slopes of a wavy floor, and its cells."""
    y, x = np.mgrid[0:n, 0:n].astype(float)
    z = np.sin(x / 4) + np.cos(y / 5 + x / 9)
    slopes = (np.cos(x / 4) / 4 - np.sin(y / 5 + x / 9) / 9, -np.sin(y / 5 + x / 9) / 5)
    rasters = np.stack([np.ones_like(z), z, *slopes], axis=-1)
    inner = np.s_[6:-6, 6:-6]
    return rasters, np.column_stack([a[inner].ravel() for a in (x, y, *np.moveaxis(rasters, -1, 0))])


def test_steps_lead_back_to_where_a_floor_lies_over_itself():
    rasters, cells = bowl_layers()
    end = descend(rasters, cells, (0.0, 0.0, 1.0), (0.8, -0.6, 0.02), DESCENT)
    assert end == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)  # a bilinear floor is a little off between its cells


def test_no_step_is_longer_than_its_limit():
    rasters, cells = bowl_layers()
    one = DESCENT._replace(n_steps=1, max_step=0.1, max_turn=0.001)
    end = descend(rasters, cells, (0.0, 0.0, 1.0), (0.8, -0.6, 0.02), one)
    assert np.hypot(end[0] - 0.8, end[1] + 0.6) <= 0.1 + 1e-12
    assert abs(end[2] - 0.02) <= 0.001 + 1e-12


def test_a_floor_that_fixes_nothing_leaves_the_start():
    rasters, cells = bowl_layers()
    rasters[..., 2:], cells[:, 4:] = 0.0, 0.0
    assert descend(rasters, cells, (0.0, 0.0, 1.0), (0.8, -0.6, 0.02), DESCENT) == (0.8, -0.6, 0.02)


def test_the_descent_is_its_own_python_function():
    rasters, cells = bowl_layers(25)
    ends = [np.array([0.5, -0.3, 0.01]) for _ in range(2)]
    frame = np.array([0.0, 0.0, 1.0])
    module._descend(rasters, cells, frame, ends[0], DESCENT)
    plain(module._descend)(rasters, cells, frame, ends[1], DESCENT)
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
