"""JSF messages: where each message of an EdgeTech file lies.

A message is a header of 16 bytes, which starts with 0x1601 and holds the size of what follows. Byte order is little
endian. The layouts are those of EdgeTech's public description of the format, document 0023492.
"""

import mmap
import struct
from array import array
from dataclasses import dataclass

import numpy as np

from frontend.arrays import AnyArray, IntArray
from sssslam.readers.layout import gather, layout
from sssslam.readers.skipped import Skipped, find_skipped

MAGIC = b"\x01\x16"
HEADER = layout(
    16, {"marker": (0, "<u2"), "type": (4, "<u2"), "subsystem": (7, "u1"), "channel": (8, "u1"), "size": (12, "<i4")}
)
SONAR_DATA, NMEA, PITCH_ROLL = 80, 2002, 2020
_SIZE = struct.Struct("<12xi")
_MAX_SEARCHES = 100_000


@dataclass(frozen=True)
class Messages:
    """The whole messages of a file, in its order.

    Parameters
    ----------
    offset : ndarray of int, shape (K,)
        Where what follows their headers starts [bytes].
    header : ndarray of HEADER, shape (K,)
        Their headers.
    skipped : Skipped
        What belongs to no whole message.
    """

    offset: IntArray
    header: AnyArray
    skipped: Skipped

    def of(self, kind: int, size: int) -> "Messages":
        """The messages of one type with at least so many bytes behind the header."""
        rows = np.flatnonzero((self.header["type"] == kind) & (self.header["size"] >= size))
        return self[rows]

    def __getitem__(self, rows: AnyArray) -> "Messages":
        return Messages(self.offset[rows], self.header[rows], self.skipped)


def index_messages(data: mmap.mmap) -> Messages:
    """Walk through the messages of a file, over damaged places and up to a cut.

    Parameters
    ----------
    data : mmap
        The file.

    Returns
    -------
    messages : Messages
        Those that are whole.
    """
    starts, sizes = array("q"), array("q")
    position, searches = 0, _MAX_SEARCHES
    while position < len(data):
        end = _end_of_message(data, position)
        if end and _is_boundary(data, end):
            following = end
        else:
            # This message or the next is damaged: it is this one if another sound one starts inside it.
            following, searches = _next_message(data, position + 1, searches)
            end = end if end <= following else 0
        if end:
            starts.append(position)
            sizes.append(end - position)
        position = following
    at = np.array(starts, dtype=np.int64)
    skipped = find_skipped(at, np.array(sizes, dtype=np.int64), 0, len(data))
    return Messages(at + HEADER.itemsize, gather(data, at, HEADER), skipped)


def _end_of_message(data: mmap.mmap, position: int) -> int:
    """Where the message at a place ends; 0 if there is none or the file ends before."""
    if position + HEADER.itemsize > len(data) or data[position : position + 2] != MAGIC:
        return 0
    (size,) = _SIZE.unpack_from(data, position)
    end = position + HEADER.itemsize + int(size)
    return end if size >= 0 and end <= len(data) else 0


def _is_boundary(data: mmap.mmap, position: int) -> bool:
    return position == len(data) or data[position : position + 2] == MAGIC


def _next_message(data: mmap.mmap, position: int, searches: int) -> tuple[int, int]:
    """The next place where a message starts that another or the end follows; and the false starts still allowed."""
    while searches > 0 and (position := data.find(MAGIC, position)) >= 0:
        end = _end_of_message(data, position)
        if end and _is_boundary(data, end):
            return position, searches
        position += 1
        searches -= 1
    return len(data), searches
