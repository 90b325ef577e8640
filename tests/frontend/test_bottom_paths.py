"""Paths through evidence: against all paths there are, and on edges made by hand."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from frontend.bottom_paths import best_path, contrast, evidence, first_samples

TENTHS = st.integers(-10, 10).map(lambda k: k / 10)


def worth(evidence: np.ndarray, path: np.ndarray, cost: float) -> float:
    return float(evidence[np.arange(len(path)), path].sum() - cost * np.abs(np.diff(path)).sum())


@given(arrays(float, (4, 5), elements=TENTHS), st.sampled_from([0.0, 0.1, 0.5]))
def test_no_path_is_better_than_the_best(values: np.ndarray, cost: float) -> None:
    every = max(worth(values, np.array(path), cost) for path in product(range(5), repeat=4))
    assert worth(values, best_path(values, cost), cost) == pytest.approx(every, abs=1e-9)


@given(arrays(float, (4, 4), elements=TENTHS), st.lists(st.integers(0, 2), min_size=4, max_size=4))
def test_no_sample_is_better_than_the_first_samples(level: np.ndarray, start: list[int]) -> None:
    first = np.array(start)
    threshold = np.tile([0.0, 0.5], (4, 1))
    found, _ = first_samples(level, threshold, first, 0.7)
    vote = np.clip(-level / 0.5, -1, 1)
    vote[level.min(axis=1) == level.max(axis=1)] = 0
    score = np.concatenate([np.zeros((4, 1)), np.cumsum(vote, axis=1)], axis=1)

    def total(path: np.ndarray) -> float:
        return float(score[np.arange(4), path - first].sum() - 0.7 * np.abs(np.diff(path)).sum())

    every = max(total(first + np.array(offset)) for offset in product(range(5), repeat=4))
    assert total(found) == pytest.approx(every, abs=1e-9)


def test_an_edge_has_the_greatest_contrast_where_it_is() -> None:
    level = np.where(np.arange(40) < 17, 0.0, 5.0) + np.random.default_rng(1).normal(0, 0.3, (6, 40))
    z = contrast(level, 4)
    np.testing.assert_array_equal(z.argmax(axis=1), 17)


def test_what_is_thin_has_no_contrast() -> None:
    level = np.random.default_rng(2).normal(0, 0.3, (50, 60))
    level[:, 20:24] += 5.0
    assert np.median(contrast(level, 4)[:, 16:24].max(axis=1)) < 1.5


def test_cells_without_samples_have_no_contrast() -> None:
    level = np.random.default_rng(3).normal(0, 0.3, (5, 60))
    level[:, 30] = np.nan
    z = contrast(level, 4)
    assert (z[:, 19:35] == 0).all()  # four cells before it and three times four after it
    assert (z[:, 12:19] != 0).all()


def test_lines_too_short_or_empty_have_no_contrast() -> None:
    assert (contrast(np.ones((3, 8)), 4) == 0).all()
    assert (contrast(np.full((3, 60), np.nan), 4) == 0).all()


def test_the_first_of_two_equal_edges_counts() -> None:
    z = np.zeros((1, 60))
    z[0, [15, 40]] = 20.0
    proof = evidence(z, np.ones(z.shape, dtype=bool), 4)
    assert proof[0, 15] == 1.0
    assert proof[0, 40] < 0.5
    elsewhere = evidence(z, np.arange(60)[None, :] > 20, 4)
    assert elsewhere[0, 40] == 1.0
    assert elsewhere[0, 15] == -1.0
