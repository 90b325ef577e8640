"""The rigid motion that lays one set of points on another."""

import numpy as np

from frontend.arrays import FloatArray


def rigid_alignment(points: FloatArray, points_ref: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least-squares rotation and shift, without scale.

    Parameters
    ----------
    points, points_ref : ndarray, shape (N, d)
        Points that belong together, in two or three dimensions [m].

    Returns
    -------
    rotation : ndarray, shape (d, d)
        A proper rotation.
    translation : ndarray, shape (d,)
        So that ``points @ rotation.T + translation`` is closest to ``points_ref`` [m].

    References
    ----------
    .. [1] Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
       IEEE PAMI 13(4):376-380, 1991. :doi:`10.1109/34.88573`
    """
    mean, mean_ref = points.mean(axis=0), points_ref.mean(axis=0)
    covariance = (points_ref - mean_ref).T @ (points - mean) / len(points)  # Umeyama 1991 eq. 38
    U, _, Vt = np.linalg.svd(covariance)
    signs = np.ones(points.shape[1])
    signs[-1] = np.sign(np.linalg.det(U) * np.linalg.det(Vt))  # eq. 43: a rotation, no mirror
    rotation = U * signs @ Vt  # eq. 40
    return rotation, mean_ref - rotation @ mean  # eq. 41


def aligned(points: FloatArray, points_ref: FloatArray) -> FloatArray:
    """Points after the rigid motion that brings them closest to others.

    Parameters
    ----------
    points, points_ref : ndarray, shape (N, d)
        Points that belong together [m].

    Returns
    -------
    moved : ndarray, shape (N, d)
        The first set, moved [m].
    """
    rotation, translation = rigid_alignment(points, points_ref)
    return np.asarray(points @ rotation.T + translation)
