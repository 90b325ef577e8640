"""Sliding windows: which pings make a submap."""

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.trajectory import Trajectory


class WindowConfig(BaseModel):
    """How the dive is cut into windows."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    length: float | None = Field(
        default=None,
        gt=0,
        description="Distance run in a window [m]; unset: 1.5 slant ranges, a footprint about as long as wide.",
    )
    overlap: float = Field(
        default=0.5,
        ge=0,
        lt=1,
        description="Share of a window [1] that the next one repeats, so that no place lies only at an edge.",
    )
    n_edge_pings: int = Field(
        default=1,
        ge=0,
        description="Pings [1] left out at each end of a window: they have neighbours on one side only.",
    )


_SLANT_RANGES_A_WINDOW = 1.5


@dataclass(frozen=True)
class Window:
    """Pings ``first_ping <= i < end_ping``, with one of them as anchor.

    Parameters
    ----------
    number : int
        Position in the dive; the number of the submap.
    first_ping, end_ping : int
        Half-open range of pings.
    anchor_ping : int
        The reference ping, in the middle of the window.
    """

    number: int
    first_ping: int
    end_ping: int
    anchor_ping: int

    @property
    def n_pings(self) -> int:
        """Number of pings in the window."""
        return self.end_ping - self.first_ping

    @property
    def pings(self) -> slice:
        """The window as a slice of the recording."""
        return slice(self.first_ping, self.end_ping)


def sliding_windows(trajectory_dr: Trajectory, slant_range: float, config: WindowConfig | None = None) -> list[Window]:
    """Cut a track into overlapping windows of equal distance run.

    Parameters
    ----------
    trajectory_dr : Trajectory
        Dead-reckoned body poses, N pings.
    slant_range : float
        Largest slant range of the sonar [m]; sets the length where the configuration leaves it open.
    config : WindowConfig, optional
        Length, overlap and edge.

    Returns
    -------
    windows : list of Window
        At least one, in order of time. A track shorter than a window gives one window; what is left at the end of the
        track is a window of full length that overlaps more, or lengthens the last one when it is less than half a step.
        Pings that stand still belong to the window of the place where they stand.

    Raises
    ------
    ValueError
        If the track has no ping, or neither a positive slant range nor a length is given.
    """
    config = config or WindowConfig()
    length = window_length(slant_range, config)
    if len(trajectory_dr) == 0:
        raise ValueError("windows need at least one ping, got an empty track")
    distance = trajectory_dr.distance
    spans = _spans(float(distance[-1]), length, length * (1 - config.overlap))
    windows = [_window(distance, start, end, config.n_edge_pings) for start, end in spans]
    distinct = list(dict.fromkeys(window for window in windows if window[1] > window[0]))
    return [Window(number, *window) for number, window in enumerate(distinct)]


def window_length(slant_range: float, config: WindowConfig) -> float:
    """Distance run in a window.

    Parameters
    ----------
    slant_range : float
        Largest slant range of the sonar [m].
    config : WindowConfig
        The configured length, if any.

    Returns
    -------
    length : float
        The configured length, else 1.5 slant ranges [m].

    Raises
    ------
    ValueError
        If the length has to come from a slant range that is not positive.
    """
    if config.length is not None:
        return config.length
    if not (slant_range > 0 and np.isfinite(slant_range)):
        raise ValueError(f"slant range must be positive to derive a window length, got {slant_range} m")
    return _SLANT_RANGES_A_WINDOW * slant_range


def _spans(total: float, length: float, step: float) -> list[tuple[float, float]]:
    """First and last distance of each window."""
    if total <= length:
        return [(0.0, total)]
    starts = step * np.arange(int((total - length) // step) + 1)
    spans = [(float(start), float(start + length)) for start in starts]
    rest = total - spans[-1][1]
    if rest >= step / 2:
        return [*spans, (total - length, total)]
    return [*spans[:-1], (spans[-1][0], total)]


def _window(distance: FloatArray, start: float, end: float, n_edge: int) -> tuple[int, int, int]:
    """First, end and anchor ping of a span, its edge pings left out where enough remain."""
    first = int(np.searchsorted(distance, start, side="left"))
    stop = int(np.searchsorted(distance, end, side="right"))
    if stop - first > 2 * n_edge:
        first, stop = first + n_edge, stop - n_edge
    middle = int(np.searchsorted(distance, (start + end) / 2, side="left"))
    return first, stop, min(max(middle, first), max(stop - 1, first))
