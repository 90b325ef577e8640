"""Kernels of least squares over poses: squares, and what they add to the normal equations.

Relative poses come as ``(ends, measured, roots, weights)``: anchors (R, 2), the first of them -1 where it is the world;
poses (R, 4, 4); square roots of information (R, 6, 6); weights (R,). What is known of single anchors comes as
``(anchor, position, precision, anchor, up, precision)``, first of positions, then of tilts.
"""

import numpy as np
from numba import njit

from backend.arrays import FloatArray, IntArray
from backend.pose_kernels import inverse_jacobian, residual, see

Relative = tuple[IntArray, FloatArray, FloatArray, FloatArray]
Unary = tuple[IntArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray]
Places = tuple[IntArray, IntArray]
Sums = tuple[FloatArray, FloatArray, FloatArray]


@njit(cache=True)  # type: ignore[untyped-decorator]
def squared_residuals(T: FloatArray, relative: Relative) -> FloatArray:
    """Square of each whitened residual of a relative pose, whatever its weight."""
    ends, measured, roots, _ = relative
    squares, seen, error, white = np.empty(len(ends)), np.empty((4, 4)), np.empty(6), np.empty(6)
    for r in range(len(ends)):
        see(T, ends[r], seen)
        residual(measured[r], seen, error)
        _multiply(roots[r], error, white)
        squares[r] = (white**2).sum()
    return squares


@njit(cache=True)  # type: ignore[untyped-decorator]
def squared_unaries(T: FloatArray, unary: Unary) -> float:
    """Sum of the squares that single anchors have."""
    place_anchor, position, precision, tilt_anchor, up, tilt_precision = unary
    total = 0.0
    for p in range(len(place_anchor)):
        for i in range(3):
            total += precision[p, i] * (T[place_anchor[p], i, 3] - position[p, i]) ** 2
    for q in range(len(tilt_anchor)):
        R = T[tilt_anchor[q]]
        for i in range(2):
            total += tilt_precision[q] * (R[i, 0] * up[q, 0] + R[i, 1] * up[q, 1] + R[i, 2] * up[q, 2]) ** 2
    return total


@njit(cache=True)  # type: ignore[untyped-decorator]
def add_relative(T: FloatArray, relative: Relative, places: Places, sums: Sums) -> None:
    """Add relative poses to the normal equations, in place: diagonal by anchor, below by slot, gradient by anchor."""
    ends, measured, roots, weights = relative
    slots, place = places
    diagonal, below, gradient = sums
    seen, error, white = np.empty((4, 4)), np.empty(6), np.empty(6)
    by_source, by_target = np.empty((6, 6)), np.empty((6, 6))
    for r in range(len(ends)):
        if weights[r] == 0.0:
            continue
        target, source = ends[r]
        see(T, ends[r], seen)
        residual(measured[r], seen, error)
        _multiply(roots[r], error, white)
        _derivatives(error, roots[r], seen, (by_source, by_target))
        _add_square(by_source, white, weights[r], diagonal[source], gradient[source])
        if target >= 0:
            _add_square(by_target, white, weights[r], diagonal[target], gradient[target])
            if place[target] > place[source]:
                _add_product(by_target, by_source, weights[r], below[slots[r]])
            else:
                _add_product(by_source, by_target, weights[r], below[slots[r]])


@njit(cache=True)  # type: ignore[untyped-decorator]
def add_border(T: FloatArray, relative: Relative, slopes: FloatArray, sums: Sums) -> None:
    """Add numbers that move whitened residuals by slopes (R, 6, K): border by anchor, their information, gradient."""
    ends, measured, roots, weights = relative
    border, information, gradient = sums
    seen, error, white = np.empty((4, 4)), np.empty(6), np.empty(6)
    by_source, by_target = np.empty((6, 6)), np.empty((6, 6))
    for r in range(len(slopes)):
        target, source = ends[r]
        see(T, ends[r], seen)
        residual(measured[r], seen, error)
        _multiply(roots[r], error, white)
        _derivatives(error, roots[r], seen, (by_source, by_target))
        gradient += weights[r] * (slopes[r].T @ white)
        information += weights[r] * (slopes[r].T @ slopes[r])
        border[source] += weights[r] * (by_source.T @ slopes[r])
        if target >= 0:
            border[target] += weights[r] * (by_target.T @ slopes[r])


