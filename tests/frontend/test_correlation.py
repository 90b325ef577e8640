from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frontend import correlation as module
from frontend.correlation import Shifts, all_shifts, common_size, correlate, spectra


def surface_of(a, wa, b, wb):
    padded = all_shifts(a.shape, b.shape).needs(a.shape, b.shape)
    return alone(correlate(spectra(a[None], wa, padded), spectra(b[None], wb, padded)))


def alone(surface):
    """The surface of the only raster."""
    return replace(surface, correlation=surface.correlation[0])


def by_definition(a, wa, b, wb, dy, dx):
    """Weighted correlation of the cells that coincide when b's first cell lies on a's cell (dy, dx)."""
    pairs = []
    for i in range(b.shape[0]):
        for j in range(b.shape[1]):
            k, m = i + dy, j + dx
            if 0 <= k < a.shape[0] and 0 <= m < a.shape[1]:
                pairs.append((a[k, m], b[i, j], wa[k, m] * wb[i, j]))
    u, v, w = np.array(pairs).T
    return np.sum(w * u * v) / np.sqrt(np.sum(w * u**2) * np.sum(w * v**2)), int(np.count_nonzero(w))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.integers(-3, 6), st.integers(-2, 5))
def test_every_shift_agrees_with_the_definition(seed, dy, dx):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(9, 8)), rng.normal(size=(6, 7))
    wa, wb = rng.uniform(0.2, 1, a.shape) * (rng.uniform(size=a.shape) < 0.8), rng.uniform(0.2, 1, b.shape)
    surface = surface_of(a, wa, b, wb)
    i, j = list(surface.shift_y).index(dy), list(surface.shift_x).index(dx)
    expected, n = by_definition(a, wa, b, wb, dy, dx)
    assert surface.overlap[i, j] == n
    if n > 5:  # single precision: seven digits of the sums, fewer of a difference of few of them
        assert surface.correlation[i, j] == pytest.approx(expected, abs=1e-4)


def test_a_part_is_found_where_it_was_cut_out():
    a = np.random.default_rng(0).normal(size=(40, 50))
    b = a[7:27, 12:42]
    surface = surface_of(a, np.ones_like(a), b, np.ones_like(b))
    i, j = np.unravel_index(np.argmax(np.where(surface.overlap > 300, surface.correlation, -1)), surface.overlap.shape)
    assert (surface.shift_y[i], surface.shift_x[j]) == (7, 12)
    assert surface.correlation[i, j] == pytest.approx(1.0, abs=1e-5)
    assert surface.overlap[i, j] == b.size


def test_cells_without_weight_have_no_influence():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(20, 20)), rng.normal(size=(20, 20))
    weight = np.ones_like(a)
    weight[5:9, 5:9] = 0
    wild = np.where(weight > 0, a, 1e4)
    calm = np.where(weight > 0, a, 0.0)
    ones = np.ones_like(b)
    assert surface_of(wild * (weight > 0), weight, b, ones).correlation == pytest.approx(
        surface_of(calm, weight, b, ones).correlation, abs=1e-5
    )


def test_an_overlap_without_relief_or_without_weight_correlates_as_zero():
    b = np.random.default_rng(0).normal(size=(6, 6))
    ones, zeros = np.ones_like(b), np.zeros_like(b)
    assert not surface_of(zeros, ones, b, ones).correlation.any()
    nothing = surface_of(b, zeros, b, ones)
    assert not nothing.correlation.any()
    assert not nothing.overlap.any()


def test_correlation_is_unchanged_by_scale():
    rng = np.random.default_rng(3)
    a, b, ones = rng.normal(size=(16, 16)), rng.normal(size=(16, 16)), np.ones((16, 16))
    big = surface_of(a, ones, b, ones).overlap > 20
    scaled = surface_of(5 * a, ones, -0.1 * b, ones).correlation
    assert scaled[big] == pytest.approx(-surface_of(a, ones, b, ones).correlation[big], abs=1e-3)


