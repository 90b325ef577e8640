"""FPFH: what the angles between normals say of the shape around a point, of points that lie on a raster."""

import numba
import numpy as np

from frontend.arrays import AnyArray, BoolArray, FloatArray, IntArray

N_BINS = 33
_EACH = 11  # bins of each of the three angles


def fpfh(
    z: FloatArray, normals: FloatArray, masks: tuple[BoolArray, BoolArray], spacing: float, radius: float
) -> FloatArray:
    """Describe points of a raster by the points around them.

    Parameters
    ----------
    z : ndarray, shape (n_y, n_x)
        Heights [m].
    normals : ndarray, shape (n_y, n_x, 3)
        Unit normals.
    masks : tuple of ndarray of bool, each shape (n_y, n_x)
        Cells that are points of the shape, and those of them to describe.
    spacing : float
        Distance between cells [m].
    radius : float
        Reach of a neighbourhood, in space [m].

    Returns
    -------
    descriptors : ndarray, shape (K, 33)
        Histograms of three angles, 11 bins each that sum to 200; in the order of the raster's rows. All 0 for a point
        that is alone.

    Raises
    ------
    ValueError
        If a cell to describe is no point of the shape.

    Notes
    -----
    Fast point feature histograms of [1]_, with the squared distance as weight of a neighbour's histogram, as Open3D has
    them. That the points lie on a raster gives their neighbours without a tree.

    References
    ----------
    .. [1] R. B. Rusu, N. Blodow, M. Beetz, "Fast Point Feature Histograms (FPFH) for 3D Registration", ICRA 2009.
       :doi:`10.1109/ROBOT.2009.5152473`
    """
    is_point, is_wanted = masks
    if (is_wanted & ~is_point).any():
        raise ValueError(f"cells to describe must be points, got {int((is_wanted & ~is_point).sum())} that are none")
    cells = np.argwhere(is_point)
    number = np.full(is_point.shape, -1, dtype=np.int64)
    number[is_point] = np.arange(len(cells))
    shape = (np.column_stack([spacing * cells[:, 1], spacing * cells[:, 0], z[is_point]]), normals[is_point])
    reach = (int(radius / spacing), float(radius))
    simple, wanted = np.zeros((len(cells), N_BINS)), np.flatnonzero(is_wanted[is_point])
    _simple_histograms(cells, number, *shape, reach, simple)
    descriptors = np.zeros((len(wanted), N_BINS))
    _weigh_neighbours(cells, number, shape[0], reach, wanted, simple, descriptors)
    return descriptors


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _neighbours(
    k: int, cells: IntArray, number: IntArray, points: FloatArray, reach: tuple[int, float], out: IntArray
) -> int:
    """Fill in the other points within reach of point k; their number."""
    n, row, column = 0, cells[k, 0], cells[k, 1]
    for i in range(max(row - reach[0], 0), min(row + reach[0] + 1, number.shape[0])):
        for j in range(max(column - reach[0], 0), min(column + reach[0] + 1, number.shape[1])):
            m = number[i, j]
            if m < 0 or m == k:
                continue
            x, y, z = points[m, 0] - points[k, 0], points[m, 1] - points[k, 1], points[m, 2] - points[k, 2]
            if x * x + y * y + z * z < reach[1] * reach[1]:
                out[n] = m
                n += 1
    return n


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _angles(p: FloatArray, n_p: FloatArray, q: FloatArray, n_q: FloatArray) -> tuple[float, float, float]:
    """The three angles of two points with normals, the first as such, the others as cosines (Rusu 2009, eq. 1)."""
    x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    length = np.sqrt(x * x + y * y + z * z)
    along_p = (n_p[0] * x + n_p[1] * y + n_p[2] * z) / length
    along_q = (n_q[0] * x + n_q[1] * y + n_q[2] * z) / length
    phi = along_p
    if abs(along_p) < abs(along_q):  # the frame stands on the point whose normal is nearer to the line between
        n_p, n_q, x, y, z, phi = n_q, n_p, -x, -y, -z, -along_q
    v_x, v_y, v_z = y * n_p[2] - z * n_p[1], z * n_p[0] - x * n_p[2], x * n_p[1] - y * n_p[0]
    norm = np.sqrt(v_x * v_x + v_y * v_y + v_z * v_z)
    if norm == 0.0:
        return 0.0, 0.0, 0.0
    v_x, v_y, v_z = v_x / norm, v_y / norm, v_z / norm
    w_x, w_y, w_z = n_p[1] * v_z - n_p[2] * v_y, n_p[2] * v_x - n_p[0] * v_z, n_p[0] * v_y - n_p[1] * v_x
    alpha = v_x * n_q[0] + v_y * n_q[1] + v_z * n_q[2]
    both = n_p[0] * n_q[0] + n_p[1] * n_q[1] + n_p[2] * n_q[2]
    return np.arctan2(w_x * n_q[0] + w_y * n_q[1] + w_z * n_q[2], both), alpha, phi


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _bin(share: float) -> int:
    """Bin of a share of an angle's range."""
    return max(min(int(np.floor(_EACH * share)), _EACH - 1), 0)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _simple_histograms(
    cells: IntArray,
    number: IntArray,
    points: FloatArray,
    normals: FloatArray,
    reach: tuple[int, float],
    out: FloatArray,
) -> None:
    """Histograms of the angles between each point and those around it, each of three summing to 100."""
    around = np.empty((2 * reach[0] + 1) ** 2, dtype=np.int64)
    for k in range(len(cells)):
        n = _neighbours(k, cells, number, points, reach, around)
        for m in around[:n]:
            theta, alpha, phi = _angles(points[k], normals[k], points[m], normals[m])
            out[k, _bin((theta + np.pi) / (2 * np.pi))] += 100.0 / n
            out[k, _EACH + _bin((alpha + 1) / 2)] += 100.0 / n
            out[k, 2 * _EACH + _bin((phi + 1) / 2)] += 100.0 / n


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _weigh_neighbours(
    cells: IntArray,
    number: IntArray,
    points: FloatArray,
    reach: tuple[int, float],
    wanted: AnyArray,
    simple: FloatArray,
    out: FloatArray,
) -> None:
    """Own histograms plus those around, weighted by squared distance and scaled to 100 each (Rusu 2009, eq. 4)."""
    around = np.empty((2 * reach[0] + 1) ** 2, dtype=np.int64)
    for w in range(len(wanted)):
        k = wanted[w]
        for m in around[: _neighbours(k, cells, number, points, reach, around)]:
            x, y, z = points[m, 0] - points[k, 0], points[m, 1] - points[k, 1], points[m, 2] - points[k, 2]
            out[w] += simple[m] / (x * x + y * y + z * z)
        for a in range(0, N_BINS, _EACH):
            total = out[w, a : a + _EACH].sum()
            if total > 0:
                out[w, a : a + _EACH] *= 100.0 / total
        out[w] += simple[k]
