"""Footprints: what all cells at one distance from the track have in common is the sonar's mark, not the floor's."""

import numba
import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import median

from frontend.arrays import FloatArray, IntArray
from frontend.submaps import Submap

_MARKED = 3.0  # times the usual square: where a strip's median is larger, a floor of one kind hardly is the cause
_DAMPING = 1e-9  # of the largest diagonal, so that a node without cells stays at 0


def distance_from_track(submap: Submap) -> FloatArray:
    """Signed distance of a submap's cells from its track.

    Parameters
    ----------
    submap : Submap
        With the track of its window.

    Returns
    -------
    distance : ndarray, shape (n_y, n_x)
        Athwart the course at the nearest ping, in the plane, positive to port [m]; NaN throughout without a track of at
        least two pings.
    """
    track = submap.track[:, :2]
    if len(track) < 2:
        return np.full(submap.surface.z.shape, np.nan)
    course = np.gradient(track, axis=0)
    course /= np.maximum(np.hypot(*course.T), 1e-9)[:, None]
    distance = np.empty(submap.surface.z.shape)
    _athwart(submap.surface.x, submap.surface.y, track, course, distance)
    return distance


def without_profile(values: FloatArray, weight: FloatArray, distance: FloatArray, step: float) -> FloatArray:
    """Take from a raster what all cells at one distance from the track have in common.

    Parameters
    ----------
    values, weight : ndarray, shape (n_y, n_x)
        A raster and the trust in its cells [1].
    distance : ndarray, shape (n_y, n_x)
        Signed distance from the track [m]; values stay where it is NaN.
    step : float
        Between the profile's nodes [m].

    Returns
    -------
    rest : ndarray, shape (n_y, n_x)
        The raster less its mean at each distance, a broken line by weighted least squares.

    Notes
    -----
    A beam pattern or a scattering law that is a little wrong raises ridges along the track, the same on every pass and
    in every turn: two passes along one line agree by them wherever they were.
    """
    used = np.isfinite(distance) & (weight > 0)
    if not used.any():
        return values
    node, share = _nodes(distance[used], step)
    profile = _fit(node, share, values[used], weight[used])
    rest = values.copy()
    rest[used] -= (1 - share) * profile[node] + share * profile[node + 1]
    return rest


def evenness(values: FloatArray, weight: FloatArray, distance: FloatArray, step: float) -> FloatArray:
    """How little more than elsewhere a raster varies at its distance from the track.

    Parameters
    ----------
    values, weight, distance : ndarray, shape (n_y, n_x)
        As in `without_profile`.
    step : float
        Width of the strips along the track [m].

    Returns
    -------
    evenness : ndarray, shape (n_y, n_x)
        In [0, 1]: the square of three times the median square of the whole over that of the strip, where that is less
        than 1. A boulder fills no strip; a mark of the sonar does.
    """
    used = np.isfinite(distance) & (weight > 0)
    if not used.any():
        return np.ones_like(values)
    strip = np.floor(distance[used] / step).astype(np.int64)
    square = values[used] ** 2
    usual = float(np.median(square))
    numbers, place = np.unique(strip, return_inverse=True)
    of_strip = np.asarray(median(square, strip, numbers))
    even = np.ones_like(values)
    even[used] = (np.minimum(_MARKED * usual / np.maximum(of_strip, 1e-30), 1.0) ** 2)[place]
    return even


def _nodes(distance: FloatArray, step: float) -> tuple[IntArray, FloatArray]:
    """The node below each distance, counted from the least, and the share of the one above."""
    place = distance / step
    below = np.floor(place)
    return (below - below.min()).astype(np.int64), np.asarray(place - below)


def _fit(node: IntArray, share: FloatArray, values: FloatArray, weight: FloatArray) -> FloatArray:
    """Heights of the broken line at its nodes by weighted least squares, 0 where nothing lies near a node."""
    n = int(node.max()) + 2
    below, above = weight * (1 - share), weight * share

    def onto(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(node, a, n) + np.bincount(node + 1, b, n))

    diagonal = onto(below * (1 - share), above * share)
    beside = np.bincount(node + 1, below * share, n)
    damped = diagonal + _DAMPING * max(float(diagonal.max()), 1e-30)
    return np.asarray(solveh_banded(np.stack([beside, damped]), onto(below * values, above * values)))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _athwart(x: FloatArray, y: FloatArray, track: FloatArray, course: FloatArray, distance: FloatArray) -> None:
    """Distance to port of the course at the ping nearest to each cell, the first of equals."""
    least, nearest = np.empty(len(x)), np.zeros(len(x), dtype=np.int64)
    for i in range(len(y)):
        least[:] = np.inf
        for p in range(len(track)):
            along_y = (track[p, 1] - y[i]) ** 2
            for j in range(len(x)):
                squared = (track[p, 0] - x[j]) ** 2 + along_y
                nearest[j] = p if squared < least[j] else nearest[j]
                least[j] = min(squared, least[j])
        for j, k in enumerate(nearest):
            distance[i, j] = course[k, 0] * (y[i] - track[k, 1]) - course[k, 1] * (x[j] - track[k, 0])
