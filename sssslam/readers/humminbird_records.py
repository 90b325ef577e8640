"""Humminbird records: where the pings of a `.SON` file lie.

A record starts with C0 DE AB 21. Its header is a list of numbers, each behind a tag of one byte; tags from 0x80 on have
four bytes, lower ones have one. The last tag, 0xA0, holds the number of samples; 0x21 ends the header, and samples of
one byte follow. All numbers are big endian. Models differ in their tags, so the layout is read off the first record.
"""

import mmap
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from frontend.arrays import AnyArray, BoolArray, IntArray
from sssslam.readers.layout import gather
from sssslam.readers.skipped import Skipped, find_skipped

MAGIC = b"\xc0\xde\xab\x21"
NUMBER, TIME, EAST, NORTH, HEADING, SPEED, DEPTH, BEAM, FREQUENCY = 0x80, 0x81, 0x82, 0x83, 0x84, 0x85, 0x87, 0x50, 0x92
_N_SAMPLES, _END = 0xA0, 0x21
_WIDE_TAGS = 0x80
_MAX_HEADER = 512
_WANTED = (TIME, EAST, NORTH, BEAM, _N_SAMPLES)


@dataclass(frozen=True)
class Records:
    """The whole records of a file, in its order.

    Parameters
    ----------
    header : structured ndarray, shape (K,)
        Their headers; the name of a field is its tag, as `field` gives it.
    offset : ndarray of int, shape (K,)
        Where the samples start [bytes].
    n_samples : ndarray of int, shape (K,)
        Number of samples.
    skipped : Skipped
        What belongs to no whole record.
    """

    header: AnyArray
    offset: IntArray
    n_samples: IntArray
    skipped: Skipped

    def __getitem__(self, rows: AnyArray) -> "Records":
        return Records(self.header[rows], self.offset[rows], self.n_samples[rows], self.skipped)

    def field(self, tag: int) -> IntArray:
        """The numbers behind a tag, unsigned as in the file; zeros if this model does not write it."""
        known = _name(tag) in (self.header.dtype.names or ())
        return self.header[_name(tag)].astype(np.int64) if known else np.zeros(len(self.header), dtype=np.int64)


def _name(tag: int) -> str:
    return f"tag_{tag:02x}"


def read_records(data: mmap.mmap) -> Records:
    """Find the records of a file, over damaged places.

    Parameters
    ----------
    data : mmap
        The file.

    Returns
    -------
    records : Records
        Those whose tags all stand where the first record has them and whose samples end before the next record.

    Raises
    ------
    ValueError
        If no record is whole, or the records lack time, position or beam.
    """
    starts = np.fromiter((m.start() for m in re.finditer(re.escape(MAGIC), data)), np.int64)
    layout, tags = next(filter(None, (_layout_at(data, start) for start in starts[:100].tolist())), (None, None))
    if layout is None or tags is None:
        raise ValueError("no whole record header (C0 DE AB 21 ... A0 nnnn 21) is among the first 100; a SON is wanted")
    _check_tags(layout, int(starts[0]))
    starts = starts[starts + layout.itemsize <= len(data)]
    starts = starts[_has_tags(data, starts, tags)]
    header = gather(data, starts, layout)
    n_samples = header[_name(_N_SAMPLES)].astype(np.int64)
    offset = starts + layout.itemsize
    is_whole = offset + n_samples <= np.append(starts[1:], len(data))
    rows = np.flatnonzero(is_whole)
    skipped = find_skipped(starts[rows], layout.itemsize + n_samples[rows], 0, len(data))
    return Records(header[rows], offset[rows], n_samples[rows], skipped)


def _layout_at(data: mmap.mmap, start: int) -> tuple[np.dtype[Any], dict[int, int]] | None:
    """The layout of the record at a place, and which byte stands where in its header; None if it has no end."""
    head = data[start : start + _MAX_HEADER]
    position, fields = len(MAGIC), [("magic", "V4")]
    tags: dict[int, int] = {}
    while position + 6 <= len(head):
        tag = head[position]
        if tag in tags.values():
            return None
        tags[position] = tag
        fields += [(f"place_{position}", "u1"), (_name(tag), ">u4" if tag >= _WIDE_TAGS else "u1")]
        position += 5 if tag >= _WIDE_TAGS else 2
        if tag == _N_SAMPLES:
            layout = np.dtype([*fields, ("end", "u1")])
            return (layout, {**tags, position: _END}) if head[position] == _END else None
    return None


def _check_tags(layout: np.dtype[Any], start: int) -> None:
    missing = [f"0x{tag:02x}" for tag in _WANTED if _name(tag) not in (layout.names or ())]
    if missing:
        raise ValueError(
            f"the records, first at byte {start}, lack the tags {', '.join(missing)}; time, position, beam and number"
            " of samples are wanted"
        )


def _has_tags(data: mmap.mmap, starts: IntArray, tags: dict[int, int]) -> BoolArray:
    """Whether the tags of the layout stand behind each start."""
    content = np.frombuffer(data, np.uint8)
    is_record = np.ones(len(starts), dtype=np.bool_)
    for place, tag in tags.items():
        is_record &= content[starts + place] == tag
    return is_record
