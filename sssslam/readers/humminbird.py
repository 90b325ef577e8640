"""Humminbird Side Imaging: `.DAT` with `.SON` files, the sonar of many small boats."""

import hashlib
import mmap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frontend.arrays import Float32Array, IntArray
from frontend.recording import Recording, SonarGeometry
from sssslam.readers.dives import Pings, read_dives
from sssslam.readers.humminbird_files import PORT, STARBOARD, Description, DiveFiles, find_files, read_description
from sssslam.readers.humminbird_navigation import read_navigation
from sssslam.readers.humminbird_records import BEAM, FREQUENCY, TIME, Records, read_records
from sssslam.readers.lines import fill_width, gather_lines, nearest_in_time, plausible_lengths
from sssslam.readers.xtf_packets import map_file

# Time between samples [s]. No file holds it; users take a pixel of 2 / pi (c / (0.108 m 455 kHz)) metres, and soundings
# agree with that within a tenth.
_SAMPLE_INTERVAL = 4 / (np.pi * 0.108 * 455e3)
# Sound at 15 degrees C [m/s]; the unit's temperature is not in the file.
_SOUND_SPEEDS = {"fresh": 1466.0, "salt": 1507.0, "unknown": 1480.0}
_MATCH_TOLERANCE = 0.02


@dataclass(frozen=True)
class _Side:
    """The records of one side."""

    name: str
    data: mmap.mmap
    records: Records


def read_humminbird_files(paths: Sequence[Path]) -> list[Recording]:
    """Read Humminbird dives into one local frame.

    Parameters
    ----------
    paths : sequence of Path
        DAT or SON files; several of one dive count once.

    Returns
    -------
    recordings : list of Recording
        One a dive, in the order of time.

    Raises
    ------
    ValueError
        If a dive gives no recording.
    """
    dives: dict[DiveFiles, Path] = {}
    for path in paths:
        dives.setdefault(_find(path), path)
    by_path = {path: files for files, path in dives.items()}
    return read_dives(list(by_path), lambda path, _: _read_pings(by_path[path]))


def _find(path: Path) -> DiveFiles:
    try:
        return find_files(path)
    except OSError as error:
        raise ValueError(f"{path}: its dive cannot be read ({error.strerror}); readable files are wanted") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _read_pings(files: DiveFiles) -> Pings:
    port, starboard = (_read_side(path, beam) for path, beam in ((files.port, PORT), (files.starboard, STARBOARD)))
    main = port or starboard
    if main is None:
        raise ValueError("no side beam holds a whole record; at least one ping is wanted")
    rows = _matched(port, starboard)
    lines = fill_width(*(_lines(side, k, len(rows[0])) for side, k in zip((port, starboard), rows, strict=True)))
    description = read_description(files.dat.read_bytes()) if files.dat else Description()
    kept = main.records[rows[0] if port else rows[1]]
    sound_speed = np.full(len(kept.offset), _SOUND_SPEEDS[description.water])
    n_dropped = max(len(side.records.offset) for side in (port, starboard) if side) - len(kept.offset)
    return Pings(
        port=lines[0],
        starboard=lines[1],
        sample_spacing=sound_speed * _SAMPLE_INTERVAL / 2,
        sound_speed=sound_speed,
        stamp=description.start + kept.field(TIME) / 1e3,
        navigation=read_navigation(kept),
        sonar=SonarGeometry(frequency=_frequency(kept)),
        notes=(*_notes(files, description, n_dropped), *_damage([side for side in (port, starboard) if side])),
        n_dropped=n_dropped,
        sha256=_sha256([path for path in (files.dat, files.port, files.starboard) if path]),
    )


def _read_side(path: Path | None, beam: int) -> _Side | None:
    """The records of one beam that are of a plausible length; None if there are none."""
    if path is None:
        return None
    data = map_file(path)
    records = read_records(data)
    rows = np.flatnonzero(records.field(BEAM) == beam)
    rows = rows[plausible_lengths(records.n_samples[rows])]
    return _Side(path.name, data, records[rows]) if rows.size else None


def _matched(port: _Side | None, starboard: _Side | None) -> tuple[IntArray, IntArray]:
    """Rows of both sides that belong to one ping; all rows of one for a side that is not there."""
    if port and starboard:
        times = [side.records.field(TIME) / 1e3 for side in (port, starboard)]
        return nearest_in_time(times[0], times[1], _MATCH_TOLERANCE)
    every = np.arange(len((port or starboard).records.offset))  # type: ignore[union-attr]
    return every, every


def _lines(side: _Side | None, rows: IntArray, n_pings: int) -> Float32Array:
    """The samples of a side, none where it is not there."""
    if side is None:
        return np.zeros((n_pings, 0), dtype=np.float32)
    return gather_lines(side.data, side.records.offset[rows], side.records.n_samples[rows], "u1")


def _frequency(records: Records) -> float:
    frequency = float(np.median(records.field(FREQUENCY))) if len(records.offset) else np.nan
    return frequency if 1e4 <= frequency <= 1e7 else np.nan


def _notes(files: DiveFiles, description: Description, n_dropped: int) -> list[str]:
    speed = _SOUND_SPEEDS[description.water]
    notes = [
        f"sound speed is not in the file: {speed:g} m/s is assumed, of {description.water} water",
        "positions are whole metres of a Mercator map: their steps are smoothed",
        f"sample spacing is not in the file: samples are taken to be {1e6 * _SAMPLE_INTERVAL:.1f} us apart",
    ]
    if not description.start:
        notes.append("no DAT file tells the start: times are counted from the start of the recording")
    for name in ("port", "starboard"):
        if getattr(files, name) is None:
            notes.append(f"the dive has no {name} file: that side is unknown")
    notes += [f"{stray}: it is left out" for stray in files.strays]
    if n_dropped:
        notes.append(f"pings dropped, for lack of a partner on the other side: {n_dropped}")
    return notes


def _damage(sides: Sequence[_Side]) -> list[str]:
    return [f"{side.name}: {note}" for side in sides for note in side.records.skipped.notes("records")]


def _sha256(paths: Sequence[Path]) -> str:
    """Of the contents one after the other."""
    total = hashlib.sha256()
    for path in paths:
        total.update(path.read_bytes())
    return total.hexdigest()
