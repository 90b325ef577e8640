"""XTF packets: where each ping and each channel block of a file lies.

The layouts are pyxtf's ctypes structures, read as numpy dtypes straight from the mapped file. pyxtf's own reader is not
used: it loops for ever on a record length of zero, gives up at the first damaged packet and beyond six channels, builds
Python objects a ping, and unpickles any index file it finds beside the recording.
"""

import ctypes
import mmap
import struct
from array import array
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyxtf

from frontend.arrays import AnyArray, IntArray
from sssslam.readers.skipped import Skipped, find_skipped


def layout(structure: type[ctypes.Structure]) -> np.dtype[np.void]:
    """The numpy dtype of a ctypes structure, inherited fields included (numpy itself leaves them out).

    Parameters
    ----------
    structure : type
        A packed structure of pyxtf.

    Returns
    -------
    dtype : dtype
        The same fields at the same offsets.
    """
    fields = [f for base in reversed(structure.__mro__) for f in vars(base).get("_fields_", [])]
    offsets = [getattr(structure, f[0]).offset for f in fields]
    names, formats = [f[0] for f in fields], [np.dtype(f[1]) for f in fields]
    return np.dtype(
        {"names": names, "formats": formats, "offsets": offsets, "itemsize": ctypes.sizeof(structure)}  # type: ignore[call-overload]
    )


PING_HEADER = layout(pyxtf.XTFPingHeader)
BLOCK_HEADER = layout(pyxtf.XTFPingChanHeader)
CHANNEL = layout(pyxtf.XTFChanInfo)
# Attitude, navigation, gyros and raw position: each at least 64 bytes long.
_RAW_NAMES = ("attitude", "navigation", "gyro", "sourcetime_gyro", "pos_raw_navigation")
RAW_TYPES = tuple(pyxtf.XTFHeaderType[name].value for name in _RAW_NAMES)
RAW_SIZE = 64
SIDE_TYPES = (pyxtf.XTFChannelType.port.value, pyxtf.XTFChannelType.stbd.value)
SAMPLE_SIZES = (1, 2, 4)
MAX_CHANNELS = 64
FILE_HEADER_SIZE = ctypes.sizeof(pyxtf.XTFFileHeader)

_START = struct.Struct("<HBBHHHI")
_MAGIC_NUMBER = 0xFACE
_MAGIC = struct.pack("<H", _MAGIC_NUMBER)
_SONAR = pyxtf.XTFHeaderType.sonar.value
_MAX_SEARCHES = 100_000


@dataclass(frozen=True)
class FileHeader:
    """What the file header says about the packets.

    Parameters
    ----------
    channels : ndarray of CHANNEL, shape (C,)
        The channel table; unused slots have zero bytes a sample.
    nav_units : int
        Unit of positions: 3 degrees, 0 metres.
    start : int
        Where the packets start [bytes].
    """

    channels: AnyArray
    nav_units: int
    start: int


@dataclass(frozen=True)
class PacketIndex:
    """What lies where among the packets of a file.

    Parameters
    ----------
    pings : ndarray of int, shape (P,)
        Offsets of the whole sonar packets [bytes].
    sizes : ndarray of int, shape (P,)
        Their sizes [bytes].
    n_cut : int
        Sonar packets that the end of the file cuts.
    skipped : Skipped
        What belongs to no whole packet.
    kinds : dict of int to int
        Number of whole packets of each type.
    raw : dict of int to ndarray of int
        Offsets of the packets that hold navigation beside the pings, by type [bytes].
    """

    pings: IntArray
    sizes: IntArray
    n_cut: int
    skipped: Skipped
    kinds: dict[int, int]
    raw: dict[int, IntArray]


