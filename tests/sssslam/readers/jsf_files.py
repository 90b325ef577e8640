"""JSF files made to measure, message by message, with the offsets of EdgeTech's description."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import xor
from typing import Any

import numpy as np

START = 1_500_000_000
ALL_VALID = 0b0100_0010_0110_1101
# Where the numbers of a sonar data message stand.
OFFSETS = {
    "time": (0, "i"),
    "lead": (4, "I"),
    "ping": (8, "I"),
    "msb": (16, "H"),
    "lsb": (18, "H"),
    "lsb2": (20, "H"),
    "id": (28, "h"),
    "validity": (30, "H"),
    "format": (34, "h"),
    "x": (80, "i"),
    "y": (84, "i"),
    "units": (88, "h"),
    "samples": (114, "H"),
    "interval": (116, "I"),
    "start_frequency": (126, "H"),
    "end_frequency": (128, "H"),
    "depth": (136, "i"),
    "altitude": (144, "i"),
    "sound_speed": (148, "f"),
    "weight": (168, "h"),
    "heading": (172, "H"),
    "pitch": (174, "h"),
    "roll": (176, "h"),
    "speed": (194, "h"),
    "milliseconds": (200, "I"),
    "packet": (220, "H"),
}


def message(kind: int, payload: bytes, subsystem: int = 0, channel: int = 0) -> bytes:
    """A message with its header."""
    return struct.pack("<HBBHBBBBHi", 0x1601, 12, 0, kind, 0, subsystem, channel, 0, 0, len(payload)) + payload


@dataclass
class JsfScene:
    """A dive north at 2 m/s, 12 m above the floor, 5 m deep."""

    n_pings: int = 40
    n_samples: int = 120
    interval: float = 0.1
    subsystems: Sequence[int] = (20,)
    frequencies: dict[int, float] = field(default_factory=lambda: {20: 230e3, 21: 540e3})
    sampling: dict[int, int] = field(default_factory=lambda: {20: 40_000, 21: 20_000})
    data_format: int = 0
    weight: int = 0
    sides: tuple[int, ...] = (0, 1)
    ping: dict[str, Any] = field(default_factory=dict)

    @property
    def time(self) -> np.ndarray:
        return START + self.interval * np.arange(self.n_pings)

    def lines(self, side: int, subsystem: int = 20) -> np.ndarray:
        """A different pattern each side, ping and subsystem."""
        sample, ping = np.arange(self.n_samples), np.arange(self.n_pings)[:, None]
        return (11 * sample + 7 * ping + 1000 * side + 100 * subsystem) % 30000

    def samples(self, line: np.ndarray) -> bytes:
        if self.data_format in (1, 9):
            # 3-4-5 triangles: real and imaginary parts whose magnitude is five times a whole number.
            return np.stack([3 * (line // 5), -4 * (line // 5)], axis=1).astype("<i2").tobytes()
        signs = np.where(np.arange(len(line)) % 2, -1, 1) if self.data_format in (2, 3) else 1
        return (signs * line).astype("<i2").tobytes()

    def fields(self, k: int, subsystem: int) -> dict[str, Any]:
        time = self.time[k]
        daha = round(self.frequencies[subsystem] / 10)
        # The low and the high end of a sweep of 20 kHz, with their bits above 16.
        low, high = daha - 1000, daha + 1000
        north = 2.0 * self.interval * k
        values = {
            "time": int(time),
            "ping": 100 + k,
            "msb": (low >> 16) | (high >> 16) << 4 | (self.n_samples >> 16) << 8,
            "id": 1,
            "validity": ALL_VALID,
            "format": self.data_format,
            "x": round(5.0 * 600_000),
            "y": round((45.0 + np.degrees(north / 6367381.8)) * 600_000),
            "units": 2,
            "samples": self.n_samples & 0xFFFF,
            "interval": self.sampling[subsystem],
            "start_frequency": low & 0xFFFF,
            "end_frequency": high & 0xFFFF,
            "depth": 5000,
            "altitude": 12_000,
            "sound_speed": 1480.0,
            "weight": self.weight,
            "heading": 150,
            "pitch": round(3.0 / 180 * 32768),
            "roll": round(2.0 / 180 * 32768),
            "speed": 38,
            "lsb2": 8,
            "milliseconds": round(1000 * (time % 86400)),
            "packet": 1,
        }
        return values | {
            name: value[k] if isinstance(value, (list, np.ndarray)) else value for name, value in self.ping.items()
        }

    def sonar_data(self, k: int, side: int, subsystem: int) -> bytes:
        header = bytearray(240)
        for name, value in self.fields(k, subsystem).items():
            offset, kind = OFFSETS[name]
            struct.pack_into(f"<{kind}", header, offset, value)
        return message(80, bytes(header) + self.samples(self.lines(side, subsystem)[k]), subsystem, side)

    def ping_messages(self, k: int) -> list[bytes]:
        return [self.sonar_data(k, side, subsystem) for subsystem in self.subsystems for side in self.sides]

    def to_bytes(self) -> bytes:
        return message(182, bytes(24)) + b"".join(b"".join(self.ping_messages(k)) for k in range(self.n_pings))


def attitude(time: float, pitch: float, roll: float, heading: float = 0.0, flags: int = 0b11000000) -> bytes:
    """An attitude message; angles in degrees."""
    payload = bytearray(44)
    struct.pack_into("<ii", payload, 0, int(time), round(1000 * (time % 1)))
    struct.pack_into("<hh", payload, 24, round(pitch / 180 * 32768), round(roll / 180 * 32768))
    struct.pack_into("<HI", payload, 34, round(100 * heading), flags)
    return message(2020, bytes(payload))


def sensor(kind: int, time: float, size: int, flags: int, fields: dict[int, tuple[str, Any]], at: int = 12) -> bytes:
    """A message of a sensor: its flags, and numbers by their offsets."""
    payload = bytearray(size)
    struct.pack_into("<ii", payload, 0, int(time), round(1000 * (time % 1)))
    struct.pack_into("<I", payload, at, flags)
    for offset, (code, value) in fields.items():
        struct.pack_into(f"<{code}", payload, offset, value)
    return message(kind, bytes(payload))


def situation(time: float, place: tuple[float, float], heading: float, flags: int = 0x47E) -> bytes:
    """A situation message, 2090: pitched by 2 degrees, rolled by 1, 30 m deep, 1.5 m/s ahead."""
    numbers = {28: place[0], 36: place[1], 44: 30.0, 52: heading, 60: 2.0, 68: 1.0, 100: 1.5, 108: 0.7}
    return sensor(2090, time, 276, flags, {offset: ("d", value) for offset, value in numbers.items()})


def situation_2(
    time: float, place: tuple[float, float], kind: int = 1, velocity: Sequence[float] = (1.5, 0.7)
) -> bytes:
    """A situation message, 2091: as 2090, and 9 m above the floor."""
    numbers = {44: 30.0, 48: 9.0, 56: velocity[0], 60: velocity[1], 68: 2.0, 72: 1.0, 76: 10.0}
    doubles = {28: ("d", place[0]), 36: ("d", place[1]), 16: ("B", kind)}
    return sensor(2091, time, 100, 0x75E, doubles | {offset: ("f", value) for offset, value in numbers.items()})


def doppler(time: float, velocity: Sequence[int], flags: int = 0b101_1110_0011) -> bytes:
    """A message of a Doppler log: 8 m above the floor by two of four beams, 31 m deep."""
    words = {16: ("i", 790), 24: ("i", 810), 32: ("h", velocity[0]), 34: ("h", velocity[1]), 44: ("H", 310)}
    return sensor(2080, time, 72, flags, words | {46: ("h", 300), 48: ("h", -100), 50: ("H", 35900)})


def pressure(time: float, depth: int, flags: int = 1 << 5) -> bytes:
    """A message of a pressure sensor."""
    return sensor(2060, time, 76, flags, {36: ("i", depth)}, at=24)


def nmea(time: float, sentence: str) -> bytes:
    """An NMEA message; the checksum is put behind the sentence."""
    text = f"${sentence}*{reduce(xor, sentence.encode()):02X}\r\n".encode()
    return message(2002, struct.pack("<iiB3x", int(time), round(1000 * (time % 1)), 1) + text)
