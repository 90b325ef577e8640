"""StarFish packets: where each packet of a `.logdoc` lies, and the properties at the head of the file.

No description of the format is public; the layout was worked out from recordings. All numbers are little endian.
A file header of 128 bytes starts with the name of the format. Behind it lie the settings of the logging program: their
number, then path and name ended by zero bytes, a type (1 text in UTF-16 with its size before it, 4 a number) and the
value. Packets follow: four bytes 0xFF, a header of 16 bytes, the payload, and one byte: both, exclusive-ored.
"""

import mmap
import re
import struct
from dataclasses import dataclass

import numpy as np

from frontend.arrays import AnyArray, BoolArray, FloatArray, IntArray
from sssslam.readers.layout import gather
from sssslam.readers.ping_times import seconds_since_1970
from sssslam.readers.skipped import Skipped, find_skipped

PACKET = np.dtype(
    [
        ("sync", "<u4"),
        ("version", "u1"),
        ("opcode", "u1"),
        ("year", "<u2"),
        ("month", "u1"),
        ("day", "u1"),
        ("hour", "u1"),
        ("minute", "u1"),
        ("millisecond", "<u2"),
        ("device", "u1"),
        ("kind", "u1"),
        ("size", "<u4"),
    ]
)
_SYNC = re.compile(rb"\xff{4}\x01", re.DOTALL)
_SYNC_SIZE, _CHECK_SIZE = 4, 1
_PROPERTIES, _PROPERTY = 128, struct.Struct("<II")
_TEXT, _NUMBER = 1, 4


@dataclass(frozen=True)
class Packets:
    """The whole packets of a file, in its order.

    Parameters
    ----------
    offset : ndarray of int, shape (K,)
        Where their payloads start [bytes].
    header : ndarray of PACKET, shape (K,)
        Their headers.
    skipped : Skipped
        What belongs to none, from the first sync on.
    """

    offset: IntArray
    header: AnyArray
    skipped: Skipped

    def of(self, opcode: int, size: int) -> "Packets":
        """The packets of one kind that are at least of a size [bytes]."""
        rows = np.flatnonzero((self.header["opcode"] == opcode) & (self.header["size"] >= size))
        return Packets(self.offset[rows], self.header[rows], self.skipped)


def index_packets(data: mmap.mmap) -> Packets:
    """Find the packets of a file: those whose check byte is right, over whatever lies between.

    Parameters
    ----------
    data : mmap
        The file.

    Returns
    -------
    packets : Packets
        Its whole packets; where two overlap, the first.
    """
    starts = np.fromiter((m.start() for m in _SYNC.finditer(data)), np.int64)
    starts = starts[starts + PACKET.itemsize + _CHECK_SIZE <= len(data)]
    if not starts.size:
        return Packets(starts, np.zeros(0, PACKET), Skipped())
    headers = gather(data, starts, PACKET)
    ends = starts + PACKET.itemsize + headers["size"].astype(np.int64) + _CHECK_SIZE
    fits = np.flatnonzero(ends <= len(data))
    whole = fits[_are_undamaged(data, starts[fits], ends[fits])]
    kept = whole[_without_overlap(starts[whole], ends[whole])]
    skipped = find_skipped(starts[kept], (ends - starts)[kept], int(starts[0]), len(data))
    return Packets(starts[kept] + PACKET.itemsize, headers[kept], skipped)


def _are_undamaged(data: mmap.mmap, starts: IntArray, ends: IntArray) -> BoolArray:
    """Whether the bytes of each packet behind its sync, the last of which checks them, cancel out."""
    content = np.frombuffer(data, np.uint8)
    running = np.bitwise_xor.accumulate(content)
    return np.asarray(running[ends - 1] == running[starts + _SYNC_SIZE - 1])


def _without_overlap(starts: IntArray, ends: IntArray) -> IntArray:
    """The packets that do not start inside the one kept before."""
    kept, free = [], 0
    for k, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        if start >= free:
            kept.append(k)
            free = end
    return np.array(kept, dtype=np.int64)


def stamps(header: AnyArray) -> FloatArray:
    """Times of packets.

    Parameters
    ----------
    header : ndarray of PACKET, shape (K,)
        Their headers.

    Returns
    -------
    stamp : ndarray, shape (K,)
        Seconds since 1970, by the clock of the logging computer; NaN where a field is out of its range.
    """
    names = ("year", "month", "day", "hour", "minute")
    fields = [header[name].astype(np.float64) for name in names]
    return seconds_since_1970(np.stack([*fields, header["millisecond"] / 1e3]))


def read_properties(data: mmap.mmap, end: int) -> dict[str, str]:
    """Read the settings of the logging program.

    Parameters
    ----------
    data : mmap
        The file.
    end : int
        Where the packets start [bytes].

    Returns
    -------
    properties : dict of str to str
        Values by path and name; those before the first damage.
    """
    properties: dict[str, str] = {}
    area = bytes(data[_PROPERTIES:end])
    position = 4
    while (found := _property_at(area, position)) is not None:
        name, value, position = found
        properties[name] = value
    return properties


def _property_at(area: bytes, position: int) -> tuple[str, str, int] | None:
    """Name, value and end of the property at a place; None behind the last."""
    path_end = area.find(b"\0", position)
    name_end = area.find(b"\0", path_end + 1)
    start = name_end + 1 + _PROPERTY.size
    if path_end <= position or name_end < 0 or start > len(area):
        return None
    kind, number = _PROPERTY.unpack_from(area, name_end + 1)
    name = f"{_text(area[position:path_end])}\\{_text(area[path_end + 1 : name_end])}"
    if kind == _NUMBER:
        return name, str(number), start
    return (
        (name, area[start : start + number].decode("utf-16-le", "replace"), start + number) if kind == _TEXT else None
    )


def _text(name: bytes) -> str:
    return name.decode("ascii", "replace")
