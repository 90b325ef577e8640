"""Tables of navigation: CSV and its kin, whose header names the columns and may name their units."""

import re
from collections.abc import Callable, Sequence
from datetime import date

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import yaw_from_heading
from sssslam.navigation.log import NavigationLog
from sssslam.navigation.moments import midnight, moment, nearest_day, second_of_day, unroll_days
from sssslam.navigation.series import make_series

# What columns are called, in lower case and without unit.
_NAMES = {
    "time": "time timestamp t utc datetime date_time time_utc utc_time unix_time unixtime epoch seconds sec stamp",
    "date": "date day",
    "latitude": "latitude lat",
    "longitude": "longitude lon long lng",
    "x": "x east x_east pos_x",
    "y": "y north y_north pos_y",
    "easting": "easting utm_easting utm_e utm_x",
    "northing": "northing utm_northing utm_n utm_y",
    "z": "z up",
    "heading": "heading hdg true_heading heading_true compass",
    "yaw": "yaw",
    "roll": "roll",
    "pitch": "pitch",
    "depth": "depth",
    "altitude": "altitude altimeter height_above_seafloor",
    "speed": "speed sog speed_over_ground velocity",
}
_COLUMN = {word: name for name, words in _NAMES.items() for word in words.split()}
_UNITS = {
    **dict.fromkeys(("deg", "degree", "degrees", "°"), float(np.pi / 180)),
    **dict.fromkeys(("rad", "radian", "radians"), 1.0),
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters", "m/s", "mps", "s", "sec"), 1.0),
    **dict.fromkeys(("km/h", "kmh", "kph"), 1 / 3.6),
    **dict.fromkeys(("kn", "kt", "kts", "knot", "knots"), 1852 / 3600),
}
_ANGLES = ("heading", "yaw", "roll", "pitch")
_UNKNOWN = ("", "nan", "na", "n/a", "null", "none", "-", "--")
_HEADING = re.compile(r"^\s*(?P<name>[^\[(]*?)\s*(?:[\[(]\s*(?P<unit>[^\])]*?)\s*[\])])?\s*$")


def looks_like_table(first_line: str) -> bool:
    """Whether a line is the header of a table with a time.

    Parameters
    ----------
    first_line : str
        The first line of a file that is not empty.

    Returns
    -------
    is_table : bool
        True if some column is a known time.
    """
    columns = [_column(word)[0] for word in _split(first_line.lstrip("# "), _delimiter(first_line))]
    return "time" in columns


