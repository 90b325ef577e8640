"""Which windows can be reconstructed at all, and why the others cannot."""

from collections import Counter
from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from frontend.arrays import BoolArray
from frontend.bottom import Bottom
from frontend.recording import Recording
from frontend.turns import heading_spread
from frontend.windows import Window, WindowConfig

_ON_THE_SPOT = 0.25  # share of the altitude that the radius of a pure turn is below
_FEWEST_STEPS = 4  # between pings, before one of them can be called long


class Unusable(StrEnum):
    """Why a window cannot be reconstructed."""

    NO_NAVIGATION = "no navigation over most of it"
    PURE_TURN = "a pure turn"
    BOTTOM_LOST = "bottom lost over most of it"


def usable_windows(
    recording: Recording, windows: Sequence[Window], bottom: Bottom, config: WindowConfig
) -> tuple[list[Window], dict[str, int]]:
    """Leave out the windows that cannot be reconstructed.

    Parameters
    ----------
    recording : Recording
        The dive.
    windows : sequence of Window
        Its windows.
    bottom : Bottom
        What was found of the bottom.
    config : WindowConfig
        How much of the bottom must be seen.

    Returns
    -------
    usable : list of Window
        The others, numbered anew from 0.
    skipped : dict of str to int
        How many were left out, by reason.
    """
    reasons = [why_unusable(recording, window, bottom, config) for window in windows]
    left = [window for window, reason in zip(windows, reasons, strict=True) if reason is None]
    usable = [Window(k, w.first_ping, w.end_ping, w.anchor_ping) for k, w in enumerate(left)]
    return usable, dict(Counter(str(reason) for reason in reasons if reason is not None))


def why_unusable(recording: Recording, window: Window, bottom: Bottom, config: WindowConfig) -> Unusable | None:
    """Why a window cannot be reconstructed.

    Parameters
    ----------
    recording : Recording
        The dive.
    window : Window
        Some of its pings.
    bottom : Bottom
        What was found of the bottom.
    config : WindowConfig
        How much of the bottom must be seen, and what counts as a turn.

    Returns
    -------
    reason : Unusable or None
        None where it can.

    Notes
    -----
    A step that makes most of the way hides where the vehicle was meanwhile: positions that stood still and jumped, or
    pings that are missing. A turn on the spot, on a radius below a quarter of the altitude, sweeps a disc about its
    middle: no line has a neighbour beside it, and shape and heading error cannot be told apart. Wider turns can be
    reconstructed on their outer side, however tight.
    """
    track = recording.trajectory_dr[window.pings]
    steps = np.diff(track.distance)
    run = float(steps.sum())
    if len(steps) >= _FEWEST_STEPS and not steps.max() < 0.5 * run:
        return Unusable.NO_NAVIGATION
    spread, altitude = heading_spread(track), float(np.median(bottom.altitude[window.pings]))
    if spread > config.min_turn and run < spread * _ON_THE_SPOT * altitude:
        return Unusable.PURE_TURN
    is_reached = in_range_of_bottom(recording, bottom)[window.pings]
    return Unusable.BOTTOM_LOST if is_reached.mean() < config.min_bottom else None


def in_range_of_bottom(recording: Recording, bottom: Bottom) -> BoolArray:
    """Which pings reach a bottom that is seen or measured.

    Parameters
    ----------
    recording : Recording
        The dive.
    bottom : Bottom
        What was found of the bottom; elsewhere it is interpolated.

    Returns
    -------
    is_reached : ndarray of bool, shape (N,)
        True where a ping shows its first bottom return or an altitude is recorded, within its slant range.
    """
    is_seen = np.isfinite(recording.altitude) & (recording.altitude > 0)
    if bottom.is_found is not None:
        is_seen |= bottom.is_found.any(axis=1)
    return np.asarray(is_seen & (bottom.altitude < recording.slant_range_max))
