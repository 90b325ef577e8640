"""Lowrance frames: where the pings of an SL2 or SL3 file lie.

A file header of 8 bytes starts with 2 or 3. Each frame begins with its own place in the file, which tells a frame from
anything else. The layout is that which users of the format have worked out together; all is little endian.
"""

import mmap
from dataclasses import dataclass

import numpy as np

from frontend.arrays import AnyArray, IntArray
from sssslam.readers.layout import gather, layout
from sssslam.readers.skipped import Skipped, find_skipped

SL2 = layout(
    144,
    {
        "Offset": (0, "<u4"),
        "FrameSize": (28, "<u2"),
        "Channel": (32, "<u2"),
        "PacketSize": (34, "<u2"),
        "MinRange": (40, "<f4"),
        "MaxRange": (44, "<f4"),
        "Frequency": (53, "u1"),
        "HardwareTime": (60, "<u4"),
        "Depth": (64, "<f4"),
        "Speed": (100, "<f4"),
        "East": (108, "<i4"),
        "North": (112, "<i4"),
        "Course": (120, "<f4"),
        "Heading": (128, "<f4"),
        "Time": (140, "<u4"),
    },
)
SL3 = layout(
    168,
    {
        "Offset": (0, "<u4"),
        "FrameSize": (8, "<u2"),
        "Channel": (12, "<u2"),
        "MinRange": (20, "<f4"),
        "MaxRange": (24, "<f4"),
        "HardwareTime": (40, "<u4"),
        "PacketSize": (44, "<u4"),
        "Depth": (48, "<f4"),
        "Frequency": (52, "u1"),
        "Speed": (84, "<f4"),
        "East": (92, "<i4"),
        "North": (96, "<i4"),
        "Course": (104, "<f4"),
        "Heading": (112, "<f4"),
        "Time": (124, "<u4"),
    },
)
_FILE_HEADER = 8
_WORD, _CHUNK = 4, 1 << 22


@dataclass(frozen=True)
class Frames:
    """The whole frames of a file, in its order.

    Parameters
    ----------
    header : structured ndarray, shape (K,)
        Their headers, of the layout `SL2` or `SL3`.
    offset : ndarray of int, shape (K,)
        Where the samples start [bytes].
    n_samples : ndarray of int, shape (K,)
        Number of samples, of one byte each.
    skipped : Skipped
        What belongs to no whole frame.
    """

    header: AnyArray
    offset: IntArray
    n_samples: IntArray
    skipped: Skipped

    def __getitem__(self, rows: AnyArray) -> "Frames":
        return Frames(self.header[rows], self.offset[rows], self.n_samples[rows], self.skipped)


def read_frames(data: mmap.mmap) -> Frames:
    """Find the frames of a file, over damaged places.

    Parameters
    ----------
    data : mmap
        The file; its first byte, 2 or 3, tells the layout.

    Returns
    -------
    frames : Frames
        Those that name their own place and hold all their samples; where two overlap, the first.
    """
    dtype = SL3 if data[0] == 3 else SL2
    starts = _places_that_name_themselves(data)
    starts = starts[(starts >= _FILE_HEADER) & (starts + dtype.itemsize <= len(data))]
    header = gather(data, starts, dtype)
    size, n_samples = header["FrameSize"].astype(np.int64), header["PacketSize"].astype(np.int64)
    fits = np.flatnonzero((dtype.itemsize + n_samples <= size) & (starts + size <= len(data)))
    kept, free = [], 0
    for row, start, length in zip(fits.tolist(), starts[fits].tolist(), size[fits].tolist(), strict=True):
        if start >= free:
            kept.append(row)
            free = start + length
    rows = np.array(kept, dtype=np.int64)
    skipped = find_skipped(starts[rows], size[rows], _FILE_HEADER, len(data))
    return Frames(header[rows], starts[rows] + dtype.itemsize, n_samples[rows], skipped)


def _places_that_name_themselves(data: mmap.mmap) -> IntArray:
    """Offsets at which the file holds this very offset, modulo 2**32, as a number of four bytes."""
    found = []
    for start in range(0, len(data), _CHUNK):
        piece = data[start : start + _CHUNK + _WORD - 1]
        for shift in range(min(_WORD, len(piece) - _WORD + 1)):
            words = np.frombuffer(piece, "<u4", (len(piece) - shift) // _WORD, shift)
            places = start + shift + _WORD * np.arange(len(words), dtype=np.int64)
            found.append(places[words == places % (1 << 32)])
    return np.unique(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)
