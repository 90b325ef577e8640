"""Lowrance sides: port and starboard, from frames of their own or the halves of composite frames."""

import mmap
from dataclasses import dataclass, fields, replace

import numpy as np

from frontend.arrays import AnyArray, Float32Array, FloatArray, IntArray
from sssslam.readers.layout import as_float64
from sssslam.readers.lines import gather_lines, nearest_in_time, plausible_lengths
from sssslam.readers.lowrance_frames import Frames
from sssslam.readers.xtf_channels import Channel, Pair, Side, choose_pair
from sssslam.readers.xtf_samples import far_end_first, reverse_lines

# Channels of the format; a composite frame is a picture: port from the far end to the nadir, starboard on from there.
_LEFT, _RIGHT, _COMPOSITE = 3, 4, 5
_SOURCES = ((_COMPOSITE, Side.PORT), (_COMPOSITE, Side.STARBOARD), (_LEFT, Side.PORT), (_RIGHT, Side.STARBOARD))
# Code of the frequency: its centre [Hz].
_FREQUENCIES = dict(enumerate((200e3, 50e3, 83e3, 455e3, 800e3, 38e3, 28e3, 170e3, 120e3, 50e3, 35e3)))
_FOOT = 0.3048
_MATCH_TOLERANCE = 0.02


@dataclass(frozen=True)
class SideFrames:
    """What one side recorded.

    Parameters
    ----------
    header : structured ndarray, shape (P,)
        Headers of the frames.
    offset : ndarray of int, shape (P,)
        Where the samples of the side start [bytes].
    n_samples : ndarray of int, shape (P,)
        Number of its samples, of one byte each.
    spacing : ndarray, shape (P,)
        Slant range between them [m].
    """

    header: AnyArray
    offset: IntArray
    n_samples: IntArray
    spacing: FloatArray

    def __getitem__(self, rows: AnyArray) -> "SideFrames":
        return replace(self, **{field.name: getattr(self, field.name)[rows] for field in fields(self)})


def find_sides(frames: Frames) -> list[tuple[Channel, SideFrames]]:
    """Find the sides that a file has.

    Parameters
    ----------
    frames : Frames
        Its frames.

    Returns
    -------
    sides : list of (Channel, SideFrames)
        Those with at least one ping of plausible length and range; the info of a channel is its code in the format.
    """
    sides: list[tuple[Channel, SideFrames]] = []
    for code, name in _SOURCES:
        side = _side(frames, code, name)
        if len(side.offset):
            codes, counts = np.unique(side.header["Frequency"], return_counts=True)
            frequency = _FREQUENCIES.get(int(codes[np.argmax(counts)]), np.nan)
            channel = Channel(len(sides), name, frequency, float(np.median(side.spacing)), np.array(code))
            sides.append((channel, side))
    return sides


def _side(frames: Frames, code: int, name: Side) -> SideFrames:
    rows = np.flatnonzero(frames.header["Channel"] == code)
    header, offset, n_samples = frames.header[rows], frames.offset[rows], frames.n_samples[rows]
    low, high = (as_float64(header[name]) * _FOOT for name in ("MinRange", "MaxRange"))
    if code == _COMPOSITE:
        half = n_samples // 2
        offset = offset if name is Side.PORT else offset + n_samples - half
        # The range runs from minus to plus its extent, or is the extent.
        n_samples, extent = half, np.where(low < 0, (high - low) / 2, high)
    else:
        extent = np.where(np.abs(low) < high / np.maximum(n_samples, 1), high, np.nan)
    spacing = extent / np.maximum(n_samples, 1)
    return SideFrames(header, offset, n_samples, spacing)[
        np.flatnonzero(plausible_lengths(n_samples) & (spacing > 0) & np.isfinite(spacing))
    ]


def choose_sides(
    sides: list[tuple[Channel, SideFrames]], wanted: str | None
) -> tuple[Pair, SideFrames | None, SideFrames | None]:
    """Choose two sides and bring their pings together by time.

    Parameters
    ----------
    sides : list of (Channel, SideFrames)
        The sides of the file, at least one.
    wanted : str or None
        As for `choose_pair`.

    Returns
    -------
    pair : Pair
        The channels.
    port, starboard : SideFrames or None
        As many pings of each; None for a side that the file lacks.
    """
    pair = choose_pair([channel for channel, _ in sides], wanted)
    port, starboard = (None if channel is None else sides[channel.index][1] for channel in (pair.port, pair.starboard))
    if port is None or starboard is None:
        return pair, port, starboard
    times = [side.header["Time"] / 1e3 for side in (port, starboard)]
    rows, other_rows = nearest_in_time(times[0], times[1], _MATCH_TOLERANCE)
    return pair, port[rows], starboard[other_rows]


def read_sides(
    data: mmap.mmap, pair: Pair, port: SideFrames | None, starboard: SideFrames | None, altitude: FloatArray
) -> tuple[Float32Array, Float32Array, list[str]]:
    """Read the samples of both sides, near end first.

    Parameters
    ----------
    data : mmap
        The file.
    pair : Pair
        The channels.
    port, starboard : SideFrames or None
        As many pings of each.
    altitude : ndarray, shape (N,)
        Height above the seafloor [m]; NaN where unknown.

    Returns
    -------
    port, starboard : ndarray of float32, shape (N, ...)
        Samples; none for a side that the file lacks.
    notes : list of str
        Which side was turned round.
    """
    notes = []
    lines: dict[Side, Float32Array] = {}
    for channel, side in ((pair.starboard, starboard), (pair.port, port)):
        if channel is None or side is None:
            continue
        samples = gather_lines(data, side.offset, side.n_samples, "u1")
        judgement = far_end_first(samples, side.n_samples, altitude, side.spacing, lines.get(Side.STARBOARD))
        is_custom = int(channel.info) == _COMPOSITE and channel.side is Side.PORT
        if judgement is True or (judgement is None and is_custom):
            samples = reverse_lines(samples, side.n_samples)
            reason = "the echoes say so" if judgement else "the echoes do not tell, and it is the custom"
            notes.append(f"{channel.side} is stored far end first ({reason}) and was turned round")
        lines[channel.side] = samples
    none = np.zeros((len(altitude), 0), dtype=np.float32)
    return lines.get(Side.PORT, none), lines.get(Side.STARBOARD, none), notes
