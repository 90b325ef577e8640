"""JSF pings: the sonar data messages (type 80)."""

import mmap
from dataclasses import dataclass

import numpy as np

from frontend.arrays import AnyArray, FloatArray, IntArray
from sssslam.readers.jsf_messages import SONAR_DATA, Messages
from sssslam.readers.layout import gather, layout
from sssslam.readers.xtf_channels import Side

SONAR = layout(
    240,
    {
        "Time": (0, "<i4"),
        "StartingDepth": (4, "<u4"),
        "PingNumber": (8, "<u4"),
        "MostSignificantBits": (16, "<u2"),
        "LeastSignificantBits": (18, "<u2"),
        "LeastSignificantBits2": (20, "<u2"),
        "Validity": (30, "<u2"),
        "DataFormat": (34, "<i2"),
        "Longitude": (80, "<i4"),
        "Latitude": (84, "<i4"),
        "CoordinateUnits": (88, "<i2"),
        "Samples": (114, "<u2"),
        "SamplingInterval": (116, "<u4"),
        "StartFrequency": (126, "<u2"),
        "EndFrequency": (128, "<u2"),
        "Depth": (136, "<i4"),
        "Altitude": (144, "<i4"),
        "SoundSpeed": (148, "<f4"),
        "WeightingFactor": (168, "<i2"),
        "Heading": (172, "<u2"),
        "Pitch": (174, "<i2"),
        "Roll": (176, "<i2"),
        "Speed": (194, "<i2"),
        "MillisecondsToday": (200, "<u4"),
        "PacketNumber": (220, "<u2"),
    },
)
ENVELOPE, ANALYTIC, RAW, REAL, PIXELS, RAW_ANALYTIC = 0, 1, 2, 3, 4, 9
# Data format: type of a sample, and how many of them make one.
SAMPLES = {ENVELOPE: ("<u2", 1), ANALYTIC: ("<i2", 2), RAW: ("<i2", 1), REAL: ("<i2", 1), PIXELS: ("<u2", 1)}
SAMPLES |= {RAW_ANALYTIC: ("<i2", 2)}
_SUB_BOTTOM = 0
SIDES = {0: Side.PORT, 1: Side.STARBOARD}


@dataclass(frozen=True)
class SonarData:
    """Sonar data messages.

    Parameters
    ----------
    header : ndarray of SONAR, shape (K,)
        Their headers.
    channel : ndarray of int, shape (K,)
        ``2 * subsystem + side``, port 0 and starboard 1.
    offset : ndarray of int, shape (K,)
        Where the samples start [bytes].
    n_samples : ndarray of int, shape (K,)
        Number of samples.
    stamp : ndarray, shape (K,)
        Time [s].
    """

    header: AnyArray
    channel: IntArray
    offset: IntArray
    n_samples: IntArray
    stamp: FloatArray

    def __getitem__(self, rows: AnyArray) -> "SonarData":
        return SonarData(*(getattr(self, name)[rows] for name in ("header", "channel", "offset", "n_samples", "stamp")))

    def __len__(self) -> int:
        return len(self.offset)


def read_sonar_data(data: mmap.mmap, messages: Messages) -> SonarData:
    """Read the side-scan messages of a file.

    Parameters
    ----------
    data : mmap
        The file.
    messages : Messages
        Its messages.

    Returns
    -------
    sonar_data : SonarData
        Those of a side, with a sampling interval, of a format that is known, that hold all their samples. Of a ping
        that is spread over several messages, the first.
    """
    found = messages.of(SONAR_DATA, SONAR.itemsize)
    header = gather(data, found.offset, SONAR)
    is_side = (found.header["subsystem"] != _SUB_BOTTOM) & np.isin(found.header["channel"], list(SIDES))
    n_samples = header["Samples"].astype(np.int64) | (high_bits(header, 8) << 16)
    n_bytes = np.zeros(len(header), dtype=np.int64)
    for kind, (dtype, count) in SAMPLES.items():
        n_bytes[header["DataFormat"] == kind] = np.dtype(dtype).itemsize * count
    is_whole = (n_bytes > 0) & (n_bytes * n_samples + SONAR.itemsize <= found.header["size"])
    is_sound = (header["SamplingInterval"] > 0) & (header["PacketNumber"] <= 1)
    rows = np.flatnonzero(is_side & is_whole & is_sound & (n_samples > 0))
    channel = 2 * found.header["subsystem"].astype(np.int64) + found.header["channel"]
    return SonarData(header, channel, found.offset + SONAR.itemsize, n_samples, _stamps(header))[rows]


def high_bits(header: AnyArray, first: int) -> IntArray:
    """Four of the bits that extend numbers of 16 bits to 20.

    Parameters
    ----------
    header : ndarray of SONAR, shape (K,)
        Headers.
    first : int
        The lowest of the four: 0 start frequency, 4 end frequency, 8 samples.

    Returns
    -------
    bits : ndarray of int, shape (K,)
        Bits 16 to 19 of the number.
    """
    return (header["MostSignificantBits"].astype(np.int64) >> first) & 0xF


def _stamps(header: AnyArray) -> FloatArray:
    """Whole seconds since 1970, made finer by the milliseconds of the day, whose time zone may be another."""
    seconds = header["Time"].astype(np.float64)
    ahead = header["MillisecondsToday"] / 1e3 - seconds % 86400
    ahead -= 900 * np.round(ahead / 900)
    return np.where(seconds > 0, seconds + np.where(np.abs(ahead) < 2, ahead, 0.0), np.nan)


def sample_intervals(header: AnyArray) -> FloatArray:
    """Time between samples.

    Parameters
    ----------
    header : ndarray of SONAR, shape (K,)
        Headers.

    Returns
    -------
    interval : ndarray, shape (K,)
        As recorded, its fraction included [s].
    """
    fraction = (header["LeastSignificantBits"] & 0xFF) / 256
    return np.asarray(1e-9 * (header["SamplingInterval"] + fraction))