def map_file(path: Path) -> mmap.mmap:
    """Map a file that is not empty into memory, for reading.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    data : mmap
        Its bytes.
    """
    with path.open("rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def gather(data: mmap.mmap, offsets: IntArray, dtype: np.dtype[np.void]) -> AnyArray:
    """Read one structure at each of many places.

    Parameters
    ----------
    data : mmap
        The file.
    offsets : ndarray of int, shape (K,)
        Where the structures start [bytes].
    dtype : dtype
        Their layout.

    Returns
    -------
    structures : ndarray of dtype, shape (K,)
        A copy of them.
    """
    n = dtype.itemsize
    windows = np.lib.stride_tricks.sliding_window_view(np.frombuffer(data, np.uint8), n)
    return np.ascontiguousarray(windows[offsets]).view(dtype)[:, 0]


def read_file_header(data: mmap.mmap) -> FileHeader:
    """Read the file header.

    Parameters
    ----------
    data : mmap
        The file.

    Returns
    -------
    header : FileHeader
        Its channels, its unit of positions, and where it ends.

    Raises
    ------
    ValueError
        If the file is shorter than a header.
    """
    start = FILE_HEADER_SIZE
    if len(data) < start:
        raise ValueError(f"the file ends inside its header: {len(data)} bytes, at least {start} are wanted")
    # Beyond six channels the header grows in steps of 1024 bytes, eight channels each.
    last = min(len(data), start + FILE_HEADER_SIZE * (MAX_CHANNELS // 8))
    while start < last and _packet_at(data, start)[1] == 0:
        start += FILE_HEADER_SIZE
    start = start if start < last else FILE_HEADER_SIZE
    first = pyxtf.XTFFileHeader.ChanInfo.offset
    channels = np.frombuffer(data, CHANNEL, (start - first) // CHANNEL.itemsize, first).copy()
    nav_units = np.frombuffer(data, "<u2", 1, pyxtf.XTFFileHeader.NavUnits.offset)
    return FileHeader(channels, int(nav_units[0]), start)


def index_packets(data: mmap.mmap, start: int) -> PacketIndex:
    """Walk through the packets of a file, over damaged places and up to a cut.

    Parameters
    ----------
    data : mmap
        The file.
    start : int
        Where the packets start [bytes].

    Returns
    -------
    index : PacketIndex
        Where the sonar packets are and what else was met.
    """
    view, size = memoryview(data), len(data)
    starts, sizes, kinds = array("q"), array("q"), array("q")
    position, n_cut, searches = start, 0, _MAX_SEARCHES
    while position < size:
        kind, n_bytes = _packet_at(view, position)
        if 0 < n_bytes <= size - position:
            starts.append(position)
            sizes.append(n_bytes)
            kinds.append(kind)
            position += n_bytes
            continue
        # Nothing here: either this place is damaged, or the size of the packet before, which then hides the next one.
        is_after_packet = len(starts) > 0 and starts[-1] + sizes[-1] == position
        following, searches = _next_packet(data, (starts[-1] if is_after_packet else position) + 1, searches)
        if following < position:
            position = starts.pop()
            sizes.pop()
            kinds.pop()
        n_cut += kind == _SONAR and position + n_bytes > size and following == size
        position = following
    table = np.array([starts, sizes, kinds], dtype=np.int64)
    return _sonar_packets(table, n_cut, find_skipped(table[0], table[1], start, size))


def _sonar_packets(table: IntArray, n_cut: int, skipped: Skipped) -> PacketIndex:
    """The index out of where, how long and of which type each whole packet is."""
    is_ping = (table[2] == _SONAR) & (table[1] >= PING_HEADER.itemsize)
    numbers, counts = np.unique(table[2], return_counts=True)
    met = dict(zip(numbers.tolist(), counts.tolist(), strict=True))
    is_whole = table[1] >= RAW_SIZE
    raw = {kind: table[0, is_whole & (table[2] == kind)] for kind in RAW_TYPES if kind in met}
    return PacketIndex(table[0, is_ping], table[1, is_ping], n_cut, skipped, met, raw)


def _packet_at(data: mmap.mmap | memoryview, position: int) -> tuple[int, int]:
    """Type and size of the packet at a position; size 0 where there is none."""
    if position + _START.size > len(data):
        return -1, 0
    magic, kind, _, _, _, _, n_bytes = _START.unpack_from(data, position)
    return (kind, n_bytes) if magic == _MAGIC_NUMBER and n_bytes >= _START.size else (-1, 0)


def _is_boundary(data: mmap.mmap, position: int) -> bool:
    """Whether a packet or the end of the file is at a position."""
    return position == len(data) or data[position : position + 2] == _MAGIC


def _next_packet(data: mmap.mmap, position: int, searches: int) -> tuple[int, int]:
    """The next place that starts a packet followed by another or by the end, and the false starts still allowed."""
    while searches > 0 and (position := data.find(_MAGIC, position)) >= 0:
        _, n_bytes = _packet_at(data, position)
        if n_bytes and _is_boundary(data, position + n_bytes):
            return position, searches
        position += 1
        searches -= 1
    return len(data), searches