def test_rasters_that_share_a_weight_correlate_as_each_alone():
    rng = np.random.default_rng(7)
    a, b, wa, wb = rng.normal(size=(2, 12, 9)), rng.normal(size=(2, 10, 11)), *rng.uniform(0.2, 1, (2, 12, 11))
    wa, wb = wa[:, :9], wb[:10]
    padded = all_shifts(a.shape[1:], b.shape[1:]).needs(a.shape[1:], b.shape[1:])
    both = correlate(spectra(a, wa, padded), spectra(b, wb, padded))
    for k in (0, 1):
        single = surface_of(a[k], wa, b[k], wb)
        assert both.correlation[k] == pytest.approx(single.correlation, abs=1e-6)  # a rounding in single precision
        assert np.array_equal(both.overlap, single.overlap)


def test_spectra_of_different_numbers_of_rasters_are_refused():
    a = np.ones((4, 4))
    with pytest.raises(ValueError, match="spectra of as many rasters are wanted, got 1 and 2"):
        correlate(spectra(a[None], a, (8, 8)), spectra(np.stack([a, a]), a, (8, 8)))


def test_spectra_of_different_padding_are_refused():
    a = np.ones((4, 4))
    with pytest.raises(ValueError, match=r"padded alike and enough for both, got \(8, 8\) of \(4, 4\) and \(9, 9\)"):
        correlate(spectra(a[None], a, (8, 8)), spectra(a[None], a, (9, 9)))


def test_spectra_that_would_wrap_around_are_refused():
    a = np.ones((4, 4))
    with pytest.raises(ValueError, match="padded alike and enough for both"):
        correlate(spectra(a[None], a, (6, 8)), spectra(a[None], a, (6, 8)))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.integers(-5, 8), st.integers(1, 6), st.integers(-6, 7), st.integers(1, 6))
def test_some_shifts_padded_no_more_than_they_need_correlate_as_among_all(seed, first_y, n_y, first_x, n_x):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(9, 8)), rng.normal(size=(6, 7))
    wa, wb = rng.uniform(0.2, 1, a.shape), rng.uniform(0.2, 1, b.shape)
    shifts = Shifts(first_y, first_y + n_y, first_x, first_x + n_x).within(a.shape, b.shape)
    padded = shifts.needs(a.shape, b.shape)
    some = alone(correlate(spectra(a[None], wa, padded), spectra(b[None], wb, padded), shifts))
    every = surface_of(a, wa, b, wb)
    at = np.ix_(some.shift_y + b.shape[0] - 1, some.shift_x + b.shape[1] - 1)
    assert np.array_equal(some.overlap, every.overlap[at])
    many = some.overlap > 5
    assert some.correlation[many] == pytest.approx(every.correlation[at][many], abs=1e-3)


def test_shifts_at_which_nothing_meets_are_left_out():
    assert Shifts(-50, 50, 3, 4).within((9, 8), (6, 7)) == Shifts(-5, 9, 3, 4)
    none = Shifts(20, 30, -40, -30).within((9, 8), (6, 7))
    assert none.end_y <= none.first_y
    assert none.end_x <= none.first_x


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 5000))
def test_common_sizes_are_few_and_little_larger(n):
    size = common_size(n)
    assert n <= size <= max(1.25 * n, 8)
    assert len({common_size(m) for m in range(n, 2 * n)}) <= 7


def test_the_coefficients_are_their_own_python_function():
    rng = np.random.default_rng(0)
    sums, x = rng.uniform(0.1, 1, (4, 3, 6)).astype(np.float32), np.array([-2, -1, 0, 1])
    sums[2, 1, 0] = 0.0
    both = [(np.zeros((1, 3, 4)), np.empty((3, 4))) for _ in range(2)]
    module._coefficients(sums, x, *both[0])
    getattr(module._coefficients, "py_func", module._coefficients)(sums, x, *both[1])
    assert both[0][0] == pytest.approx(both[1][0], rel=1e-6)  # in single precision
    assert both[0][1].tolist() == both[1][1].tolist()
    assert np.flatnonzero(both[0][0] == 0).tolist() == [6]  # shift 0 in the second row: a sum of squares is 0


def test_no_shifts_give_no_correlations():
    a = np.ones((8, 8))
    whole = spectra(a[None], a, (8, 8))
    assert correlate(whole, whole, Shifts(0, 0, 0, 0)).correlation.shape == (1, 0, 0)
