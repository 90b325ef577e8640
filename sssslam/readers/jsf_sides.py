"""JSF sides: the two channels of one subsystem, brought together ping by ping."""

import mmap

import numpy as np

from frontend.arrays import Float32Array, IntArray
from sssslam.readers.jsf_pings import SAMPLES, SIDES, SonarData, high_bits, sample_intervals
from sssslam.readers.lines import gather_lines, nearest_in_time, plausible_lengths
from sssslam.readers.xtf_channels import Channel, Pair, choose_pair

# Block floating point: a 16-bit sample times 2^24 or 2^-24 says nothing, so such a weight is damage.
_MAX_WEIGHT = 24
# A window that starts this many times its length away from the sonar is damage.
_MAX_LEAD_RATIO = 8.0
_MATCH_TOLERANCE = 0.01
_NOMINAL_SOUND_SPEED = 1500.0


def choose_sides(sonar_data: SonarData, wanted: str | None) -> tuple[Pair, list[Channel]]:
    """Choose the subsystem to read.

    Parameters
    ----------
    sonar_data : SonarData
        All side-scan messages, at least one.
    wanted : str or None
        As for `choose_pair`.

    Returns
    -------
    pair : Pair
        The two channels.
    channels : list of Channel
        All that the file has.
    """
    channels: list[Channel] = []
    for number in np.unique(sonar_data.channel).tolist():
        header = sonar_data.header[sonar_data.channel == number]
        low, high = header["StartFrequency"].astype(np.int64), header["EndFrequency"].astype(np.int64)
        twice = 10.0 * float(np.median(low + (high_bits(header, 0) << 16) + high + (high_bits(header, 4) << 16)))
        spacing = float(np.median(sample_intervals(header))) * _NOMINAL_SOUND_SPEED / 2
        frequency = twice / 2 if twice > 0 else np.nan
        channels.append(Channel(len(channels), SIDES[number % 2], frequency, spacing, np.array(number)))
    return choose_pair(channels, wanted), channels


def take_channel(sonar_data: SonarData, channel: Channel | None) -> SonarData:
    """The messages of one channel that are alike.

    Parameters
    ----------
    sonar_data : SonarData
        All side-scan messages.
    channel : Channel or None
        One of their channels; None for a side that the file lacks.

    Returns
    -------
    sonar_data : SonarData
        Its messages of the commonest data format and of a plausible length.
    """
    rows = np.flatnonzero(sonar_data.channel == (-1 if channel is None else int(channel.info)))
    if not rows.size:
        return sonar_data[rows]
    formats, counts = np.unique(sonar_data.header["DataFormat"][rows], return_counts=True)
    rows = rows[sonar_data.header["DataFormat"][rows] == formats[np.argmax(counts)]]
    n_samples, lead = sonar_data.n_samples[rows], sonar_data.header["StartingDepth"][rows]
    return sonar_data[rows[plausible_lengths(n_samples) & (lead <= _MAX_LEAD_RATIO * n_samples.mean())]]


def match_sides(port: SonarData, starboard: SonarData) -> tuple[IntArray, IntArray]:
    """Bring the messages of a ping together: by its number or, where numbers repeat, by time.

    Parameters
    ----------
    port, starboard : SonarData
        Messages of each side; none for a side that the file lacks.

    Returns
    -------
    rows, starboard_rows : ndarray of int, shape (N,)
        Rows of each that make a ping; both the same where a side is lacking.
    """
    if not len(port) or not len(starboard):
        every = np.arange(max(len(port), len(starboard)))
        return every, every
    numbers = port.header["PingNumber"], starboard.header["PingNumber"]
    if any(len(np.unique(n)) < len(n) for n in numbers):
        return nearest_in_time(np.nan_to_num(port.stamp), np.nan_to_num(starboard.stamp), _MATCH_TOLERANCE)
    _, rows, others = np.intersect1d(numbers[0], numbers[1], return_indices=True)
    order = np.argsort(rows)
    return rows[order], others[order]


def read_lines(data: mmap.mmap, side: SonarData, n_pings: int) -> Float32Array:
    """Read the samples of one side.

    Parameters
    ----------
    data : mmap
        The file.
    side : SonarData
        Messages of one data format; none for a side that the file lacks.
    n_pings : int
        Number of pings N.

    Returns
    -------
    lines : ndarray of float32, shape (N, M)
        Magnitudes times 2 to the power of the weighting factor, negative, from range zero on: NaN before a window that
        starts later and behind its end.
    """
    if not len(side):
        return np.zeros((n_pings, 0), dtype=np.float32)
    dtype, count = SAMPLES[int(side.header["DataFormat"][0])]
    numbers = gather_lines(data, side.offset, side.n_samples * count, dtype)
    lines = np.abs(numbers) if count == 1 else np.hypot(numbers[:, 0::2], numbers[:, 1::2])
    weight = side.header["WeightingFactor"].astype(np.int32)
    if np.all(np.abs(weight) <= _MAX_WEIGHT):
        lines = np.ldexp(lines, -weight[:, None])
    return _from_range_zero(np.asarray(lines, dtype=np.float32), side.header["StartingDepth"].astype(np.int64))


def _from_range_zero(lines: Float32Array, lead: IntArray) -> Float32Array:
    """Lines moved outwards by the samples before their window."""
    if not lead.any():
        return lines
    moved = np.full((len(lines), lines.shape[1] + int(lead.max())), np.nan, dtype=np.float32)
    for n in np.unique(lead).tolist():
        rows = np.flatnonzero(lead == n)
        moved[rows, n : n + lines.shape[1]] = lines[rows]
    return moved
