"""XTF files made to measure: pyxtf's own structures, written packet by packet."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyxtf

START = 1_700_000_000.0
DTYPES = {1: np.uint8, 2: np.dtype("<u2"), 4: np.dtype("<u4")}


@dataclass
class XtfScene:
    """A straight dive north at 2 m/s, 10 m above a flat floor; every field of a packet can be set."""

    n_pings: int = 40
    n_samples: int = 120
    interval: float = 0.1
    n_bytes: int = 2
    sample_format: int = 0
    nav_units: int = 3
    frequencies: Sequence[float] = (600.0,)
    slant_ranges: Sequence[float] = (60.0,)
    port_far_first: bool = True
    starboard_far_first: bool = False
    sides: str = "ps"
    has_own_packets: bool = False
    ping: dict[str, Any] = field(default_factory=dict)
    block: dict[str, Any] = field(default_factory=dict)
    channel: dict[str, Any] = field(default_factory=dict)
    weight: int = 0

    @property
    def time(self) -> np.ndarray:
        return START + self.interval * np.arange(self.n_pings)

    def lines(self, side: str, pair: int = 0) -> np.ndarray:
        """Near end first: a dark water column, the floor behind 10 m, a sign of the side, the pair and the ping."""
        spacing = self.slant_ranges[pair] / self.n_samples
        slant_range = (np.arange(self.n_samples) + 0.5) * spacing
        floor = np.where(slant_range < 10.0, 4, 200 - 2 * np.minimum(slant_range, 60))
        mark = {"p": 0, "s": 20}[side] + 10 * pair + np.arange(self.n_pings) % 7
        return (floor[None, :] + np.where(slant_range < 10.0, 0, mark[:, None])).astype(DTYPES[self.n_bytes])

    def header(self) -> bytes:
        header = pyxtf.XTFFileHeader()
        header.NavUnits = self.nav_units
        header.NumberOfSonarChannels = len(self.frequencies) * len(self.sides)
        for k, (pair, side) in enumerate(self.channels()):
            info = header.ChanInfo[k]
            info.TypeOfChannel = {"p": 1, "s": 2}[side]
            info.SubChannelNumber, info.BytesPerSample, info.SampleFormat = k, self.n_bytes, self.sample_format
            info.Frequency, info.CorrectionFlags, info.UniPolar = self.frequencies[pair], 1, 1
            for name, value in self.channel.items():
                setattr(info, name, value)
        return bytes(header)

    def channels(self) -> list[tuple[int, str]]:
        return [(pair, side) for pair in range(len(self.frequencies)) for side in self.sides]

    def packet(self, k: int, channels: list[tuple[int, str]]) -> bytes:
        """The packet of one ping."""
        header = self._ping_header(k)
        header.NumChansToFollow = len(channels)
        body = b"".join(self._block(k, *channel) for channel in channels)
        padding = -(256 + len(body)) % 64
        header.NumBytesThisRecord = 256 + len(body) + padding
        return bytes(header) + body + bytes(padding)

    def _ping_header(self, k: int) -> Any:
        header, stamp = pyxtf.XTFPingHeader(), datetime.fromtimestamp(round(self.time[k], 2), UTC)
        header.HeaderType, header.PingNumber, header.SoundVelocity = 0, k, 750.0
        header.Year, header.Month, header.Day = stamp.year, stamp.month, stamp.day
        header.Hour, header.Minute, header.Second = stamp.hour, stamp.minute, stamp.second
        header.HSeconds = round(stamp.microsecond / 1e4)
        north = 2.0 * self.interval * k
        header.SensorYcoordinate, header.SensorXcoordinate = 45.0 + np.degrees(north / 6367381.8), 5.0
        header.SensorHeading, header.SensorPitch, header.SensorRoll = 1.0 + 0.01 * k, 3.0 + 0.01 * k, 2.0 + 0.01 * k
        header.SensorPrimaryAltitude, header.SensorDepth, header.SensorSpeed = 10.0, 5.0 + 0.01 * k, 3600 / 1852 * 2.0
        for name, value in self.ping.items():
            setattr(header, name, value[k] if isinstance(value, (list, np.ndarray)) else value)
        return header

    def _block(self, k: int, pair: int, side: str) -> bytes:
        block = pyxtf.XTFPingChanHeader()
        block.ChannelNumber = self.channels().index((pair, side))
        block.SlantRange, block.NumSamples = self.slant_ranges[pair], self.n_samples
        block.Frequency = int(min(self.frequencies[pair], 65535))
        block.Weight = self.weight
        line = self.lines(side, pair)[k]
        for name, value in self.block.items():
            setattr(block, name, value[k] if isinstance(value, (list, np.ndarray)) else value)
        is_reversed = self.port_far_first if side == "p" else self.starboard_far_first
        line = line[::-1] if is_reversed else line
        samples = line.astype("<f4") if self.sample_format == 5 else line
        return bytes(block) + samples.tobytes()

    def packets(self) -> list[bytes]:
        groups = [[c] for c in self.channels()] if self.has_own_packets else [self.channels()]
        return [self.packet(k, group) for k in range(self.n_pings) for group in groups]

    def to_bytes(self) -> bytes:
        return self.header() + b"".join(self.packets())


@pytest.fixture
def scene() -> type[XtfScene]:
    """The maker of XTF files."""
    return XtfScene


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Writes bytes to a file of a name."""

    def write_bytes(data: bytes, name: str = "dive.xtf") -> Path:
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write_bytes
