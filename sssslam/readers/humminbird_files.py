"""Humminbird files: which `.SON` files belong to a dive, and when it started.

A unit writes `NAME.DAT` and, in a folder `NAME` beside it, a `B00n.SON` and an index `B00n.IDX` a beam. The beam is
told by the records; the index holds nothing that the records do not.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sssslam.readers.humminbird_records import BEAM, MAGIC, read_records
from sssslam.readers.xtf_packets import map_file

# Size of a DAT: byte order, and what its code of the water means (the older models, and those since the Solix).
_OLD = {0: "fresh", 1: "salt", 2: "salt"}
_NEW = {1: "fresh", 2: "salt", 3: "salt"}
_KINDS = {64: (">", _OLD), 96: ("<", _NEW), 100: ("<", _NEW)}
_NAME = slice(32, 44)
PORT, STARBOARD = 2, 3
_MAX_SON_FILES = 64


@dataclass(frozen=True)
class DiveFiles:
    """The files of one dive.

    Parameters
    ----------
    port, starboard : Path or None
        The SON files of the side beams; None for a side that was not recorded.
    dat : Path or None
        The file that describes the dive.
    strays : tuple of str
        Names of SON files beside them that do not start like one, each with the reason.
    """

    port: Path | None
    starboard: Path | None
    dat: Path | None
    strays: tuple[str, ...] = ()


@dataclass(frozen=True)
class Description:
    """What a DAT file says.

    Parameters
    ----------
    start : int
        Seconds since 1970 at the start of the recording; 0 where unknown.
    water : str
        ``fresh``, ``salt`` or ``unknown``.
    """

    start: int = 0
    water: str = "unknown"


def is_dat(head: bytes) -> bool:
    """Whether a file is a DAT: of one of three sizes, with the name of the recording in it.

    Parameters
    ----------
    head : bytes
        The start of the file, all of it if it is short.

    Returns
    -------
    is_dat : bool
        True for a DAT.
    """
    return len(head) in _KINDS and head[_NAME].rstrip(b"\0 \r\n").upper().endswith(b".SON")


def read_description(content: bytes) -> Description:
    """Read a DAT file.

    Parameters
    ----------
    content : bytes
        All of it.

    Returns
    -------
    description : Description
        The start and the water.
    """
    order, waters = _KINDS[len(content)]
    (start,) = struct.unpack_from(f"{order}i", content, 20)
    return Description(max(start, 0), waters.get(content[1], "unknown"))


def find_files(path: Path) -> DiveFiles:
    """Find the files of the dive that one of them belongs to.

    Parameters
    ----------
    path : Path
        A DAT or a SON file.

    Returns
    -------
    files : DiveFiles
        The dive.

    Raises
    ------
    ValueError
        If no folder with side beams is found, or two files claim one beam.
    """
    content = path.read_bytes() if path.stat().st_size in _KINDS else b""
    if is_dat(content):
        folders = [path.parent / path.stem, path.parent / _recorded_name(content), path.parent]
        found = [sons for sons in map(_son_files, folders) if sons]
        return _dive(path, next((sons for sons in found if "" in sons.values()), found[0] if found else {}), path)
    sons = _son_files(path.parent)
    return _dive(path, sons if "" in sons.values() else {path: ""}, _dat_of(path.parent))


def _recorded_name(content: bytes) -> str:
    """The name of the recording as the unit gave it, made safe for a path."""
    name = content[_NAME].rstrip(b"\0 \r\n")[:-4].decode("ascii", "replace")
    return name if name.isalnum() else "-"


def _son_files(folder: Path) -> dict[Path, str]:
    """The SON files of a folder, whatever the letters of their suffix, and why one is none; empty for one that is."""
    if not folder.is_dir():
        return {}
    named = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".son" and p.is_file())
    return {p: _why_none(p) for p in named[:_MAX_SON_FILES]}


def _why_none(path: Path) -> str:
    """Why a file does not start like a SON; empty where it does."""
    with path.open("rb") as file:
        head = file.read(len(MAGIC))
    return "" if head == MAGIC else f"starts with the bytes {head.hex(' ')}" if head else "is empty"


def _dat_of(folder: Path) -> Path | None:
    """The DAT of a folder of SON files: beside the folder under its name, or the only one in it."""
    beside = [p for p in folder.parent.iterdir() if p.suffix.lower() == ".dat" and p.stem == folder.name]
    inside = [p for p in folder.iterdir() if p.suffix.lower() == ".dat"]
    found = [p for p in (beside or inside) if p.is_file() and p.stat().st_size in _KINDS and is_dat(p.read_bytes())]
    return found[0] if len(found) == 1 else None


def _dive(path: Path, sons: dict[Path, str], dat: Path | None) -> DiveFiles:
    beams: dict[int, Path] = {}
    strays = [f"{son.name} {why}" for son, why in sons.items() if why]
    met = []
    for son in (son for son, why in sons.items() if not why):
        beam, what = _beam(son)
        met.append(f"{son.name} {what}")
        if beam in (PORT, STARBOARD) and beam in beams:
            raise ValueError(f"{beams[beam].name} and {son.name} both hold beam {beam}; one dive in a folder is wanted")
        beams[beam] = son
    if not {PORT, STARBOARD} & beams.keys():
        folder = path.parent / path.stem if dat == path else path.parent
        listing = ", ".join([*met, *strays]) or "no SON file"
        raise ValueError(f"{listing} found in or beside {folder}; SON files of beam 2 or 3 (side imaging) are wanted")
    return DiveFiles(beams.get(PORT), beams.get(STARBOARD), dat, tuple(strays))


def _beam(son: Path) -> tuple[int, str]:
    """The beam of most records of a SON file, -1 where no record is whole; and what to tell the user of it."""
    try:
        beams = np.sort(read_records(map_file(son)).field(BEAM))
    except ValueError as error:
        return -1, f"({error})"
    return (int(beams[len(beams) // 2]), f"beam {beams[len(beams) // 2]}") if beams.size else (-1, "(no whole record)")
