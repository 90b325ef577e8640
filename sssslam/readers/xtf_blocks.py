"""XTF channel blocks: where the samples of each channel of each ping lie."""

import mmap
from dataclasses import dataclass

import numpy as np

from frontend.arrays import AnyArray, IntArray
from sssslam.readers.xtf_packets import (
    BLOCK_HEADER,
    MAX_CHANNELS,
    PING_HEADER,
    SIDE_TYPES,
    PacketIndex,
    gather,
)


@dataclass(frozen=True)
class Blocks:
    """The channel blocks of all pings, one row a block.

    Parameters
    ----------
    ping : ndarray of int, shape (B,)
        Number of the sonar packet.
    channel : ndarray of int, shape (B,)
        Index of the channel in the file header.
    header : ndarray of BLOCK_HEADER, shape (B,)
        The header of the block.
    n_samples : ndarray of int, shape (B,)
        Number of samples.
    offset : ndarray of int, shape (B,)
        Where the samples start in the file [bytes].
    """

    ping: IntArray
    channel: IntArray
    header: AnyArray
    n_samples: IntArray
    offset: IntArray

    def __getitem__(self, rows: AnyArray) -> "Blocks":
        return Blocks(self.ping[rows], self.channel[rows], self.header[rows], self.n_samples[rows], self.offset[rows])


def read_blocks(data: mmap.mmap, index: PacketIndex, pings: AnyArray, channels: AnyArray) -> Blocks:
    """Find the channel blocks of every ping.

    Parameters
    ----------
    data : mmap
        The file.
    index : PacketIndex
        Its packets.
    pings : ndarray of PING_HEADER, shape (P,)
        The headers of the sonar packets.
    channels : ndarray of CHANNEL, shape (C,)
        The channel table.

    Returns
    -------
    blocks : Blocks
        Whole blocks only: one that would reach over the end of its packet is left out.
    """
    n_blocks = np.minimum(pings["NumChansToFollow"].astype(np.int64), MAX_CHANNELS)
    position, end = index.pings + PING_HEADER.itemsize, index.pings + index.sizes
    active = np.arange(len(pings))
    found = []
    for k in range(MAX_CHANNELS):
        active = active[(k < n_blocks[active]) & (position[active] + BLOCK_HEADER.itemsize <= end[active])]
        if not active.size:
            break
        blocks = _blocks_at(data, active, position[active], k, channels)
        after = blocks.offset + blocks.n_samples * channels["BytesPerSample"][blocks.channel].astype(np.int64)
        is_whole = after <= end[active]
        found.append(blocks[is_whole])
        active = active[is_whole]
        position[active] = after[is_whole]
    return _by_position_where_ambiguous(found, channels)


def _blocks_at(data: mmap.mmap, ping: IntArray, position: IntArray, k: int, channels: AnyArray) -> Blocks:
    """The k-th blocks of some pings; a channel number that the table lacks is replaced by the place in the packet."""
    header = gather(data, position, BLOCK_HEADER)
    number = header["ChannelNumber"].astype(np.int64)
    known = (number < len(channels)) & (channels["BytesPerSample"][np.minimum(number, len(channels) - 1)] > 0)
    channel = np.where(known, number, _channel_at_place(channels, np.array(k)))
    n_samples = header["NumSamples"].astype(np.int64)
    # Files before NumSamples existed keep the number in the channel table.
    n_samples = np.where(n_samples > 0, n_samples, channels["Reserved"][channel].astype(np.int64))
    return Blocks(ping, channel, header, n_samples, position + BLOCK_HEADER.itemsize)


def _by_position_where_ambiguous(found: list[Blocks], channels: AnyArray) -> Blocks:
    """All blocks; where a ping names one channel twice, its blocks are told apart by their place in the packet."""
    fields = ("ping", "channel", "header", "n_samples", "offset")
    if not found:
        none = np.zeros(0, dtype=np.int64)
        return Blocks(none, none, np.zeros(0, BLOCK_HEADER), none, none)
    blocks = Blocks(*(np.concatenate([getattr(b, name) for b in found]) for name in fields))
    place = np.concatenate([np.full(len(b.ping), k) for k, b in enumerate(found)])
    key = blocks.ping * len(channels) + blocks.channel
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    ambiguous = np.isin(blocks.ping, blocks.ping[first[count > 1]])
    channel = np.where(ambiguous, _channel_at_place(channels, place), blocks.channel)
    return Blocks(blocks.ping, channel, blocks.header, blocks.n_samples, blocks.offset)


def _channel_at_place(channels: AnyArray, place: AnyArray) -> AnyArray:
    """The channel of the k-th block of a packet: the k-th side-scan channel of the table."""
    sides = np.flatnonzero(np.isin(channels["TypeOfChannel"], SIDE_TYPES) & (channels["BytesPerSample"] > 0))
    table = np.concatenate([sides, np.setdiff1d(np.arange(len(channels)), sides)])
    return table[np.minimum(place, len(table) - 1)]
