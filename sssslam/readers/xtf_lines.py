"""XTF lines: the samples of both sides brought together, one row a ping, near end first."""

import mmap
from dataclasses import dataclass

import numpy as np

from frontend.arrays import AnyArray, Float32Array, FloatArray, IntArray
from sssslam.readers.layout import as_float64
from sssslam.readers.xtf_blocks import Blocks
from sssslam.readers.xtf_channels import Channel, Pair
from sssslam.readers.xtf_samples import far_end_first, read_samples, reverse_lines

# A ping with so many times more samples than the mean is damage; this also bounds what a hostile file can allocate.
_MAX_LENGTH_RATIO = 8
_MAX_SLANT_RANGE = 50e3
# Both sides share one sample spacing; closer than this they are called equal.
_SPACING_TOLERANCE = 0.01


@dataclass(frozen=True)
class Rows:
    """Which blocks make the lines of a recording.

    Parameters
    ----------
    ping : ndarray of int, shape (N,)
        Number of the sonar packet whose header goes with the line.
    port, starboard : ndarray of int, shape (N,)
        Row of the block that holds the side; -1 where there is none.
    sample_spacing : ndarray, shape (N,)
        Slant range between samples [m].
    """

    ping: IntArray
    port: IntArray
    starboard: IntArray
    sample_spacing: FloatArray

    def __getitem__(self, rows: AnyArray) -> "Rows":
        return Rows(self.ping[rows], self.port[rows], self.starboard[rows], self.sample_spacing[rows])


@dataclass(frozen=True)
class Lines:
    """The samples of a recording.

    Parameters
    ----------
    port, starboard : ndarray of float32, shape (N, M)
        Samples, near end first; NaN where there is none.
    notes : list of str
        What was decided about their order.
    """

    port: Float32Array
    starboard: Float32Array
    notes: list[str]


def slant_ranges(blocks: Blocks, sound_speed: FloatArray) -> FloatArray:
    """Slant range of each block.

    Parameters
    ----------
    blocks : Blocks
        Channel blocks.
    sound_speed : ndarray, shape (P,)
        Sound speed at each ping [m/s].

    Returns
    -------
    slant_range : ndarray, shape (B,)
        Slant range as recorded, or else from the duration [m]; 0 where both are missing or implausible.
    """
    recorded = as_float64(blocks.header["SlantRange"])
    from_duration = as_float64(blocks.header["TimeDuration"]) * sound_speed[blocks.ping] / 2
    for values in (recorded, from_duration):
        values[~((values > 0) & (values < _MAX_SLANT_RANGE))] = 0.0
    return np.where(recorded > 0, recorded, from_duration)


def match_sides(pair: Pair, blocks: Blocks, slant_range: FloatArray, ping_numbers: IntArray) -> Rows:
    """Bring the port and starboard blocks of each ping together.

    Parameters
    ----------
    pair : Pair
        The channels.
    blocks : Blocks
        The channel blocks of all pings.
    slant_range : ndarray, shape (B,)
        Slant range of each block [m].
    ping_numbers : ndarray of int, shape (P,)
        Ping number of each sonar packet; matches the sides of a file that keeps them in packets of their own.

    Returns
    -------
    rows : Rows
        One row a ping, in the order of the file.
    """
    port, starboard = (_sound_blocks(channel, blocks, slant_range) for channel in (pair.port, pair.starboard))
    of_port, of_starboard = blocks.ping[port], blocks.ping[starboard].copy()
    if not np.intersect1d(of_port, of_starboard).size:
        numbers = ping_numbers[of_port], ping_numbers[of_starboard]
        _, at_port, at_starboard = np.intersect1d(numbers[0], numbers[1], return_indices=True)
        of_starboard[at_starboard] = of_port[at_port]
    ping = np.union1d(of_port, of_starboard)
    columns = []
    for key, side in ((of_port, port), (of_starboard, starboard)):
        column = np.full(len(ping), -1, dtype=np.int64)
        column[np.searchsorted(ping, key)] = side
        columns.append(column)
    spacing = [np.where(c >= 0, slant_range[c] / np.maximum(blocks.n_samples[c], 1), np.nan) for c in columns]
    is_consistent = ~(np.abs(spacing[0] / spacing[1] - 1) > _SPACING_TOLERANCE)
    nearest = np.where(columns[0] >= 0, spacing[0], spacing[1])
    return Rows(ping, columns[0], columns[1], nearest)[is_consistent]


def _sound_blocks(channel: Channel | None, blocks: Blocks, slant_range: FloatArray) -> IntArray:
    """Rows of the blocks of a channel that have a range and a plausible number of samples."""
    if channel is None:
        return np.zeros(0, dtype=np.int64)
    rows = np.flatnonzero((blocks.channel == channel.index) & (blocks.n_samples > 0) & (slant_range > 0))
    return rows[blocks.n_samples[rows] <= _MAX_LENGTH_RATIO * np.mean(blocks.n_samples[rows])]


def read_sides(data: mmap.mmap, pair: Pair, blocks: Blocks, rows: Rows, altitude: FloatArray) -> Lines:
    """Read the samples of both sides.

    Parameters
    ----------
    data : mmap
        The file.
    pair : Pair
        The channels.
    blocks : Blocks
        The channel blocks of all pings.
    rows : Rows
        The blocks of each line.
    altitude : ndarray, shape (N,)
        Height above the seafloor [m]; NaN where unknown.

    Returns
    -------
    lines : Lines
        The samples.
    """
    spacing = rows.sample_spacing
    used = np.concatenate([side[side >= 0] for side in (rows.port, rows.starboard)])
    shape = len(rows.ping), int(blocks.n_samples[used].max())
    starboard, port = (
        _read_side(data, channel, blocks, side, shape)
        for channel, side in ((pair.starboard, rows.starboard), (pair.port, rows.port))
    )
    n_starboard, n_port = (
        np.where(side >= 0, blocks.n_samples[side], shape[1]) for side in (rows.starboard, rows.port)
    )
    notes = []
    if pair.starboard and far_end_first(starboard, n_starboard, altitude, spacing, None):
        starboard = reverse_lines(starboard, n_starboard)
        notes.append("starboard is stored far end first (its water column says so) and was turned round")
    if pair.port:
        judgement = far_end_first(port, n_port, altitude, spacing, starboard if pair.starboard else None)
        # The format's custom is a picture: port runs from the far end to the nadir, starboard on from there.
        port = port if judgement is False else reverse_lines(port, n_port)
        notes.append(_order_note(judgement))
    return Lines(port, starboard, notes)


def _order_note(judgement: bool | None) -> str:
    if judgement is None:
        return "port was turned round: the echoes do not tell its order, and far end first is the custom"
    order, action = ("far end first", "was turned round") if judgement else ("near end first", "was left so")
    return f"port is stored {order} (the echoes say so) and {action}"


def _read_side(
    data: mmap.mmap, channel: Channel | None, blocks: Blocks, side: IntArray, shape: tuple[int, int]
) -> Float32Array:
    """Samples of one side in the order of the file; NaN throughout if the file lacks it."""
    if channel is None:
        return np.full(shape, np.nan, dtype=np.float32)
    rows = np.flatnonzero(side >= 0)
    return read_samples(data, channel, blocks[side[rows]], rows, shape)
