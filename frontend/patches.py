"""Patches: squares of the seafloor, and the pings that look at each, pass by pass."""

from collections.abc import Iterator, Sequence

import numpy as np

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.trajectory import Trajectory
from frontend.windows import Window

_SLANT_RANGES_A_PATCH = 1.5  # as long as a window
_FEWEST_PINGS = 3  # a line with a neighbour on either side


def patches(
    trajectory: Trajectory, windows: Sequence[Window], slant_range_max: float, most_pings: int
) -> list[list[Window]]:
    """Cut the seafloor below a track into patches that are to be reconstructed from all passes together.

    Parameters
    ----------
    trajectory : Trajectory
        Where the vehicle was.
    windows : sequence of Window
        Pings that can be reconstructed; all others are left out.
    slant_range_max : float
        How far a side looks [m].
    most_pings : int
        Pings that a patch may have; where more look at it, its shortest passes are left out.

    Returns
    -------
    patches : list of list of Window
        The passes of each patch, the longest first, numbered from 0 in each. Every usable ping is in one patch or
        more, unless a patch has too many.
    """
    usable = _usable(trajectory, windows)
    side = _SLANT_RANGES_A_PATCH * slant_range_max
    found = (_passes(trajectory, usable, middle, side) for middle in _middles(trajectory.positions[usable, :2], side))
    return [_chosen(passes, most_pings) for passes in found if passes]


def _usable(trajectory: Trajectory, windows: Sequence[Window]) -> BoolArray:
    usable = np.zeros(len(trajectory), dtype=np.bool_)
    for window in windows:
        usable[window.first_ping : window.end_ping] = True
    return usable


def _middles(places: FloatArray, side: float) -> Iterator[FloatArray]:
    """Middles of the squares that the vehicle was over, row by row."""
    for row, column in np.unique(np.floor(places[:, ::-1] / side), axis=0):
        yield side * (np.array([column, row]) + 0.5)


def _passes(trajectory: Trajectory, usable: BoolArray, middle: FloatArray, side: float) -> list[IntArray]:
    """Runs of pings whose lines come near the middle of a square: its middle is ahead, behind and abeam by little."""
    reach = side / np.sqrt(2.0)  # a ping over any corner is in
    across = middle - trajectory.positions[:, :2]
    ahead = np.abs((across * trajectory.poses[:, :2, 0]).sum(axis=1))
    abeam = np.abs((across * trajectory.poses[:, :2, 1]).sum(axis=1))
    pings = np.flatnonzero(usable & (ahead <= reach) & (abeam <= reach))
    runs = np.split(pings, np.flatnonzero(np.diff(pings) > 1) + 1)
    return [run for run in runs if len(run) >= _FEWEST_PINGS]


def _chosen(passes: list[IntArray], most_pings: int) -> list[Window]:
    """The longest passes, until there are too many pings."""
    longest = sorted((run[:most_pings] for run in passes), key=len, reverse=True)
    total = np.cumsum([len(run) for run in longest])
    kept = [run for run, n in zip(longest, total, strict=True) if n <= most_pings]
    return [Window(k, int(run[0]), int(run[-1]) + 1, int(run[len(run) // 2])) for k, run in enumerate(kept)]
