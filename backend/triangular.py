"""Linear algebra of joint covariances on one thread: a library's threads cost a busy machine more than they save.

And the same sums are taken in the same order on any number of threads.
"""

import numpy as np
from numba import njit

from backend.arrays import FloatArray


def factorise(covariance: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cholesky's factor of a covariance, and rows whitened by it.

    Parameters
    ----------
    covariance : ndarray, shape (n, n)
        Symmetric and positive definite; only its lower triangle is read.
    rows : ndarray, shape (m, n)
        Rows ``r`` of what is to be whitened.

    Returns
    -------
    factor : ndarray, shape (n, n)
        Lower triangle ``L`` with ``L @ L.T`` the covariance, zero above.
    whitened : ndarray, shape (m, n)
        Rows ``r @ inv(L).T``: the covariance of each with another is their inner product.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the covariance is not positive definite.
    """
    n = len(covariance)
    tall: FloatArray = np.concatenate([covariance, rows])
    _factorise(tall)
    if not (np.diag(tall) > 0.0).all():  # nor where it is no number
        raise np.linalg.LinAlgError(f"a covariance of {n} rows must be positive definite")
    return np.tril(tall[:n]), tall[n:]


def inverse(covariance: FloatArray) -> FloatArray:
    """Inverse of a covariance.

    Parameters
    ----------
    covariance : ndarray, shape (n, n)
        Symmetric and positive definite.

    Returns
    -------
    information : ndarray, shape (n, n)
        Its inverse, exactly symmetric.
    """
    _, whitened = factorise(covariance, np.eye(len(covariance)))
    information = np.empty_like(whitened)
    _inner_products(whitened, information)
    return information


def without_rows(information: FloatArray, rows: FloatArray) -> FloatArray:
    """Take outer products of rows from an information matrix.

    Parameters
    ----------
    information : ndarray, shape (n, n)
        Symmetric.
    rows : ndarray, shape (n, k)
        What its rows have in common with what is left out.

    Returns
    -------
    rest : ndarray, shape (n, n)
        ``information - rows @ rows.T``.
    """
    products = np.empty_like(information)
    _inner_products(np.ascontiguousarray(rows), products)
    return information - products


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})  # type: ignore[untyped-decorator]
def _factorise(a: FloatArray) -> None:
    """In place, four rows at a time, so that what they share is read once."""
    m, n = a.shape
    for start in range(0, m, 4):
        stop = min(start + 4, m)
        if stop - start == 4:
            for j in range(min(start, n)):
                s0 = s1 = s2 = s3 = 0.0
                for k in range(j):
                    shared = a[j, k]
                    s0 += a[start, k] * shared
                    s1 += a[start + 1, k] * shared
                    s2 += a[start + 2, k] * shared
                    s3 += a[start + 3, k] * shared
                a[start, j] = (a[start, j] - s0) / a[j, j]
                a[start + 1, j] = (a[start + 1, j] - s1) / a[j, j]
                a[start + 2, j] = (a[start + 2, j] - s2) / a[j, j]
                a[start + 3, j] = (a[start + 3, j] - s3) / a[j, j]
        for i in range(start, stop):
            for j in range(start if stop - start == 4 else 0, min(i + 1, n)):
                s = a[i, j]
                for k in range(j):
                    s -= a[i, k] * a[j, k]
                a[i, j] = np.sqrt(s) if i == j else s / a[j, j]


@njit(cache=True, fastmath={"reassoc", "contract"})  # type: ignore[untyped-decorator]
def _inner_products(rows: FloatArray, products: FloatArray) -> None:
    """Of each row with each other."""
    for i in range(len(rows)):
        for j in range(i + 1):
            s = 0.0
            for k in range(rows.shape[1]):
                s += rows[i, k] * rows[j, k]
            products[i, j] = products[j, i] = s
