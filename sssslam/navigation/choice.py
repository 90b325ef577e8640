"""Which navigation a dive is given: its own, that of a file beside it, or one rebuilt from heading and speed."""

from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np

from frontend.recording import Recording
from sssslam.navigation.clock import estimate_clock_offset
from sssslam.navigation.dead_reckoned import rebuild_dead_reckoned
from sssslam.navigation.files import read_navigation
from sssslam.navigation.joining import join_navigation

_ESTIMATE = "estimate"
_MAX_CLOCK_OFFSET = 1e10


class Source(StrEnum):
    """Where positions come from."""

    RECORDED = "recorded"
    DEAD_RECKONED = "dead-reckoned"


@dataclass(frozen=True)
class NavigationChoice:
    """What a user asked for.

    Parameters
    ----------
    file : Path or None
        Navigation beside the sonar; None takes what the recording has.
    clock_offset : str or None
        Seconds to add to the times of the file, or ``"estimate"``.
    source : Source
        Positions as recorded, or rebuilt from heading and speed.
    """

    file: Path | None = None
    clock_offset: str | None = None
    source: Source = Source.RECORDED


def navigate(recording: Recording, choice: NavigationChoice) -> Recording:
    """Give a recording the navigation that was asked for.

    Parameters
    ----------
    recording : Recording
        As read.
    choice : NavigationChoice
        Which navigation.

    Returns
    -------
    recording : Recording
        With that navigation; what was done is in its notes.

    Raises
    ------
    ValueError
        If the file or the clock offset cannot be used, or heading and speed are not there.
    """
    if choice.file is None and choice.clock_offset is not None:
        raise ValueError(
            f"--clock-offset {choice.clock_offset} was given without --nav; a file of navigation is wanted"
        )
    if choice.file is not None:
        recording = _join_file(recording, choice.file, choice.clock_offset)
    return rebuild_dead_reckoned(recording) if choice.source is Source.DEAD_RECKONED else recording


def _join_file(recording: Recording, path: Path, clock_offset: str | None) -> Recording:
    log = read_navigation(path, float(recording.ping_time[0]))
    if clock_offset != _ESTIMATE:
        return join_navigation(recording, log, _seconds(clock_offset))
    estimated, notes = estimate_clock_offset(recording, log)
    return join_navigation(recording, replace(log, notes=(*log.notes, *notes)), estimated.offset)


def _seconds(text: str | None) -> float:
    try:
        seconds = float(text or 0.0)
    except ValueError:
        seconds = np.nan
    if not abs(seconds) < _MAX_CLOCK_OFFSET:
        raise ValueError(f"--clock-offset is {text!r}; seconds or {_ESTIMATE!r} is wanted")
    return seconds
