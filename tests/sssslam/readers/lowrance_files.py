"""Lowrance files made to measure, frame by frame."""

import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np

START = 1_600_000_000
FEET = 1 / 0.3048
# Offsets of the numbers of a frame, for SL2 and SL3.
OFFSETS = {
    2: {
        "size": (28, "H"),
        "channel": (32, "H"),
        "packet": (34, "H"),
        "index": (36, "I"),
        "low": (40, "f"),
        "high": (44, "f"),
        "frequency": (53, "B"),
        "start": (60, "I"),
        "depth": (64, "f"),
        "speed": (100, "f"),
        "x": (108, "i"),
        "y": (112, "i"),
        "course": (120, "f"),
        "heading": (128, "f"),
        "time": (140, "I"),
    },
    3: {
        "size": (8, "H"),
        "channel": (12, "H"),
        "index": (16, "I"),
        "low": (20, "f"),
        "high": (24, "f"),
        "start": (40, "I"),
        "packet": (44, "I"),
        "depth": (48, "f"),
        "frequency": (52, "B"),
        "speed": (84, "f"),
        "x": (92, "i"),
        "y": (96, "i"),
        "course": (104, "f"),
        "heading": (112, "f"),
        "time": (124, "I"),
    },
}
HEADER_SIZE = {2: 144, 3: 168}


@dataclass
class LowranceScene:
    """A boat that goes north at 2 m/s over 10 m of water."""

    kind: int = 2
    n_pings: int = 40
    n_samples: int = 120
    interval_ms: int = 50
    slant_range: float = 60.0
    channels: tuple[int, ...] = (0, 5)
    frame: dict[str, Any] = field(default_factory=dict)

    @property
    def time(self) -> np.ndarray:
        return START + self.interval_ms / 1e3 * np.arange(self.n_pings)

    def lines(self, side: str) -> np.ndarray:
        """Near end first: a dark water column, the floor behind 10 m, a sign of the side and the ping."""
        slant_range = (np.arange(self.n_samples) + 0.5) * self.slant_range / self.n_samples
        floor = np.where(slant_range < 10.0, 4, 200 - 2 * np.minimum(slant_range, 60))
        mark = {"port": 0, "starboard": 20}[side] + np.arange(self.n_pings) % 7
        return (floor[None, :] + np.where(slant_range < 10.0, 0, mark[:, None])).astype(np.uint8)

    def samples(self, k: int, channel: int) -> bytes:
        if channel == 5:
            return self.lines("port")[k, ::-1].tobytes() + self.lines("starboard")[k].tobytes()
        return {3: self.lines("port")[k], 4: self.lines("starboard")[k]}.get(channel, np.zeros(50, np.uint8)).tobytes()

    def one_frame(self, k: int, channel: int, place: int) -> bytes:
        samples = self.samples(k, channel)
        header = bytearray(HEADER_SIZE[self.kind])
        # Spherical Mercator at 45 degrees: a metre on the ground is 1.414 metres of the map.
        north = 2.0 * self.interval_ms / 1e3 * k * np.sqrt(2)
        values = {
            "size": len(header) + len(samples) + 4,
            "channel": channel,
            "packet": len(samples),
            "index": k,
            "low": -self.slant_range * FEET if channel == 5 else 0.0,
            "high": self.slant_range * FEET,
            "frequency": 3,
            "start": START if k == 0 else 0,
            "depth": 10.0 * FEET,
            "speed": 2.0 * 3600 / 1852,
            "x": 1_000_000,
            "y": round(5_602_674 + north),
            "course": 6.2,
            "heading": 0.1,
            "time": self.interval_ms * k,
        }
        struct.pack_into("<I", header, 0, place)
        for name, value in (values | self.frame).items():
            offset, code = OFFSETS[self.kind][name]
            struct.pack_into(f"<{code}", header, offset, value)
        return bytes(header) + samples + bytes(4)

    def to_bytes(self) -> bytes:
        content = bytearray(struct.pack("<HHHH", self.kind, 0, 3200, 0))
        for k in range(self.n_pings):
            for channel in self.channels:
                content += self.one_frame(k, channel, len(content))
        return bytes(content)
