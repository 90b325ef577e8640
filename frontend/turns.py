"""Turns: where along a track the lines of neighbouring pings cross inside the swath."""

import numpy as np

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.trajectory import Trajectory


def turn_reach(min_turn: float, min_radius: float) -> float:
    """How far from a ping one must look to see whether it lies in a turn.

    Parameters
    ----------
    min_turn : float
        Turn that counts as one [rad].
    min_radius : float
        Radius below which it does [m].

    Returns
    -------
    reach : float
        Before and after the ping [m]: half of what a turn of that radius takes for that angle.
    """
    return 0.5 * min_turn * min_radius


def is_turning(trajectory_dr: Trajectory, min_turn: float, min_radius: float) -> BoolArray:
    """Which pings lie in a turn.

    Parameters
    ----------
    trajectory_dr : Trajectory
        Dead-reckoned body poses, N pings.
    min_turn : float
        Turn that counts as one [rad].
    min_radius : float
        Radius below which it does [m].

    Returns
    -------
    is_turning : ndarray of bool, shape (N,)
        True where the heading changes by more than ``min_turn`` over the ``min_turn * min_radius`` run around a ping.

    Notes
    -----
    The lines of two pings lie at right angles to the heading: on a circle they all meet in its middle. With a radius
    below the slant range they cross inside the swath, and the neighbour of a cell is no longer the line before.
    """
    heading, distance = np.unwrap(trajectory_dr.yaw), trajectory_dr.distance
    reach = turn_reach(min_turn, min_radius)
    first = np.searchsorted(distance, distance - reach, side="left").astype(np.int64)
    end = np.searchsorted(distance, distance + reach, side="right").astype(np.int64)
    return _spread(heading, first, end) > min_turn


def straight_and_turning(trajectory_dr: Trajectory, min_turn: float, min_radius: float) -> list[tuple[int, int]]:
    """Cut a track where a turn begins or ends.

    Parameters
    ----------
    trajectory_dr : Trajectory
        Dead-reckoned body poses, N pings.
    min_turn, min_radius : float
        As for `is_turning` [rad, m].

    Returns
    -------
    pieces : list of (int, int)
        Half-open ranges of pings, in order, that cover them all: straight legs and turns.
    """
    turning = is_turning(trajectory_dr, min_turn, min_radius)
    cuts = (np.flatnonzero(turning[1:] != turning[:-1]) + 1).tolist()
    return list(zip([0, *cuts], [*cuts, len(turning)], strict=True))


def heading_spread(trajectory_dr: Trajectory) -> float:
    """Difference between the outermost headings of a track.

    Parameters
    ----------
    trajectory_dr : Trajectory
        Dead-reckoned body poses; whole turns count.

    Returns
    -------
    spread : float
        The difference [rad].
    """
    return float(np.ptp(np.unwrap(trajectory_dr.yaw)))


def _spread(values: FloatArray, first: IntArray, end: IntArray) -> FloatArray:
    """Difference between largest and smallest value of each half-open range."""
    bounds = np.stack([first, end], axis=1).ravel()
    padded = np.append(values, values[-1])
    high, low = np.maximum.reduceat(padded, bounds)[::2], np.minimum.reduceat(padded, bounds)[::2]
    return np.asarray(high - low)
