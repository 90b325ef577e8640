"""NMEA 0183: positions, heading, speed, depth below the transducer and attitude out of logged sentences."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import date
from functools import reduce

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import yaw_from_heading
from sssslam.navigation.log import NavigationLog
from sssslam.navigation.moments import midnight, nearest_day, second_of_day, unroll_days
from sssslam.navigation.nmea_times import come_in_bursts, times_of_bursts, times_of_places
from sssslam.navigation.series import Series, make_series

_KNOT = 1852 / 3600
_SENTENCE = re.compile(r"[$!]([A-Z][A-Z0-9]{2,7},[^*\r\n$!]*)(?:\*([0-9A-Fa-f]{2}))?")


@dataclass
class _Row:
    """What one sentence says; a time only if it holds one."""

    line: int
    kind: str
    second: float = np.nan
    day: date | None = None
    values: dict[str, float] = field(default_factory=dict)


def looks_like_nmea(head: str) -> bool:
    """Whether a text holds NMEA sentences.

    Parameters
    ----------
    head : str
        The beginning of a file.

    Returns
    -------
    is_nmea : bool
        True if one of the known sentences is in it, whole and with the right checksum or none.
    """
    return any(_parse(k, line) is not None for k, line in enumerate(head.splitlines()))


def parse_nmea(lines: Sequence[str], source: str, near: float) -> NavigationLog:
    """Read a log of NMEA sentences.

    Parameters
    ----------
    lines : sequence of str
        The log; what a logger wrote before the ``$`` of a line is skipped.
    source : str
        Name of the file.
    near : float
        A time of the dive [s]: gives the day where no sentence does.

    Returns
    -------
    log : NavigationLog
        Positions (GGA, else RMC, else GLL), speed (VTG, else RMC), heading (THS, HDT, else HDG with its variation, else
        HDM), attitude (PASHR), altitude of the transducer (DPT, else DBT).

    Raises
    ------
    ValueError
        If no sentence tells the time.

    Notes
    -----
    A sentence without time takes that of its burst where the log repeats one, as receivers write once a fix; else one
    from its place in the log, between the sentences around it that have a time.
    """
    said = [_parse(k, line) for k, line in enumerate(lines)]
    rows = [row for row in said if isinstance(row, _Row)]
    n_bad = sum(row is False for row in said)
    time = _times(rows, near)
    notes = [f"{n_bad} sentences with a wrong checksum or field are left out"] if n_bad else []
    series: dict[str, Series] = {}
    for name, kinds in _PREFERRED.items():
        found = _first_known(name, kinds, rows, time)
        if found:
            series[name], kind = found
            if kind == "HDM":
                notes.append("heading is magnetic (HDM), its variation unknown: yaw is off by that")
    return NavigationLog(source, series, tuple(notes))


# Of each quantity, the sentences that tell it, the better first.
_PREFERRED = {
    "latitude": ("GGA", "RMC", "GLL"),
    "longitude": ("GGA", "RMC", "GLL"),
    "yaw": ("THS", "HDT", "PASHR", "HDG", "HDM"),
    "roll": ("PASHR",),
    "pitch": ("PASHR",),
    "speed": ("VTG", "RMC"),
    "altitude": ("DPT", "DBT"),
}


def _first_known(name: str, kinds: Sequence[str], rows: Sequence[_Row], time: FloatArray) -> tuple[Series, str] | None:
    for kind in kinds:
        at = [k for k, row in enumerate(rows) if row.kind == kind and name in row.values]
        series = make_series(time[at], np.array([rows[k].values[name] for k in at], dtype=np.float64)) if at else None
        if series:
            return series, kind
    return None


def _times(rows: Sequence[_Row], near: float) -> FloatArray:
    """Seconds since 1970 of every sentence."""
    seconds = np.array([row.second for row in rows], dtype=np.float64)
    timed = np.flatnonzero(np.isfinite(seconds))
    if not timed.size:
        raise ValueError("no NMEA sentence tells the time; GGA, RMC, GLL or ZDA is wanted")
    unrolled = unroll_days(seconds)
    dated = next((k for k in timed.tolist() if rows[k].day is not None), None)
    if dated is None:
        first_midnight = nearest_day(float(unrolled[timed[0]]), near)
    else:
        day = rows[dated].day
        assert day is not None
        first_midnight = midnight(day) + float(seconds[dated] - unrolled[dated])
    if come_in_bursts([row.kind for row in rows], seconds):
        return first_midnight + times_of_bursts(unrolled)
    return first_midnight + times_of_places(unrolled, np.array([row.line for row in rows], dtype=np.float64))


def _parse(number: int, line: str) -> _Row | bool | None:
    """What a line says; None where it holds no sentence that is known, False where that is damaged."""
    match = _SENTENCE.search(line)
    if match is None:
        return None
    words = match[1].split(",")
    kind = words[0] if words[0] == "PASHR" else words[0][-3:]
    if kind not in _READERS:
        return None
    if match[2] and reduce(lambda a, c: a ^ ord(c), match[1], 0) != int(match[2], 16):
        return False
    row = _Row(number, kind)
    try:
        _READERS[kind](words, row)
    except (ValueError, IndexError):
        return False
    return row


def _number(text: str) -> float:
    """A number; nothing that is not finite is one."""
    value = float(text)
    if not np.isfinite(value):
        raise ValueError(f"a finite number is wanted, got {text!r}")
    return value


def _angle(text: str, hemisphere: str) -> float:
    """Degrees of ``dddmm.mmmm`` and a letter."""
    point = text.index(".") if "." in text else len(text)
    value = _number(text[: point - 2]) + _number(text[point - 2 :]) / 60
    return -value if hemisphere in "SW" and hemisphere else value


def _position(row: _Row, words: Sequence[str]) -> None:
    latitude, longitude = _angle(words[0], words[1]), _angle(words[2], words[3])
    if abs(latitude) > 90 or abs(longitude) > 360:
        raise ValueError(f"a position on the Earth is wanted, got {latitude}, {longitude}")
    row.values |= {"latitude": latitude, "longitude": longitude}


def _gga(words: list[str], row: _Row) -> None:
    row.second = second_of_day(words[1])
    if words[6] not in ("", "0"):
        _position(row, words[2:6])


def _rmc(words: list[str], row: _Row) -> None:
    row.second = second_of_day(words[1])
    row.day = date(2000 + int(words[9][4:6]), int(words[9][2:4]), int(words[9][:2])) if words[9] else None
    if words[2] == "A":
        _position(row, words[3:7])
        row.values |= {"speed": _number(words[7]) * _KNOT} if words[7] else {}


def _gll(words: list[str], row: _Row) -> None:
    row.second = second_of_day(words[5])
    if words[6] != "V":
        _position(row, words[1:5])


def _zda(words: list[str], row: _Row) -> None:
    row.second, row.day = second_of_day(words[1]), date(int(words[4]), int(words[3]), int(words[2]))


def _hdt(words: list[str], row: _Row) -> None:
    row.values["yaw"] = _yaw(_number(words[1]))


def _ths(words: list[str], row: _Row) -> None:
    if words[2] != "V":
        row.values["yaw"] = _yaw(_number(words[1]))


def _hdg(words: list[str], row: _Row) -> None:
    """Magnetic heading with deviation and variation; without variation it says nothing of true north."""
    deviation = (-1 if words[3] == "W" else 1) * _number(words[2] or "0")
    variation = (-1 if words[5] == "W" else 1) * _number(words[4])
    row.values["yaw"] = _yaw(_number(words[1]) + deviation + variation)


def _vtg(words: list[str], row: _Row) -> None:
    if words[5]:
        row.values["speed"] = _number(words[5]) * _KNOT
    elif words[7]:
        row.values["speed"] = _number(words[7]) / 3.6


def _dpt(words: list[str], row: _Row) -> None:
    row.values["altitude"] = _number(words[1])


def _dbt(words: list[str], row: _Row) -> None:
    row.values["altitude"] = _number(words[3])


def _pashr(words: list[str], row: _Row) -> None:
    """Time, true heading, roll (starboard down), pitch (nose up) [deg]."""
    row.second = second_of_day(words[1])
    roll, pitch = np.radians(_number(words[4])), -np.radians(_number(words[5]))
    row.values |= {"roll": float(roll), "pitch": float(pitch)}
    row.values |= {"yaw": _yaw(_number(words[2]))} if words[2] else {}


def _yaw(heading: float) -> float:
    return float(yaw_from_heading(np.radians(heading)))


_READERS: dict[str, Callable[[list[str], _Row], None]] = {
    "GGA": _gga,
    "RMC": _rmc,
    "GLL": _gll,
    "ZDA": _zda,
    "HDT": _hdt,
    "HDM": _hdt,
    "THS": _ths,
    "HDG": _hdg,
    "VTG": _vtg,
    "DPT": _dpt,
    "DBT": _dbt,
    "PASHR": _pashr,
}
