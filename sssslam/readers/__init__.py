"""Readers: each format gives a Recording in SI units, radians, ENU."""

from pathlib import Path

from frontend.recording import Recording
from sssslam.readers.formats import Reader, find_reader, known_readers
from sssslam.readers.joining import join

__all__ = ["Reader", "read"]


def read(*paths: str | Path, channels: str | None = None) -> Recording:
    """Read one or more files as one dive.

    Parameters
    ----------
    *paths : str or Path
        Recordings of any format; the content tells which, not the name. Several are joined in the order of their times.
    channels : str or None
        Which channels of a file that has more than one pair: ``"3,4"``, numbers counted from 1 in the order of the
        file, or ``"900kHz"``, the pair next to that frequency. None takes the pair with the finer samples.

    Returns
    -------
    recording : Recording
        The pings that could be used; its notes say what was decided, repaired, assumed or left out.

    Raises
    ------
    ValueError
        If a file gives no recording or the files make no dive; in one line that names the file.
    """
    if not paths:
        raise ValueError("no file was given; at least one recording is wanted")
    readers = known_readers()
    by_reader: dict[int, list[Path]] = {}
    for path in map(Path, paths):
        by_reader.setdefault(readers.index(find_reader(path, readers)), []).append(path)
    return join([recording for k, files in by_reader.items() for recording in readers[k].read(files, channels)])
