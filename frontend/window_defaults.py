"""Defaults of the windows that a whole track decides: short ones where a short track turns back."""

import numpy as np

from frontend.trajectory import Trajectory
from frontend.turns import heading_spread
from frontend.windows import WindowConfig, window_length

# Windows two lengths apart are compared, so that of nine most have partners; a shorter track leaves too few.
_WINDOWS_A_TRACK = 9
_LEAST_SLANT_RANGES = 0.5  # shorter, and a window holds too little floor to be told from another
# A window is compared with those that share pings with it: 2.6 lengths, which on such a dive is some 1.5 slant ranges.
_SHORT_OVERLAP = 0.8
# A turn between two legs nearer than its circle is wide swings out by up to 60 deg before and after; a track that goes
# round turns by more [rad].
_GOES_ROUND = 2 * np.pi


def suit_track(config: WindowConfig, slant_range: float, trajectory_dr: Trajectory) -> WindowConfig:
    """Choose shorter windows where a short track turns back; all else is left open.

    Parameters
    ----------
    config : WindowConfig
        How the dive is cut into windows; a key that is set is kept.
    slant_range : float
        Largest slant range of the sonar [m].
    trajectory_dr : Trajectory
        Dead-reckoned body poses of the whole dive.

    Returns
    -------
    config : WindowConfig
        As given where the length is set, where the headings span less than a whole circle, or where 1.5 slant ranges
        are no more than a ninth of the distance run. Else with that ninth as length, at least half a slant
        range, and an overlap of 0.8.

    Notes
    -----
    Two windows are compared when they share no ping and lie two lengths apart: windows that are long for their track
    find no partner, even where it crosses itself.

    Examples
    --------
    >>> time = np.arange(201.0)  # one and a half circles, 200 m long, at a range of 40 m
    >>> yaw, zero = 1.5 * 2 * np.pi * time / 200, np.zeros(201)
    >>> x, y = np.cumsum(np.cos(yaw)), np.cumsum(np.sin(yaw))
    >>> suited = suit_track(WindowConfig(), 40.0, Trajectory(time, x, y, zero, zero, zero, yaw))
    >>> round(suited.length), suited.overlap
    (22, 0.8)
    """
    if config.length is not None or len(trajectory_dr) == 0:
        return config
    usual, share = window_length(slant_range, config), float(trajectory_dr.distance[-1]) / _WINDOWS_A_TRACK
    if not 0 < share < usual or heading_spread(trajectory_dr) < _GOES_ROUND:
        return config
    length = max(share, _LEAST_SLANT_RANGES * slant_range)
    overlap = _SHORT_OVERLAP if config.overlap is None else config.overlap
    radius = config.min_radius or slant_range
    return config.model_copy(update={"length": length, "overlap": overlap, "min_radius": radius})
