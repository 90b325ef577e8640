"""Kernels of rigid transforms: how poses move, how they differ, and the derivative of that; rotation first."""

import numpy as np
from numba import njit

from backend.arrays import FloatArray, IntArray


@njit(cache=True)  # type: ignore[untyped-decorator]
def moved(T: FloatArray, delta: FloatArray) -> FloatArray:
    """Poses after motions along their own axes, ``T Exp(delta)``."""
    there, rotation, left = T.copy(), np.empty((3, 3)), np.empty((3, 3))
    for s in range(len(T)):
        w, v = delta[s, :3], delta[s, 3:]
        angle = np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
        small = angle < 1e-4  # below, the series are exact to rounding
        a = 1.0 - angle**2 / 6.0 if small else np.sin(angle) / angle
        b = 0.5 - angle**2 / 24.0 if small else (1.0 - np.cos(angle)) / angle**2
        c = 1.0 / 6.0 - angle**2 / 120.0 if small else (angle - np.sin(angle)) / angle**3
        _series(w, a, b, rotation)
        _series(w, b, c, left)
        for i in range(3):
            for k in range(3):
                there[s, i, k] = T[s, i, 0] * rotation[0, k] + T[s, i, 1] * rotation[1, k] + T[s, i, 2] * rotation[2, k]
                there[s, i, 3] += T[s, i, k] * (left[k, 0] * v[0] + left[k, 1] * v[1] + left[k, 2] * v[2])
    return there


@njit(cache=True)  # type: ignore[untyped-decorator]
def _series(w: FloatArray, a: float, b: float, matrix: FloatArray) -> None:
    """``I + a [w]x + b [w]x**2``."""
    square = w[0] ** 2 + w[1] ** 2 + w[2] ** 2
    for i in range(3):
        for k in range(3):
            matrix[i, k] = b * w[i] * w[k]
        matrix[i, i] += 1.0 - b * square
        matrix[i, (i + 1) % 3] -= a * w[(i + 2) % 3]
        matrix[i, (i + 2) % 3] += a * w[(i + 1) % 3]


@njit(cache=True)  # type: ignore[untyped-decorator]
def see(T: FloatArray, ends: IntArray, seen: FloatArray) -> None:
    """The source's pose seen from the target, or from the world."""
    source = T[ends[1]]
    if ends[0] < 0:
        seen[:] = source
    else:
        _between(T[ends[0]], source, seen)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _between(one: FloatArray, other: FloatArray, relative: FloatArray) -> None:
    """``one**-1 other``."""
    for i in range(3):
        for k in range(4):
            relative[i, k] = 0.0
            for m in range(3):
                relative[i, k] += one[m, i] * (other[m, k] - (one[m, 3] if k == 3 else 0.0))


@njit(cache=True)  # type: ignore[untyped-decorator]
def residual(measured: FloatArray, seen: FloatArray, error: FloatArray) -> None:
    """``Log(measured**-1 seen)``, rotation first."""
    E = np.empty((4, 4))
    _between(measured, seen, E)
    _rotation_vector(E, error)
    w, t = error[:3], E[:3, 3]
    angle = np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
    c = 1.0 / 12.0 + angle**2 / 720.0
    if angle > 1e-4:
        c = (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    inverse = np.empty((3, 3))
    _series(w, -0.5, c, inverse)
    for i in range(3):
        error[3 + i] = inverse[i, 0] * t[0] + inverse[i, 1] * t[1] + inverse[i, 2] * t[2]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _rotation_vector(T: FloatArray, vector: FloatArray) -> None:
    """Of a rotation, by its quaternion, the largest part of it first; exact at small angles and at half a turn."""
    trace = T[0, 0] + T[1, 1] + T[2, 2]
    quaternion = np.empty(4)
    best, largest = 3, trace
    for i in range(3):
        if T[i, i] > largest:
            best, largest = i, T[i, i]
    if best == 3:
        quaternion[3] = 1.0 + trace
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            quaternion[i] = T[k, j] - T[j, k]
    else:
        i, j, k = best, (best + 1) % 3, (best + 2) % 3
        quaternion[i] = 1.0 - trace + 2.0 * T[i, i]
        quaternion[j], quaternion[k] = T[j, i] + T[i, j], T[k, i] + T[i, k]
        quaternion[3] = T[k, j] - T[j, k]
    if quaternion[3] < 0.0:
        quaternion *= -1.0
    sine = np.sqrt(quaternion[0] ** 2 + quaternion[1] ** 2 + quaternion[2] ** 2)
    factor = 2.0 / quaternion[3]
    if sine > 1e-12 * quaternion[3]:
        factor = 2.0 * np.arctan2(sine, quaternion[3]) / sine
    vector[:3] = factor * quaternion[:3]


@njit(cache=True)  # type: ignore[untyped-decorator]
def inverse_jacobian(xi: FloatArray, inverse: FloatArray) -> None:
    """How ``Log(E Exp(delta))`` moves with delta where ``Log(E)`` is xi: ``I + ad/2 + c2 ad**2 + c4 ad**4``."""
    ad, square = np.zeros((6, 6)), np.zeros((6, 6))
    for block in range(2):
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            ad[3 * block + i, 3 * block + a], ad[3 * block + i, 3 * block + b] = -xi[b], xi[a]
            ad[3 + i, a], ad[3 + i, b] = -xi[3 + b], xi[3 + a]
    angle = np.sqrt(xi[0] ** 2 + xi[1] ** 2 + xi[2] ** 2)
    c2, c4 = 1.0 / 12.0, -1.0 / 720.0
    if angle > 0.05:  # below, the next term is 1e-10 of the first
        sin, cos = np.sin(angle), np.cos(angle) - 1.0
        c2 = 2.0 / angle**2 + (angle + 3.0 * sin) / (4.0 * angle * cos)
        c4 = 1.0 / angle**4 + (angle + sin) / (4.0 * angle**3 * cos)
    for i in range(6):
        for k in range(6):
            for m in range(6):
                square[i, k] += ad[i, m] * ad[m, k]
    for i in range(6):
        for k in range(6):
            fourth = 0.0
            for m in range(6):
                fourth += square[i, m] * square[m, k]
            inverse[i, k] = 0.5 * ad[i, k] + c2 * square[i, k] + c4 * fourth + (1.0 if i == k else 0.0)
