"""Formats: which reader understands a file, told by its first bytes and never by its name."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path

from frontend.recording import Recording
from sssslam.regular_files import read_head

HEAD_SIZE = 1024
ENTRY_POINTS = "sssslam.readers"

_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Reader:
    """A format that recordings come in; another package offers its own as an entry point of the group `ENTRY_POINTS`.

    Parameters
    ----------
    name : str
        The format, as users call it.
    recognises : callable
        Takes the first `HEAD_SIZE` bytes of a file (or all, if shorter), says whether it is of this format.
    read : callable
        Takes the files of this format and the channels wanted (None: the reader's choice), gives one recording a file
        in any order, or raises a ValueError of one line that starts with the file's name.
    """

    name: str
    recognises: Callable[[bytes], bool]
    read: Callable[[Sequence[Path], str | None], list[Recording]]


# A reader's module is imported when one of its files is read: xarray alone loads longer than the command line.
def _read_xtf(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    from sssslam.readers.xtf import read_xtf_files

    return read_xtf_files(paths, channels)


def _read_netcdf(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    from sssslam.readers.netcdf import read_netcdf

    _refuse_choice(paths, channels, "this container")
    return [read_netcdf(path) for path in paths]


def _read_starfish(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    from sssslam.readers.starfish import read_starfish_files

    _refuse_choice(paths, channels, "a StarFish log")
    return read_starfish_files(paths)


def _read_humminbird(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    from sssslam.readers.humminbird import read_humminbird_files

    _refuse_choice(paths, channels, "a Humminbird dive")
    return read_humminbird_files(paths)


def _read_jsf(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    from sssslam.readers.jsf import read_jsf_files

    return read_jsf_files(paths, channels)


def _read_lowrance(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    from sssslam.readers.lowrance import read_lowrance_files

    return read_lowrance_files(paths, channels)


def _read_npz(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    from sssslam.readers.npz_files import read_npz_files

    _refuse_choice(paths, channels, "a NumPy archive")
    return read_npz_files(paths)


def _read_csv(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    from sssslam.readers.csv_files import read_csv_files

    _refuse_choice(paths, channels, "a table")
    return read_csv_files(paths)


def _refuse_choice(paths: Sequence[Path], channels: str | None, what: str) -> None:
    """Refuse a choice of channels where there is none."""
    if channels is not None:
        raise ValueError(f"{paths[0]}: channels {channels!r} were asked for; {what} holds one pair only")


def _is_xtf(head: bytes) -> bool:
    """An XTF file header: format 123, and zero bytes behind it, since 123 also begins the text of a JSON file."""
    return head[:1] == b"\x7b" and b"\0" in head


def _is_netcdf(head: bytes) -> bool:
    """Signature of HDF5, in which NetCDF-4 is kept, or of a classic NetCDF."""
    return head.startswith((b"\x89HDF\r\n\x1a\n", b"CDF\x01", b"CDF\x02", b"CDF\x05"))


def _is_starfish(head: bytes) -> bool:
    """Name of the format at the start of a StarFish log."""
    return head.startswith(b"StarfishScanlineLog\0")


def _is_humminbird(head: bytes) -> bool:
    """Start of a SON record; or a DAT, which is short and holds a name that ends in .SON."""
    return head.startswith(b"\xc0\xde\xab\x21") or (len(head) in (64, 96, 100) and b".SON" in head[32:46])


def _is_jsf(head: bytes) -> bool:
    """Start of a JSF message; the upper bytes of its size and its reserved bytes are hardly ever anything but zero."""
    return head.startswith(b"\x01\x16") and len(head) >= 16 and head[15] == 0


def _is_lowrance(head: bytes) -> bool:
    """A file header of 8 bytes that starts with 2 or 3, and a first frame that names its own place, 8."""
    return head[:2] in (b"\2\0", b"\3\0") and head[6:12] == b"\0\0\x08\0\0\0"


def _is_npz(head: bytes) -> bool:
    """A ZIP archive whose first entry is an array."""
    return head.startswith(b"PK\x03\x04") and b".npy" in head[:256]


def _is_csv(head: bytes) -> bool:
    """Text whose first line that is no comment names a time and a sample."""
    lines = (line for line in head.removeprefix(b"\xef\xbb\xbf").splitlines() if line.strip() and line[:1] != b"#")
    names = [name.strip(b' "').lower() for name in next(lines, b"").split(b",")]
    return b"time" in names and any(name.startswith((b"port_", b"starboard_")) for name in names)


BUILT_IN = (
    Reader("XTF", _is_xtf, _read_xtf),
    Reader("NetCDF (.nc)", _is_netcdf, _read_netcdf),
    Reader("StarFish", _is_starfish, _read_starfish),
    Reader("Humminbird (DAT or SON)", _is_humminbird, _read_humminbird),
    Reader("JSF", _is_jsf, _read_jsf),
    Reader("Lowrance SL2 or SL3", _is_lowrance, _read_lowrance),
    Reader("NumPy (.npz)", _is_npz, _read_npz),
    Reader("CSV", _is_csv, _read_csv),
)


@cache
def known_readers() -> tuple[Reader, ...]:
    """The readers that come with the package and those that other packages offer, as at the first call.

    Returns
    -------
    readers : tuple of Reader
        The first that recognises a file reads it.
    """
    return (*BUILT_IN, *filter(None, (_load(entry) for entry in entry_points(group=ENTRY_POINTS))))


def _load(entry: object) -> Reader | None:
    """The reader of an entry point; None, with a warning, if it cannot be loaded."""
    try:
        reader = entry.load()  # type: ignore[attr-defined]
    except Exception as error:
        _logger.warning("reader %s cannot be loaded: %s", entry, error)
        return None
    if not isinstance(reader, Reader):
        _logger.warning("reader %s is a %s; a sssslam.readers.Reader is wanted", entry, type(reader).__name__)
        return None
    return reader


def find_reader(path: Path, readers: Sequence[Reader]) -> Reader:
    """The reader of a file.

    Parameters
    ----------
    path : Path
        The file.
    readers : sequence of Reader
        The readers to choose from.

    Returns
    -------
    reader : Reader
        The first that recognises the file.

    Raises
    ------
    ValueError
        If the path is no readable, filled file, or of an unknown format.
    """
    head = read_head(path, HEAD_SIZE, "a recording")
    for reader in readers:
        if reader.recognises(head):
            return reader
    *names, last = (reader.name for reader in readers)
    raise ValueError(f"{path}: the format is unknown ({_first_look(head)}); {', '.join(names)} or {last} is wanted")


def _first_look(head: bytes) -> str:
    """What an unknown file looks like."""
    is_text = not set(head) - set(range(0x20, 0x7F)) - set(b"\t\n\r\f") or not head.strip()
    return "it is text" if is_text else f"it starts with the bytes {head[:4].hex(' ')}"
