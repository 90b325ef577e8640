"""StarFish logs made to measure, packet by packet."""

import struct
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import reduce
from operator import xor
from typing import Any

import numpy as np

START = 1_450_000_000.0


@dataclass
class StarfishScene:
    """A dive north at 1.2 m/s on the central meridian of a UTM zone, 10 m above a flat floor."""

    n_pings: int = 40
    n_samples: int = 120
    interval: float = 0.05
    slant_range: float = 60.0
    speed_unit: float = 3.6
    zone: tuple[bytes, int] = (b"P", 21)
    easting: float = 500_000.0
    northing: float = 1_459_000.0
    properties: dict[str, Any] = field(
        default_factory=lambda: {
            r"\Environment|WaterVos": "1475",
            r"\Hardware\Device[1]|PingFreqStart": "430000",
            r"\Hardware\Device[1]|PingFreqEnd": "470000",
            r"\Hardware\Device[1]|TxPower": 8,
        }
    )
    stamps: np.ndarray | None = None
    far_end_first: bool = False
    opcodes: tuple[int, ...] = (0x21, 0x20, 0x29, 0x24, 0x22, 0x26)

    @property
    def time(self) -> np.ndarray:
        return START + self.interval * np.arange(self.n_pings)

    def lines(self, side: str) -> np.ndarray:
        """Near end first: a dark water column, the floor behind 10 m, a sign of the side and the ping."""
        slant_range = (np.arange(self.n_samples) + 0.5) * self.slant_range / self.n_samples
        floor = np.where(slant_range < 10.0, 4, 200 - 2 * np.minimum(slant_range, 60))
        mark = {"port": 0, "starboard": 20}[side] + np.arange(self.n_pings) % 7
        return (floor[None, :] + np.where(slant_range < 10.0, 0, mark[:, None])).astype(np.uint8)

    def head(self) -> bytes:
        entries = [struct.pack("<I", len(self.properties))]
        for key, value in self.properties.items():
            path, name = key.split("|")
            text = str(value).encode("utf-16-le")
            kind = struct.pack("<II", 1, len(text)) + text if isinstance(value, str) else struct.pack("<II", 4, value)
            entries.append(path.encode() + b"\0" + name.encode() + b"\0" + kind)
        return b"StarfishScanlineLog".ljust(128, b"\0") + b"".join(entries).ljust(1024, b"\0")

    def packet(self, k: int, opcode: int, payload: bytes) -> bytes:
        stamp = self.time[k] if self.stamps is None else self.stamps[k]
        moment = datetime.fromtimestamp(round(stamp, 3), UTC)
        milliseconds = 1000 * moment.second + round(moment.microsecond / 1000)
        fields = moment.year, moment.month, moment.day, moment.hour, moment.minute, milliseconds
        header = struct.pack("<BBHBBBBHBBI", 1, opcode, *fields, 2, 1, len(payload))
        return b"\xff" * 4 + header + payload + bytes([reduce(xor, header + payload)])

    def payload(self, k: int, opcode: int) -> bytes:
        if opcode == 0x21:
            north = self.northing + 1.2 * 0.9996 * self.interval * k
            return struct.pack("<cBddd", *self.zone, north, self.easting, 10.0)
        if opcode == 0x26:
            head = struct.pack("<4fI", 38.0, 0.0, -42.0, self.slant_range, self.n_samples)
            order = -1 if self.far_end_first else 1
            return b"".join(head + self.lines(side)[k, ::order].tobytes() for side in ("port", "starboard"))
        return struct.pack("<d", {0x20: 1.0, 0x29: 10.0, 0x24: 0.5, 0x22: 1.2 * self.speed_unit}[opcode])

    def packets(self) -> list[bytes]:
        return [self.packet(k, code, self.payload(k, code)) for k in range(self.n_pings) for code in self.opcodes]

    def to_bytes(self) -> bytes:
        return self.head() + b"".join(self.packets())
