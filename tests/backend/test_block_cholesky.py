import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backend.block_cholesky import analyse, factorise


def random_matrix(n, joined, rng):
    """A positive definite matrix of 6 x 6 blocks, whole and as its factor wants it."""
    first, second = np.array(joined, dtype=np.int64).reshape(-1, 2).T
    pattern = analyse(n, first, second)
    slots = pattern.slots(first, second)
    whole, diagonal = np.eye(6 * n), np.tile(np.eye(6), (n, 1, 1))
    below = np.zeros((len(pattern.rows), 6, 6))
    for slot, one, other in zip(slots, first, second, strict=True):
        J = rng.normal(size=(6, 12))
        rows = np.concatenate([6 * one + np.arange(6), 6 * other + np.arange(6)])
        square = J.T @ J
        whole[np.ix_(rows, rows)] += square
        diagonal[pattern.place[one]] += square[:6, :6]
        diagonal[pattern.place[other]] += square[6:, 6:]
        below[slot] += square[6:, :6] if pattern.place[other] > pattern.place[one] else square[:6, 6:]
    return pattern, diagonal, below, whole


@st.composite
def joins(draw):
    """A chain with a few more pairs, some of them twice."""
    n = draw(st.integers(2, 12))
    pairs = st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)).filter(lambda pair: pair[0] != pair[1])
    return n, [(k, k + 1) for k in range(n - 1)] + draw(st.lists(pairs, max_size=10))


@settings(max_examples=40, deadline=None)
@given(joins(), st.integers(0, 2**31))
def test_solutions_and_the_inverse_are_those_of_the_whole_matrix(graph, seed):
    n, joined = graph
    rng = np.random.default_rng(seed)
    pattern, diagonal, below, whole = random_matrix(n, joined, rng)
    factor, right, inverse = factorise(pattern, diagonal, below), rng.normal(size=(n, 6)), np.linalg.inv(whole)
    # eigenvalues are one at least: what is solved is no larger than what is given, to rounding
    np.testing.assert_allclose(factor.solve(right).ravel(), inverse @ right.ravel(), atol=1e-10)
    own = np.stack([inverse[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(n)])
    np.testing.assert_allclose(factor.inverse_diagonal(), own, atol=1e-10)


def test_a_chain_is_eliminated_without_any_further_block():
    chain = np.arange(9)
    pattern = analyse(10, chain, chain + 1)
    assert len(pattern.rows) == 9


def test_blocks_that_nothing_joins_are_solved_by_themselves():
    none = np.zeros(0, dtype=np.int64)
    pattern = analyse(3, none, none)
    factor = factorise(pattern, np.tile(2.0 * np.eye(6), (3, 1, 1)), np.zeros((0, 6, 6)))
    np.testing.assert_allclose(factor.solve(np.ones((3, 6))), np.full((3, 6), 0.5), rtol=1e-15)
    np.testing.assert_allclose(factor.inverse_diagonal(), np.tile(0.5 * np.eye(6), (3, 1, 1)), rtol=1e-15)


def test_inputs_are_not_changed():
    pattern, diagonal, below, _ = random_matrix(5, [(0, 1), (1, 2), (2, 3), (3, 4), (0, 4)], np.random.default_rng(0))
    kept, right = (diagonal.copy(), below.copy()), np.ones((5, 6))
    factorise(pattern, diagonal, below).solve(right)
    assert np.array_equal(diagonal, kept[0])
    assert np.array_equal(below, kept[1])
    assert (right == 1.0).all()


@pytest.mark.parametrize("pivot", [0.0, -1.0, np.nan, np.inf])
def test_a_matrix_that_is_not_positive_definite_is_refused(pivot):
    pattern, diagonal, below, _ = random_matrix(3, [(0, 1), (1, 2)], np.random.default_rng(0))
    diagonal[1, 4, 4] = pivot
    with pytest.raises(np.linalg.LinAlgError, match="a matrix of 3 block rows must be positive definite"):
        factorise(pattern, diagonal, below)
