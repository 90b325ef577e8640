"""Whole metres: positions that fish finders round to the metre of their map, made smooth again."""

import numpy as np

from frontend.arrays import AnyArray, FloatArray
from sssslam.readers.held_navigation import stray_positions


def smooth_whole_metres(east: AnyArray, north: AnyArray) -> tuple[FloatArray, FloatArray]:
    """Undo the rounding of a track to whole metres.

    Parameters
    ----------
    east, north : ndarray of int, shape (P,)
        Positions as recorded, in the order of the pings, whole metres of a map; zero on both axes is what a unit
        without GNSS writes.

    Returns
    -------
    east, north : ndarray, shape (P,)
        Positions [m]; NaN where both were zero or strayed from their neighbours.

    Notes
    -----
    Where a rounded figure steps from n to n + 1, the track crosses n + 1/2: it is drawn through these crossings.
    """
    figures = east.astype(np.float64), north.astype(np.float64)
    known = np.flatnonzero((figures[0] != 0) | (figures[1] != 0))
    smooth = np.full((2, len(figures[0])), np.nan)
    if known.size:
        known = known[~stray_positions(figures[0][known], figures[1][known])]
        smooth[:, known] = [_through_crossings(axis[known]) for axis in figures]
    return smooth[0], smooth[1]


def _through_crossings(figures: FloatArray) -> FloatArray:
    """Whole metres as the smooth line that was rounded."""
    if not figures.size:
        return figures
    before = np.flatnonzero(np.diff(figures) != 0)
    knots = np.concatenate([[0.0], before + 0.5, [len(figures) - 1.0]])
    middles = np.concatenate([figures[:1], (figures[before] + figures[before + 1]) / 2, figures[-1:]])
    return np.interp(np.arange(len(figures)), knots, middles)
