"""Files of navigation: which format one is, told by its content."""

from pathlib import Path

import numpy as np

from sssslam.navigation.log import NavigationLog
from sssslam.navigation.nmea import looks_like_nmea, parse_nmea
from sssslam.navigation.series import make_series
from sssslam.navigation.tables import looks_like_table, parse_table
from sssslam.products.tum import read_tum
from sssslam.regular_files import read_head

_HEAD_LINES = 200


def read_navigation(path: Path, near: float) -> NavigationLog:
    """Read navigation that was recorded beside the sonar.

    Parameters
    ----------
    path : Path
        A CSV with a header, a TUM trajectory, or a log of NMEA sentences.
    near : float
        A time of the dive [s since 1970 UTC]: gives the day to logs that tell only the time of day.

    Returns
    -------
    log : NavigationLog
        At least one quantity.

    Raises
    ------
    ValueError
        If the file cannot be read or says nothing; in one line that names it.
    """
    lines = _read_lines(path)
    log = _read_tum(path) if _is_tum(lines) else _read_log(path, lines, near)
    if not log.series:
        raise ValueError(f"{path}: no row holds a time with a position, heading, depth or speed; navigation is wanted")
    return log


def _read_log(path: Path, lines: list[str], near: float) -> NavigationLog:
    first = next((line for line in lines if line.strip()), "")
    try:
        if looks_like_nmea("\n".join(lines[:_HEAD_LINES])):
            return parse_nmea(lines, path.name, near)
        if looks_like_table(first):
            return parse_table(lines, path.name, near)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    raise ValueError(
        f"{path}: this is no navigation: a CSV whose header names time and more, a TUM trajectory, or NMEA is wanted"
    )


def _read_lines(path: Path) -> list[str]:
    read_head(path, 1, "a file of navigation")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: this is no text; navigation as CSV, TUM or NMEA is wanted") from None
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror}); a file of navigation is wanted") from None
    if "\0" in text:
        raise ValueError(f"{path}: this is no text; navigation as CSV, TUM or NMEA is wanted")
    return text.splitlines()


def _is_tum(lines: list[str]) -> bool:
    """Whether the first row that is no comment is 8 numbers between blanks."""
    first = next((line for line in lines if line.split("#")[0].strip()), "")
    words = first.split("#")[0].split()
    try:
        return len(words) == 8 and all(np.isfinite(float(word)) for word in words)
    except ValueError:
        return False


def _read_tum(path: Path) -> NavigationLog:
    track = read_tum(path)
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    series = {name: make_series(track.time, getattr(track, name)) for name in names}
    return NavigationLog(path.name, {name: known for name, known in series.items() if known})
