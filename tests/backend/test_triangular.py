import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backend.triangular import factorise, inverse, without_rows

SIZES = st.tuples(st.integers(1, 40), st.integers(0, 9), st.integers(0, 2**32 - 1))


def made(n, m, seed):
    """A covariance of n whose condition is about a thousand, and m rows."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    return root @ root.T / n + 1e-2 * np.eye(n), rng.normal(size=(m, n))


def test_three_four_five():
    factor, whitened = factorise(np.array([[9.0, 12.0], [12.0, 41.0]]), np.array([[3.0, 4.0]]))
    np.testing.assert_allclose(factor, [[3.0, 0.0], [4.0, 5.0]], rtol=1e-15)
    np.testing.assert_allclose(whitened, [[1.0, 0.0]], atol=1e-15)


@settings(max_examples=60, deadline=None)
@given(SIZES)
def test_factor_and_whitened_rows_are_those_of_lapack(sizes):
    covariance, rows = made(*sizes)
    factor, whitened = factorise(covariance, rows)
    judge = np.linalg.cholesky(covariance)
    np.testing.assert_allclose(factor, judge, atol=1e-11)  # a thousand times the condition times rounding
    np.testing.assert_allclose(whitened, np.linalg.solve(judge, rows.T).T, atol=1e-10)


@settings(max_examples=40, deadline=None)
@given(SIZES)
def test_the_inverse_is_that_of_lapack_and_symmetric(sizes):
    covariance, _ = made(*sizes)
    information = inverse(covariance)
    np.testing.assert_allclose(information, np.linalg.inv(covariance), atol=1e-8)
    assert np.array_equal(information, information.T)


@settings(max_examples=20, deadline=None)
@given(SIZES)
def test_outer_products_are_taken_off(sizes):
    covariance, rows = made(*sizes)
    np.testing.assert_allclose(without_rows(covariance, rows.T), covariance - rows.T @ rows, atol=1e-12)


@pytest.mark.parametrize("n", [1, 4, 5, 11])
@pytest.mark.parametrize("wrong", [-1.0, 0.0, np.nan])
@pytest.mark.parametrize("at", [0, -1])
def test_what_is_no_covariance_is_refused(n, wrong, at):
    covariance, rows = made(n, 2, 0)
    covariance[at, :] = covariance[:, at] = 0.0
    covariance[at, at] = wrong
    with pytest.raises(np.linalg.LinAlgError, match=rf"a covariance of {n} rows must be positive definite"):
        factorise(covariance, rows)


def test_what_was_given_is_not_changed():
    covariance, rows = made(9, 3, 1)
    before = covariance.copy(), rows.copy()
    factorise(covariance, rows)
    inverse(covariance)
    without_rows(covariance, rows.T)
    assert np.array_equal(covariance, before[0])
    assert np.array_equal(rows, before[1])