@njit(cache=True)  # type: ignore[untyped-decorator]
def add_unaries(T: FloatArray, unary: Unary, diagonal: FloatArray, gradient: FloatArray) -> None:
    """Add what is known of single anchors to the normal equations, in place."""
    place_anchor, position, precision, tilt_anchor, up, tilt_precision = unary
    slope = np.zeros(6)
    for p in range(len(place_anchor)):
        anchor = place_anchor[p]
        slope[:3] = 0.0
        for i in range(3):  # a shift along the body's axes moves the position by the rotation's columns
            slope[3:] = T[anchor, i, :3]
            error = T[anchor, i, 3] - position[p, i]
            _add_row(slope, error, precision[p, i], diagonal[anchor], gradient[anchor])
    for q in range(len(tilt_anchor)):
        anchor, u = tilt_anchor[q], up[q]
        slope[3:] = 0.0
        for i in range(2):  # row i of -R [u]x
            R = T[anchor, i]
            slope[0], slope[1], slope[2] = (
                R[2] * u[1] - R[1] * u[2],
                R[0] * u[2] - R[2] * u[0],
                R[1] * u[0] - R[0] * u[1],
            )
            error = R[0] * u[0] + R[1] * u[1] + R[2] * u[2]
            _add_row(slope, error, tilt_precision[q], diagonal[anchor], gradient[anchor])


@njit(cache=True)  # type: ignore[untyped-decorator]
def _derivatives(
    error: FloatArray, root: FloatArray, seen: FloatArray, derivatives: tuple[FloatArray, FloatArray]
) -> None:
    """Of the whitened residual by the motions of the source and of the target, in place."""
    by_source, by_target = derivatives
    inverse = np.empty((6, 6))
    inverse_jacobian(error, inverse)
    for i in range(6):
        for k in range(6):
            s = 0.0
            for m in range(6):
                s += root[i, m] * inverse[m, k]
            by_source[i, k] = s
    # by the target: less that by the source times Ad(seen**-1), whose blocks are R.T, 0, -R.T [t]x and R.T
    for i in range(6):
        turned, lever = by_source[i, :3], by_source[i, 3:]
        for k in range(3):
            by_target[i, 3 + k] = -(lever[0] * seen[k, 0] + lever[1] * seen[k, 1] + lever[2] * seen[k, 2])
        for k in range(3):
            a, b = (k + 1) % 3, (k + 2) % 3
            by_target[i, k] = -(turned[0] * seen[k, 0] + turned[1] * seen[k, 1] + turned[2] * seen[k, 2])
            by_target[i, k] += seen[a, 3] * by_target[i, 3 + b] - seen[b, 3] * by_target[i, 3 + a]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _multiply(matrix: FloatArray, vector: FloatArray, product: FloatArray) -> None:
    """A matrix of six rows times a vector."""
    for i in range(6):
        s = 0.0
        for k in range(6):
            s += matrix[i, k] * vector[k]
        product[i] = s


@njit(cache=True)  # type: ignore[untyped-decorator]
def _add_square(slope: FloatArray, white: FloatArray, weight: float, block: FloatArray, gradient: FloatArray) -> None:
    """Add the square of a residual to a block on the diagonal and to the gradient."""
    _add_product(slope, slope, weight, block)
    for k in range(6):
        s = 0.0
        for m in range(6):
            s += slope[m, k] * white[m]
        gradient[k] += weight * s


@njit(cache=True)  # type: ignore[untyped-decorator]
def _add_product(one: FloatArray, other: FloatArray, weight: float, block: FloatArray) -> None:
    """Add ``weight one.T other`` to a block."""
    for m in range(6):
        for i in range(6):
            scaled = weight * one[m, i]
            for k in range(6):
                block[i, k] += scaled * other[m, k]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _add_row(slope: FloatArray, error: float, precision: float, block: FloatArray, gradient: FloatArray) -> None:
    """Add the square of one number to a block on the diagonal and to the gradient."""
    for i in range(6):
        scaled = precision * slope[i]
        gradient[i] += scaled * error
        for k in range(6):
            block[i, k] += scaled * slope[k]
