"""FPFH: histograms of how the normals around a point of a heightfield turn, whatever way it is looked at."""

import numba
import numpy as np

from frontend.arrays import BoolArray, FloatArray, IntArray

_N_OF_AN_ANGLE = 11  # bins
N_BINS = 3 * _N_OF_AN_ANGLE


def fast_point_feature_histograms(
    z: FloatArray, normals: FloatArray, is_chosen: BoolArray, spacing: float, radius: float
) -> FloatArray:
    """Describe some points of a heightfield by the shape around them.

    Parameters
    ----------
    z : ndarray, shape (n_y, n_x)
        Heights [m]; NaN where a cell takes no part.
    normals : ndarray, shape (n_y, n_x, 3)
        Unit normals.
    is_chosen : ndarray of bool, shape (n_y, n_x)
        The cells to describe, of those that take part.
    spacing : float
        Distance between cells [m].
    radius : float
        Of the neighbourhood, in space [m].

    Returns
    -------
    descriptors : ndarray, shape (K, 33)
        One a chosen cell in the order of the raster's rows: three angles of 11 bins that sum to 200 each [1]; less for
        a point that has no neighbours or whose neighbours have none.

    Notes
    -----
    As in [1]_, and as Open3D counts: the histogram of a point's own pairs, and those of its neighbours weighted by the
    inverse of the squared distance, each brought to a sum of 100. Neighbours are looked for on the raster.

    References
    ----------
    .. [1] Rusu, Blodow, Beetz, "Fast Point Feature Histograms (FPFH) for 3D Registration", ICRA 2009.
       :doi:`10.1109/ROBOT.2009.5152473`
    """
    takes_part = np.isfinite(z)
    cells = np.column_stack(np.nonzero(takes_part))
    number = np.full(z.shape, -1, dtype=np.int64)
    number[takes_part] = np.arange(len(cells))
    points = np.column_stack([spacing * cells[:, 1], spacing * cells[:, 0], z[takes_part]])
    around = (cells, number, points, np.array([radius, int(radius / spacing) + 1]))
    own = np.zeros((len(cells), N_BINS))
    _count_pairs(*around, np.ascontiguousarray(normals[takes_part]), own)
    chosen = number[is_chosen & takes_part]
    descriptors = np.zeros((len(chosen), N_BINS))
    _blend(*around, chosen, own, descriptors)
    return descriptors


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _count_pairs(
    cells: IntArray, number: IntArray, points: FloatArray, reach: FloatArray, normals: FloatArray, own: FloatArray
) -> None:
    """Histograms of each point's pairs with its neighbours, looked at once for both; each angle's sums to 100."""
    n_cells = int(reach[1])
    for p in range(len(cells)):
        i, j = cells[p, 0], cells[p, 1]
        for k in range(i, min(i + n_cells + 1, number.shape[0])):
            for m in range(max(j - n_cells, 0), min(j + n_cells + 1, number.shape[1])):
                q = number[k, m]
                if q <= p or _squared_distance(points, p, q) >= reach[0] ** 2:
                    continue
                turn, tilt, along, is_even = _bins(points, normals, p, q)
                for point in (p, q):
                    own[point, turn] += 1.0
                    own[point, tilt] += 1.0
                    own[point, along] += 1.0
                    if is_even:  # neither normal is nearer to the line: counted from each, in its own histogram
                        turn, tilt, along, _ = _bins(points, normals, q, p)
    for p in range(len(cells)):
        n = own[p, :_N_OF_AN_ANGLE].sum()
        if n > 0:
            own[p] *= 100.0 / n


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _blend(
    cells: IntArray,
    number: IntArray,
    points: FloatArray,
    reach: FloatArray,
    chosen: IntArray,
    own: FloatArray,
    out: FloatArray,
) -> None:
    """Own histograms and those of the neighbours, the nearer the more; each angle's of these sums to 100."""
    n_cells = int(reach[1])
    for c, p in enumerate(chosen):
        i, j = cells[p, 0], cells[p, 1]
        for k in range(max(i - n_cells, 0), min(i + n_cells + 1, number.shape[0])):
            for m in range(max(j - n_cells, 0), min(j + n_cells + 1, number.shape[1])):
                q = number[k, m]
                if q < 0 or q == p:
                    continue
                squared = _squared_distance(points, p, q)
                if squared < reach[0] ** 2:
                    for b in range(own.shape[1]):
                        out[c, b] += own[q, b] / squared
        for first in range(0, own.shape[1], _N_OF_AN_ANGLE):
            angle = out[c, first : first + _N_OF_AN_ANGLE]
            total = angle.sum()
            if total > 0:
                angle *= 100.0 / total
        out[c] += own[p]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _squared_distance(points: FloatArray, p: int, q: int) -> float:
    """Squared distance of two points [m^2]."""
    x, y, z = points[q, 0] - points[p, 0], points[q, 1] - points[p, 1], points[q, 2] - points[p, 2]
    return x * x + y * y + z * z  # type: ignore[no-any-return]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _bins(points: FloatArray, normals: FloatArray, p: int, q: int):  # type: ignore[no-untyped-def]
    """Bins of the three angles of two points, counted from the normal nearer to the line between, and if none is."""
    x, y, z = points[q, 0] - points[p, 0], points[q, 1] - points[p, 1], points[q, 2] - points[p, 2]
    distance = np.sqrt(x * x + y * y + z * z)
    along_p = (normals[p, 0] * x + normals[p, 1] * y + normals[p, 2] * z) / distance
    along_q = (normals[q, 0] * x + normals[q, 1] * y + normals[q, 2] * z) / distance
    first, second, along, is_even = p, q, along_p, abs(along_p) == abs(along_q)
    if abs(along_p) < abs(along_q):
        first, second, along = q, p, -along_q
        x, y, z = -x, -y, -z
    a_x, a_y, a_z = normals[first, 0], normals[first, 1], normals[first, 2]
    b_x, b_y, b_z = normals[second, 0], normals[second, 1], normals[second, 2]
    # v is athwart the line and the first normal, w athwart both
    v_x, v_y, v_z = y * a_z - z * a_y, z * a_x - x * a_z, x * a_y - y * a_x
    length = np.sqrt(v_x * v_x + v_y * v_y + v_z * v_z)
    if length == 0.0:
        return 5, 16, 27, is_even  # straight along the normal: all angles count as 0
    v_x, v_y, v_z = v_x / length, v_y / length, v_z / length
    w_x, w_y, w_z = a_y * v_z - a_z * v_y, a_z * v_x - a_x * v_z, a_x * v_y - a_y * v_x
    tilt = v_x * b_x + v_y * b_y + v_z * b_z
    turn = np.arctan2(w_x * b_x + w_y * b_y + w_z * b_z, a_x * b_x + a_y * b_y + a_z * b_z)
    return _bin((turn + np.pi) / (2 * np.pi)), 11 + _bin((tilt + 1.0) / 2), 22 + _bin((along + 1.0) / 2), is_even


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _bin(share: float) -> int:
    """Bin of a share of an angle's range."""
    return min(max(int(np.floor(_N_OF_AN_ANGLE * share)), 0), _N_OF_AN_ANGLE - 1)
