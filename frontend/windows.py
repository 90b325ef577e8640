"""Sliding windows: which pings make a submap, by distance run, by number of lines, or cut where the track turns."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.trajectory import Trajectory
from frontend.turns import straight_and_turning, turn_reach


class WindowConfig(BaseModel):
    """How the dive is cut into windows, and which of them are given up."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    method: Literal["distance", "lines", "adaptive"] = Field(
        default="distance",
        description="distance: windows of equal distance run; lines: of as many pings each; adaptive: by distance, but "
        "none reaches from a straight leg into a turn or out of it, where other lines become neighbours.",
    )
    length: float | None = Field(
        default=None,
        gt=0,
        description="Distance run in a window [m]; unset: 1.5 slant ranges, a footprint about as long as wide; on a "
        "short track that turns back a ninth of it, at least half a slant range.",
    )
    n_lines: int | None = Field(
        default=None,
        ge=3,
        description="Pings [1] in a window of the method lines; unset: those that run the length at the usual spacing.",
    )
    overlap: float | None = Field(
        default=None,
        ge=0,
        lt=1,
        description="Share of a window [1] that the next one repeats, so that no place lies only at an edge; unset: "
        "0.5, and 0.8 where a short track that turns back makes the windows short.",
    )
    n_edge_pings: int = Field(
        default=1,
        ge=0,
        description="Pings [1] left out at each end of a window: they have neighbours on one side only.",
    )
    min_radius: float | None = Field(
        default=None,
        gt=0,
        description="Radius [m] of a turn below which the method adaptive cuts; unset: the slant range, as below it "
        "the lines of neighbouring pings cross inside the swath.",
    )
    min_turn: float = Field(
        default=0.35,
        gt=0,
        description="Turn [rad] that counts as one; 20 deg, more than waves and steering on a straight leg.",
    )
    min_bottom: float = Field(
        default=0.5,
        ge=0,
        le=1,
        description="Least share of a window's pings [1] in range of a bottom that is seen or measured; else skipped.",
    )


_SLANT_RANGES_A_WINDOW = 1.5
_OVERLAP = 0.5
_FEWEST_LINES = 3  # one with a neighbour on either side


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
    """Cut a track into overlapping windows.

    Parameters
    ----------
    trajectory_dr : Trajectory
        Dead-reckoned body poses, N pings.
    slant_range : float
        Largest slant range of the sonar [m]; sets the length where the configuration leaves it open.
    config : WindowConfig, optional
        Method, length, overlap and edge.

    Returns
    -------
    windows : list of Window
        At least one, in order of time. A track shorter than a window gives one window; what is left at the end of the
        track is a window of full length that overlaps more, or lengthens the last one when it is less than half a step.
        Pings that stand still belong to the window of the place where they stand. With the method adaptive all this
        holds for each straight leg and each turn.

    Raises
    ------
    ValueError
        If the track has no ping, or neither a positive slant range nor a length is given.
    """
    if len(trajectory_dr) == 0:
        raise ValueError("windows need at least one ping, got an empty track")
    config = resolve_windows(config or WindowConfig(), slant_range, trajectory_dr.ping_spacing)
    along, length, step = _measure(trajectory_dr, config)
    found: dict[tuple[int, int, int], None] = {}
    for first, end in _pieces(trajectory_dr, config):
        found |= dict.fromkeys(_slide(along[first:end], (length, step), config.n_edge_pings, first))
    return [Window(number, *window) for number, window in enumerate(found)]


def finished_windows(trajectory_dr: Trajectory, slant_range: float, config: WindowConfig | None = None) -> list[Window]:
    """The windows of a track that goes on which do not change any more.

    Parameters
    ----------
    trajectory_dr : Trajectory
        Dead-reckoned body poses of the pings so far.
    slant_range : float
        Largest slant range of the sonar [m].
    config : WindowConfig, optional
        Method, length, overlap and edge.

    Returns
    -------
    windows : list of Window
        As `sliding_windows` gives them, without the last one, and without those so near the end that the beginning of
        a turn may yet cut them.
    """
    windows = sliding_windows(trajectory_dr, slant_range, config)[:-1]
    config = resolve_windows(config or WindowConfig(), slant_range, trajectory_dr.ping_spacing)
    if config.method != "adaptive":
        return windows
    assert config.min_radius is not None
    assert config.length is not None
    assert config.overlap is not None
    open_end = turn_reach(config.min_turn, config.min_radius) + 0.5 * config.length * (1.0 - config.overlap)
    settled = np.flatnonzero(trajectory_dr.distance < trajectory_dr.distance[-1] - open_end)
    return [window for window in windows if window.end_ping + config.n_edge_pings <= len(settled)]


def resolve_windows(config: WindowConfig, slant_range: float, ping_spacing: float) -> WindowConfig:
    """Fill in what is left to the data.

    Parameters
    ----------
    config : WindowConfig
        A configuration with open keys.
    slant_range : float
        Largest slant range of the sonar [m].
    ping_spacing : float
        Usual distance run between pings [m]; what is no positive number is unknown.

    Returns
    -------
    config : WindowConfig
        The same with length, overlap, number of lines and radius set.

    Raises
    ------
    ValueError
        If the length has to come from a slant range that is not positive.
    """
    length = window_length(slant_range, config)
    radius = config.min_radius or length / _SLANT_RANGES_A_WINDOW
    n_lines = config.n_lines or _lines_that_run(length, ping_spacing)
    overlap = _OVERLAP if config.overlap is None else config.overlap
    return config.model_copy(update={"length": length, "overlap": overlap, "n_lines": n_lines, "min_radius": radius})


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


def _lines_that_run(length: float, ping_spacing: float) -> int:
    """Number of pings that run a length; where nobody knows how far apart they are, of a metre each."""
    return max(_FEWEST_LINES, round(length / (ping_spacing if ping_spacing > 0 else 1.0)))


def _measure(trajectory_dr: Trajectory, config: WindowConfig) -> tuple[FloatArray, float, float]:
    """What is equally long of each window, at each ping; its length in a window and from one window to the next."""
    assert config.length is not None
    assert config.n_lines is not None
    assert config.overlap is not None
    if config.method == "lines":
        step = max(1, round(config.n_lines * (1.0 - config.overlap)))
        return np.arange(len(trajectory_dr), dtype=np.float64), config.n_lines - 1.0, float(step)
    return trajectory_dr.distance, config.length, config.length * (1.0 - config.overlap)


def _pieces(trajectory_dr: Trajectory, config: WindowConfig) -> list[tuple[int, int]]:
    """Half-open ranges of pings that no window reaches beyond."""
    if config.method != "adaptive":
        return [(0, len(trajectory_dr))]
    assert config.min_radius is not None
    return straight_and_turning(trajectory_dr, config.min_turn, config.min_radius)


def _slide(
    along: FloatArray, length_step: tuple[float, float], n_edge: int, first_ping: int
) -> list[tuple[int, int, int]]:
    """First, end and anchor ping of each window of a piece of the track."""
    along = along - along[0]
    windows = [_window(along, start, end, n_edge) for start, end in _spans(float(along[-1]), *length_step)]
    return [(first_ping + a, first_ping + b, first_ping + c) for a, b, c in windows if b > a]


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
