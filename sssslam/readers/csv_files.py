"""CSV: recordings as a table, one row a ping.

Lines at the start that begin with ``#`` may say ``# name: value`` for what holds for all pings. The first line without
``#`` names the columns; ``port_0``, ``port_1`` ... and ``starboard_0`` ... are samples, near end first, and stand
behind the others. The other names are those of `sssslam.readers.named_values`. An empty cell is unknown. The comments
and the first name of a sample must lie within the first 1024 bytes, for by them the format is told.
"""

import mmap
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from frontend.arrays import Float32Array, FloatArray
from frontend.recording import Recording
from sssslam.readers.dives import Pings, read_dives
from sssslam.readers.named_values import ARMS, NUMBERS, ORIGIN, QUANTITY, SERIES, as_samples, make_pings

_SAMPLE = re.compile(r"(port|starboard)_(\d{1,6})")
_SETTING = re.compile(r"#\s*(\w+)\s*[:=]\s*(.*?)\s*")
_EMPTY = re.compile(r"(?<=,)(?=\s*(?:,|$))|^(?=\s*,)")


def read_csv_files(paths: Sequence[Path]) -> list[Recording]:
    """Read tables of pings.

    Parameters
    ----------
    paths : sequence of Path
        The files.

    Returns
    -------
    recordings : list of Recording
        One a file, in the order of time.

    Raises
    ------
    ValueError
        If a file gives no recording.
    """
    return read_dives(paths, _read_pings)


def _read_pings(path: Path, data: mmap.mmap) -> Pings:
    del path  # a table is one file
    try:
        lines = bytes(data).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise ValueError(f"byte {error.start} is no text in UTF-8; a table in UTF-8 is wanted") from None
    first = next((k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")), len(lines) - 1)
    numbers, quantity = _settings(lines[:first])
    names = _names(lines[first])
    _check_names(names)
    table = _numbers(lines, first, len(names))
    series = {name: table[:, names.index(name)].copy() for name in SERIES if name in names}
    return make_pings(_sides(table, names), series, numbers, quantity)


def _names(line: str) -> list[str]:
    return [name.strip().strip('"').lower() for name in line.split(",")]


def _check_names(names: list[str]) -> None:
    twice = sorted({name for name in names if name and names.count(name) > 1}) if len(set(names)) < len(names) else []
    if twice:
        raise ValueError(f"the column {twice[0]!r} is there more than once; one is wanted")


def _settings(lines: Sequence[str]) -> tuple[dict[str, FloatArray], str]:
    """What comments say of the sonar and the frame; other comments are for people."""
    numbers, quantity = {}, "unknown"
    for number, line in enumerate(lines, 1):
        match = _SETTING.fullmatch(line.strip())
        name = match[1].lower() if match else ""
        if match and name == QUANTITY:
            quantity = match[2].lower()
        elif match and name in (*NUMBERS, *ARMS, *ORIGIN):
            try:
                numbers[name] = np.array([float(word) for word in re.split(r"[\s,;]+", match[2])])
            except ValueError:
                raise ValueError(f"line {number}: {name} is {match[2][:40]!r}; numbers are wanted") from None
    return numbers, quantity


def _numbers(lines: Sequence[str], first: int, n_columns: int) -> FloatArray:
    """The rows behind the header; a last row that was cut off is left out."""
    rows = [(k, _EMPTY.sub("nan", line)) for k, line in enumerate(lines[first + 1 :], first + 2) if line.strip()]
    rows = [row for row in rows if not row[1].startswith("#")]
    if rows and rows[-1][1].count(",") < n_columns - 1:
        rows = rows[:-1]
    if not rows:
        raise ValueError("the table has no whole row; at least one ping is wanted")
    for number, row in rows:
        if row.count(",") != n_columns - 1:
            raise ValueError(f"line {number} has {row.count(',') + 1} cells; {n_columns} are wanted, as in the header")
    try:
        return np.loadtxt([row for _, row in rows], delimiter=",", ndmin=2, comments=None)
    except ValueError as error:
        raise ValueError(f"a cell of the rows from line {rows[0][0]} on is no number ({error})") from None


def _sides(table: FloatArray, names: Sequence[str]) -> tuple[Float32Array, Float32Array]:
    """The samples of both sides, in the order of their numbers; NaN for one that the table lacks."""
    columns: dict[str, list[tuple[int, int]]] = {"port": [], "starboard": []}
    for k, name in enumerate(names):
        if match := _SAMPLE.fullmatch(name):
            columns[match[1]].append((int(match[2]), k))
    n_samples = max(len(column) for column in columns.values())
    sides = []
    for side, column in columns.items():
        numbers = [number for number, _ in sorted(column)]
        if column and numbers != list(range(n_samples)):
            raise ValueError(
                f"{side} has {len(numbers)} columns up to {side}_{numbers[-1]}; 0 to {n_samples - 1} wanted"
            )
        found = table[:, [k for _, k in sorted(column)]] if column else np.full((len(table), n_samples), np.nan)
        sides.append(as_samples(found))
    return sides[0], sides[1]
