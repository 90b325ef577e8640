"""XTF channels: which two of a file make the recording."""

import re
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from frontend.arrays import AnyArray, FloatArray
from sssslam.readers.xtf_blocks import Blocks
from sssslam.readers.xtf_packets import SAMPLE_SIZES, SIDE_TYPES

# A frequency written above this is in hertz; below, in kilohertz, as the format wants (no side-scan reaches 10 MHz).
_KILOHERTZ_LIMIT = 1e4


class Side(StrEnum):
    """Which way a channel looks."""

    PORT = "port"
    STARBOARD = "starboard"


@dataclass(frozen=True)
class Channel:
    """A side-scan channel of an XTF file.

    Parameters
    ----------
    index : int
        Row of the file's channel table, from 0; users count from 1.
    side : Side
        Which way it looks.
    frequency : float
        Centre frequency [Hz]; NaN where unknown.
    sample_spacing : float
        Median slant range between samples [m].
    info : ndarray of CHANNEL, shape ()
        The row of the channel table.
    """

    index: int
    side: Side
    frequency: float
    sample_spacing: float
    info: AnyArray

    def __str__(self) -> str:
        frequency = f" {self.frequency / 1e3:g} kHz" if np.isfinite(self.frequency) else ""
        return f"{self.index + 1} {self.side}{frequency} {1e3 * self.sample_spacing:.3g} mm"


@dataclass(frozen=True)
class Pair:
    """The channels of a recording; a side that the file lacks is None."""

    port: Channel | None
    starboard: Channel | None

    @property
    def channels(self) -> list[Channel]:
        """The channels that are there."""
        return [channel for channel in (self.port, self.starboard) if channel is not None]

    def __str__(self) -> str:
        return " and ".join(str(channel) for channel in self.channels)


def side_scan_channels(table: AnyArray, blocks: Blocks, slant_range: FloatArray) -> list[Channel]:
    """List the side-scan channels that hold samples.

    Parameters
    ----------
    table : ndarray of CHANNEL, shape (C,)
        The channel table of the file.
    blocks : Blocks
        The channel blocks of all pings.
    slant_range : ndarray, shape (B,)
        Slant range of each block [m].

    Returns
    -------
    channels : list of Channel
        In the order of the table.
    """
    channels = []
    for index, info in enumerate(table):
        rows = np.flatnonzero((blocks.channel == index) & (blocks.n_samples > 0) & (slant_range > 0))
        if rows.size and info["TypeOfChannel"] in SIDE_TYPES and info["BytesPerSample"] in SAMPLE_SIZES:
            spacing = float(np.median(slant_range[rows] / blocks.n_samples[rows]))
            side = Side.PORT if info["TypeOfChannel"] == SIDE_TYPES[0] else Side.STARBOARD
            frequency = _frequency(info, blocks.header["Frequency"][rows])
            channels.append(Channel(index, side, frequency, spacing, info))
    return channels


def _frequency(info: AnyArray, in_blocks: AnyArray) -> float:
    """Centre frequency [Hz], from the channel table or else from the blocks."""
    for value in (float(info["Frequency"]), float(np.median(in_blocks))):
        if np.isfinite(value) and value > 0:
            return value if value > _KILOHERTZ_LIMIT else 1e3 * value
    return np.nan


def choose_pair(channels: list[Channel], wanted: str | None) -> Pair:
    """Choose the two channels of a recording: the finer pair, or the one asked for.

    Parameters
    ----------
    channels : list of Channel
        The side-scan channels of the file, at least one.
    wanted : str or None
        ``"3,4"`` for two channel numbers counted from 1 in the order of the file, ``"900kHz"`` for the pair next to a
        frequency, or None for the pair with the smallest sample spacing (among equals: the highest frequency).

    Returns
    -------
    pair : Pair
        The channels; one may be None where the file has one side only.

    Raises
    ------
    ValueError
        If `wanted` cannot be read or names no pair of the file.
    """
    pairs = _pairs(channels)
    if wanted is None:
        return min(pairs, key=_coarseness)
    text = wanted.strip().lower()
    if match := re.fullmatch(r"(\d{1,9})\s*,\s*(\d{1,9})", text):
        return _pair_by_number(channels, {int(match[1]) - 1, int(match[2]) - 1}, wanted)
    if match := re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?)\s*khz", text):
        return _pair_by_frequency(pairs, 1e3 * float(match[1]), wanted)
    raise ValueError(f"channels {wanted!r} cannot be read; two numbers as '1,2' or a frequency as '900kHz' is wanted")


def _pairs(channels: list[Channel]) -> list[Pair]:
    """Ports and starboards brought together in the order of the file; a side without partner stands alone."""
    ports = [c for c in channels if c.side is Side.PORT]
    starboards = [c for c in channels if c.side is Side.STARBOARD]
    pairs = []
    for port in ports:
        partner = min(starboards, key=lambda c: (_unlike(port, c), c.index), default=None)
        if partner is not None:
            starboards.remove(partner)
        pairs.append(Pair(port, partner))
    return pairs + [Pair(None, starboard) for starboard in starboards]


def _unlike(port: Channel, starboard: Channel) -> float:
    """How far two frequencies are apart, as a logarithm; 0 where one is unknown."""
    ratio = port.frequency / starboard.frequency
    return round(abs(np.log(ratio)), 2) if np.isfinite(ratio) else 0.0


def _coarseness(pair: Pair) -> tuple[bool, float, float]:
    """What the finest pair has least of: a missing side, sample spacing (to 1 %), wavelength."""
    spacing = float(np.mean([channel.sample_spacing for channel in pair.channels]))
    frequency = float(np.mean([np.nan_to_num(channel.frequency) for channel in pair.channels]))
    return len(pair.channels) < 2, round(float(np.log(spacing)), 2), -frequency


def _pair_by_number(channels: list[Channel], indices: set[int], wanted: str) -> Pair:
    chosen = [c for c in channels if c.index in indices]
    if {c.side for c in chosen} != {Side.PORT, Side.STARBOARD} or len(chosen) != 2:
        raise ValueError(f"channels {wanted!r} are no pair of port and starboard; the file has {_listing(channels)}")
    port, starboard = sorted(chosen, key=lambda c: c.side is Side.STARBOARD)
    return Pair(port, starboard)


def _pair_by_frequency(pairs: list[Pair], frequency: float, wanted: str) -> Pair:
    known = [p for p in pairs if any(abs(c.frequency - frequency) <= 0.1 * frequency for c in p.channels)]
    if not known:
        listing = _listing([c for p in pairs for c in p.channels])
        raise ValueError(f"no channel is within 10 % of {wanted!r}; the file has {listing}")
    return min(known, key=lambda p: min(abs(c.frequency - frequency) for c in p.channels))


def _listing(channels: list[Channel]) -> str:
    return ", ".join(str(c) for c in channels)
