"""Humminbird dives made to measure: a DAT and a SON a beam, record by record."""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

START = 1_400_000_000
# Header layouts: tags in the order of the units (the oldest with 67 bytes, one with 152).
SHORT = (0x80, 0x81, 0x82, 0x83, 0x84, 0x85, 0x87, 0x50, 0x51, 0x92, 0x53, 0x54, 0x95, 0x56, 0x57)
LONG = (
    *(0x80, 0x81, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87, *range(0x88, 0x90), 0x50, 0x51, 0x92, 0x53, 0x54, 0x95),
    *(0x56, 0x57, *range(0x98, 0xA0)),
)


@dataclass
class HumminbirdScene:
    """A boat that goes south-west at 2 m/s over 10 m of water."""

    n_pings: int = 40
    n_samples: int = 120
    interval_ms: int = 44
    tags: tuple[int, ...] = SHORT
    east: float = -12_414_000.0
    north: float = 4_396_652.0
    speed: float = 2.0
    heading: float = 225.0
    sides: str = "ps"
    water: int = 0
    dat_size: int = 64
    delay_ms: int = 0

    @property
    def time(self) -> np.ndarray:
        return START + self.interval_ms / 1e3 * np.arange(self.n_pings)

    def lines(self, beam: int) -> np.ndarray:
        """A different pattern each side and ping."""
        sample, ping = np.arange(self.n_samples), np.arange(self.n_pings)[:, None]
        return ((3 * sample + 7 * ping + 50 * beam) % 251).astype(np.uint8)

    def record(self, k: int, beam: int) -> bytes:
        # A step of the map is cos(latitude) of a step on the ground; here about 0.8.
        travelled = self.speed * self.interval_ms / 1e3 * k / np.sqrt(2) / 0.8
        position = [round(self.east - travelled), round(self.north - travelled)]
        values = {
            0x80: 5 * k + beam,
            0x81: self.interval_ms * k + (beam == 3) * self.delay_ms,
            0x82: position[0] & 0xFFFFFFFF,
            0x83: position[1] & 0xFFFFFFFF,
            0x84: 1 << 16 | round(10 * self.heading),
            0x85: 1 << 16 | round(10 * self.speed),
            0x87: 100,
            0x50: beam,
            0x92: 455_000,
        }
        header = b"".join(
            struct.pack(">BI" if tag >= 0x80 else "BB", tag, values.get(tag, 0))
            for tag in self.tags  # the rest is unknown and zero
        )
        count = struct.pack(">BIB", 0xA0, self.n_samples, 0x21)
        return b"\xc0\xde\xab\x21" + header + count + self.lines(beam)[k].tobytes()

    def son(self, beam: int) -> bytes:
        return b"".join(self.record(k, beam) for k in range(self.n_pings))

    def dat(self) -> bytes:
        order = ">" if self.dat_size == 64 else "<"
        content = bytearray(self.dat_size)
        content[0], content[1] = 0xC1, self.water
        struct.pack_into(f"{order}i", content, 20, START)
        content[32:42] = b"R01224.SON"
        return bytes(content)

    def write(self, folder: Path, name: str = "R01224") -> Path:
        """Write the dive as a unit does; gives the DAT."""
        (folder / name).mkdir(parents=True)
        for side in self.sides:
            beam = {"p": 2, "s": 3}[side]
            (folder / name / f"B00{beam}.SON").write_bytes(self.son(beam))
        (folder / f"{name}.DAT").write_bytes(self.dat())
        return folder / f"{name}.DAT"
