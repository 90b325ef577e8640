"""Surroundings: a submap's relief with what its neighbours along the track add; more floor tells more of the place."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import invert, planar_parameters, transform
from frontend.relief import Relief
from frontend.sampling import sample_rasters
from frontend.submaps import Submap


@dataclass(frozen=True)
class _Frame:
    """Pose of a submap by dead reckoning and the relief in it."""

    T_world_submap: FloatArray
    relief: Relief


def neighbours(submaps: Sequence[Submap], position: int, pings: tuple[int, int]) -> range:
    """Submaps around one that share pings with it, inside a range of pings.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps of a dive, in order.
    position : int
        Which submap.
    pings : tuple of int
        First and end of the pings that may be looked at, so that two sides of a pair have none in common.

    Returns
    -------
    neighbours : range
        Positions without a gap, the submap itself among them. Windows that overlap by half give one on each side: twice
        the length of track, over which dead reckoning is as good as rigid.
    """
    own = submaps[position]

    def belongs(k: int) -> bool:
        common = submaps[k].first_ping < own.end_ping and submaps[k].end_ping > own.first_ping
        return common and pings[0] <= submaps[k].first_ping and submaps[k].end_ping <= pings[1]

    first, end = position, position + 1
    while first > 0 and belongs(first - 1):
        first -= 1
    while end < len(submaps) and belongs(end):
        end += 1
    return range(first, end)


def meeting_ping(target: Submap, source: Submap) -> int:
    """Ping half way between two submaps: what is looked at for one ends here and for the other begins.

    Parameters
    ----------
    target, source : Submap
        Two submaps without a common ping, the target the earlier.

    Returns
    -------
    ping : int
        At least the target's end and at most the source's first.
    """
    return (target.end_ping + source.first_ping) // 2


def lay_beside(submaps: Sequence[Submap], reliefs: Mapping[int, Relief], position: int, members: range) -> Relief:
    """Lay the reliefs of neighbours beside that of a submap, by dead reckoning.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps of a dive.
    reliefs : mapping of int to Relief
        Theirs by position, on grids of one spacing.
    position : int
        The submap in whose frame the result is.
    members : range
        Positions of those laid beside, this one among them.

    Returns
    -------
    relief : Relief
        Weighted means where several know a cell. Heights of the others are lifted and tilted onto what lies there.
    """
    if len(members) == 1:
        return reliefs[position]
    frames = [_Frame(submaps[k].T_world_submap_dr, reliefs[k]) for k in members]
    own = frames[position - members.start]
    grid, origin = _common_grid(frames, own)
    points = grid.reshape(-1, 2)
    outwards = sorted(range(len(frames)), key=lambda k: abs(k - (position - members.start)))
    total = np.zeros((len(points), 5))
    for k in outwards:
        _add(total, _sampled(frames[k], own, points), points)
    total[:, 1:] /= np.maximum(total[:, :1], 1e-12)
    total[total[:, 0] <= 0, 4] = 1.0
    weight, z, reflectivity, height, sigma = np.ascontiguousarray(total.T).reshape(5, *grid.shape[:2])
    return Relief(z, np.minimum(weight, 1.0), reflectivity, height, sigma, own.relief.spacing, origin)


def _common_grid(frames: Sequence[_Frame], own: _Frame) -> tuple[FloatArray, tuple[float, float]]:
    """Cells of the own grid, continued until all frames are covered, shape (n_y, n_x, 2), and the first one's place."""
    corners = np.concatenate([_corners(frame, own) for frame in frames])
    spacing, start = own.relief.spacing, np.array(own.relief.origin)
    low = np.floor((corners.min(axis=0) - start) / spacing).astype(int)
    high = np.ceil((corners.max(axis=0) - start) / spacing).astype(int)
    x, y = (start[k] + spacing * np.arange(low[k], high[k] + 1) for k in (0, 1))
    return np.stack(np.meshgrid(x, y), axis=-1), (float(x[0]), float(y[0]))


def _corners(frame: _Frame, own: _Frame) -> FloatArray:
    """Outermost cells of a frame's grid in the own frame, shape (4, 2)."""
    n_y, n_x = frame.relief.z.shape
    cells = np.array([[0, 0], [n_x - 1, 0], [0, n_y - 1], [n_x - 1, n_y - 1]])
    corners = cells * frame.relief.spacing + np.array(frame.relief.origin)
    T = invert(own.T_world_submap) @ frame.T_world_submap
    return np.asarray(transform(T, np.column_stack([corners, np.zeros(4)]))[:, :2])


def _sampled(frame: _Frame, own: _Frame, points: FloatArray) -> FloatArray:
    """Weight, relief, reflectivity, height in the own frame and sigma at points of the own frame, shape (K, 5)."""
    r = frame.relief
    T = invert(frame.T_world_submap) @ own.T_world_submap
    rasters = np.stack([r.weight, r.z, r.reflectivity, r.height, r.sigma], axis=-1)
    sampled = np.asarray(sample_rasters(rasters, points, (*r.origin, r.spacing), planar_parameters(T)))
    sampled[:, 3] -= T[2, 3]
    return sampled


def _add(total: FloatArray, sampled: FloatArray, points: FloatArray) -> None:
    """Add weighted samples to weighted sums, their heights brought onto those already there."""
    normal, right, plane = np.zeros((3, 3)), np.zeros(3), np.zeros(5)
    if _fit_plane(total, sampled, points, plane, normal, right):
        plane[2:] = np.linalg.pinv(normal, rcond=1e-9, hermitian=True) @ right  # least tilted where that is left open
    _lay_on(total, sampled, points, plane)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _fit_plane(total, sampled, points, centre, normal, right):  # type: ignore[no-untyped-def]
    """Normal equations of how far samples lie above what is there, about the middle of the common cells; how many."""
    n = 0
    for k in range(len(points)):
        if total[k, 0] > 0 and sampled[k, 0] > 0:
            n += 1
            centre[0] += points[k, 0]
            centre[1] += points[k, 1]
    centre[:2] /= max(n, 1)
    for k in range(len(points)):
        if total[k, 0] > 0 and sampled[k, 0] > 0:
            above = sampled[k, 3] - total[k, 3] / total[k, 0]
            basis = (1.0, points[k, 0] - centre[0], points[k, 1] - centre[1])
            for i in range(3):
                right[i] += basis[i] * above
                for j in range(3):
                    normal[i, j] += basis[i] * basis[j]
    return n


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _lay_on(total: FloatArray, sampled: FloatArray, points: FloatArray, plane: FloatArray) -> None:
    """Add weighted samples, their heights less a plane: its centre's x and y, its height there and its slopes."""
    for k in range(len(points)):
        weight = sampled[k, 0]
        if weight > 0:
            above = plane[2] + plane[3] * (points[k, 0] - plane[0]) + plane[4] * (points[k, 1] - plane[1])
            total[k, 0] += weight
            for c in range(1, total.shape[1]):
                total[k, c] += weight * (sampled[k, c] - above if c == 3 else sampled[k, c])