def parse_table(lines: Sequence[str], source: str, near: float) -> NavigationLog:
    """Read a table.

    Parameters
    ----------
    lines : sequence of str
        The header and the rows; empty lines and lines that begin with ``#`` are skipped after the header.
    source : str
        Name of the file.
    near : float
        A time of the dive [s]: gives the day to times of day without date.

    Returns
    -------
    log : NavigationLog
        Its known columns.

    Raises
    ------
    ValueError
        In one line: which row or column is wrong.

    Notes
    -----
    Units stand behind a name, ``heading [deg]`` or ``heading_deg``. Without one, time is seconds since 1970 or ISO
    8601; latitude, longitude and heading are degrees; yaw is radians counter-clockwise from east. Roll and pitch follow
    what stands beside them: with yaw radians and nose down, else degrees and nose up.
    """
    first = next(i for i, line in enumerate(lines) if line.strip())
    delimiter = _delimiter(lines[first])
    headings = [_column(word) for word in _split(lines[first].lstrip("# "), delimiter)]
    rows = [
        (number, _split(line, delimiter))
        for number, line in enumerate(lines[first + 1 :], first + 2)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    cells = _Cells(rows, [name for name, _ in headings], delimiter != ",")
    time = _times(cells, near)
    units = {name: unit for name, unit in headings if name}
    values = {name: cells.numbers(name) for name in units if name not in ("time", "date")}
    unused = [word for word, (name, _) in zip(_split(lines[first], delimiter), headings, strict=True) if not name]
    notes = [f"columns not used: {', '.join(word.strip() for word in unused)}"] if unused else []
    series = {name: make_series(time, column) for name, column in _convert(values, units, notes).items()}
    return NavigationLog(source, {name: s for name, s in series.items() if s}, tuple(notes))


class _Cells:
    """The cells of a table by the name of their column; complaints name the line."""

    def __init__(self, rows: Sequence[tuple[int, list[str]]], names: Sequence[str], has_decimal_commas: bool) -> None:
        # A log that was cut off ends in half a row.
        if rows and len(rows[-1][1]) < len(names):
            rows = rows[:-1]
        for number, row in rows:
            if len(row) != len(names):
                raise ValueError(f"line {number} has {len(row)} fields; {len(names)} are wanted, as in the header")
        self.names, self._decimal = names, ("," if has_decimal_commas else ".")
        self._rows = rows

    def words(self, name: str) -> list[tuple[int, str]]:
        """Line number and word of each cell of a column."""
        k = self.names.index(name)
        return [(number, row[k].strip().strip('"')) for number, row in self._rows]

    def numbers(self, name: str) -> FloatArray:
        """A column as numbers; NaN where a cell is empty."""
        return self.read(name, lambda word: float(word.replace(self._decimal, ".")), "a number")

    def read(self, name: str, convert: Callable[[str], float], wanted: str) -> FloatArray:
        """A column through a function; NaN where a cell is empty."""
        values = np.full(len(self._rows), np.nan)
        for k, (number, word) in enumerate(self.words(name)):
            if word.lower() not in _UNKNOWN:
                try:
                    values[k] = convert(word)
                except ValueError:
                    raise ValueError(f"line {number}: {name} is {word[:40]!r}; {wanted} is wanted") from None
        return values


def _delimiter(header: str) -> str:
    """The delimiter that a header has most of; blanks where it has none."""
    return max((",", ";", "\t"), key=header.count) if any(mark in header for mark in ",;\t") else " "


def _split(line: str, delimiter: str) -> list[str]:
    return line.split() if delimiter == " " else line.strip().split(delimiter)


def _column(word: str) -> tuple[str, float]:
    """Which quantity a heading names, "" for none, and the factor to SI of its unit, NaN where it names none."""
    match = _HEADING.match(word.strip().strip('"').lower())
    name, unit = (match["name"], match["unit"]) if match else ("", None)
    name = name.strip().replace(" ", "_")
    stem, _, suffix = name.rpartition("_")
    if unit is None and name not in _COLUMN and suffix in _UNITS:
        name, unit = stem, suffix
    if unit is not None and unit not in _UNITS and _COLUMN.get(name) not in ("time", "date", None):
        raise ValueError(f"the unit of column {word.strip()!r} is unknown; one of {', '.join(_UNITS)} is wanted")
    return _COLUMN.get(name, ""), _UNITS.get(unit, float("nan")) if unit else float("nan")


def _times(cells: _Cells, near: float) -> FloatArray:
    """Times of all rows: a moment, or a time of day with the date of its row or of the dive."""
    words = [word for _, word in cells.words("time")]
    is_time_of_day = bool(words) and re.fullmatch(r"\d{1,2}:\d{2}(:\d{2}(\.\d*)?)?", words[0]) is not None
    if not is_time_of_day:
        return cells.read("time", moment, "seconds since 1970 or ISO 8601")
    seconds = cells.read("time", second_of_day, "a time of day")
    if "date" in cells.names:
        return seconds + cells.read("date", _midnight_of, "a date as YYYY-MM-DD")
    unrolled = unroll_days(seconds)
    known = unrolled[np.isfinite(unrolled)]
    return unrolled + (nearest_day(float(known[0]), near) if known.size else 0.0)


def _midnight_of(word: str) -> float:
    return midnight(date.fromisoformat(word.replace("/", "-")))


def _convert(values: dict[str, FloatArray], units: dict[str, float], notes: list[str]) -> dict[str, FloatArray]:
    """Columns in the units and directions of the house; what had to be assumed is noted."""
    is_nautical = "yaw" not in values
    degree = float(np.pi / 180)
    usual = {"heading": degree, "yaw": 1.0, "roll": degree if is_nautical else 1.0}
    usual["pitch"] = usual["roll"]
    converted = {}
    for name, column in values.items():
        unit = units[name]
        if np.isnan(unit):
            unit = usual.get(name, 1.0)
            if name in _ANGLES and np.nanmax(np.abs(column), initial=0.0) * (unit / degree) > 720:
                raise ValueError(
                    f"{name} goes up to {np.nanmax(np.abs(column)):.4g} rad; name its unit, as {name} [deg]"
                )
        is_place = name in ("latitude", "longitude")
        converted[name] = column if is_place else column * unit
    if is_nautical and "pitch" in converted:
        converted["pitch"] = -converted["pitch"]
    heading = converted.pop("heading", None)
    if heading is not None and is_nautical:
        converted["yaw"] = yaw_from_heading(heading)
        if np.nanmax(np.abs(values["heading"]), initial=0.0) <= 2 * np.pi and np.isnan(units["heading"]):
            notes.append("heading stays below 6.3 and is taken for degrees; heading [rad] in the header says otherwise")
    return converted
