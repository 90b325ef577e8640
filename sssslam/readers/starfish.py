"""StarFish Scanline logs (`.logdoc`): the small side-scan sonars of Tritech and Blueprint Subsea."""

import mmap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frontend.arrays import Float32Array, FloatArray, IntArray
from frontend.recording import Recording, SonarGeometry
from sssslam.readers.dives import Pings, read_dives
from sssslam.readers.layout import as_float64, gather
from sssslam.readers.lines import gather_lines, plausible_lengths
from sssslam.readers.starfish_navigation import read_navigation
from sssslam.readers.starfish_packets import Packets, index_packets, read_properties, stamps
from sssslam.readers.xtf_samples import far_end_first, reverse_lines

_SIDE_SCAN = 0x26
_SIDE = np.dtype([("level", "<f4", 3), ("range", "<f4"), ("n_samples", "<u4")])
_MAX_RANGE = 1000.0
_SOUND_SPEED, _SOUND_SPEED_BOUNDS = 1500.0, (1350.0, 1650.0)
_FREQUENCY_BOUNDS = (1e4, 1e7)


@dataclass(frozen=True)
class _Lines:
    """The side-scan packets that are sound: where they and the samples of each side lie, and their geometry."""

    packets: Packets
    port: IntArray
    starboard: IntArray
    n_samples: IntArray
    range: FloatArray


def read_starfish_files(paths: Sequence[Path]) -> list[Recording]:
    """Read StarFish logs into one local frame.

    Parameters
    ----------
    paths : sequence of Path
        The files.

    Returns
    -------
    recordings : list of Recording
        One a file, in the order of time.

    Raises
    ------
    ValueError
        If a file gives no recording.
    """
    return read_dives(paths, _read_pings)


def _read_pings(path: Path, data: mmap.mmap) -> Pings:
    del path  # a log is one file
    packets = index_packets(data)
    lines, n_unsound = _side_scan(data, packets)
    navigation, notes = read_navigation(data, packets, lines.packets.offset)
    spacing = lines.range / lines.n_samples
    starboard, starboard_order = _read_side(data, lines, "starboard", navigation.altitude, None)
    port, port_order = _read_side(data, lines, "port", navigation.altitude, starboard)
    sonar, sound_speed, more = _settings(read_properties(data, int(packets.offset[0])))
    return Pings(
        port=port,
        starboard=starboard,
        sample_spacing=spacing,
        sound_speed=np.full(len(spacing), sound_speed),
        stamp=stamps(lines.packets.header),
        navigation=navigation,
        sonar=sonar,
        notes=(*_notes(packets, lines, n_unsound), *port_order, *starboard_order, *more, *notes),
        n_dropped=n_unsound,
    )


def _side_scan(data: mmap.mmap, packets: Packets) -> tuple[_Lines, int]:
    """The side-scan packets with two sides of one length and a range, and how many were not so."""
    found = packets.of(_SIDE_SCAN, 2 * _SIDE.itemsize)
    if not len(found.offset):
        kinds, counts = np.unique(packets.header["opcode"], return_counts=True)
        listing = ", ".join(f"{n} packets of type 0x{kind:02x}" for kind, n in zip(kinds, counts, strict=True))
        raise ValueError(f"the file has no side-scan packet ({listing or 'no whole packet'}); type 0x26 is wanted")
    port = gather(data, found.offset, _SIDE)
    n, size = port["n_samples"].astype(np.int64), found.header["size"].astype(np.int64)
    has_both = np.flatnonzero((n > 0) & (2 * (_SIDE.itemsize + n) == size))
    starboard = np.zeros(len(n), _SIDE)
    starboard[has_both] = gather(data, found.offset[has_both] + _SIDE.itemsize + n[has_both], _SIDE)
    extent, other_extent = (as_float64(side["range"]) for side in (port, starboard))
    is_sound = (starboard["n_samples"] == n) & (extent == other_extent) & (extent > 0) & (extent < _MAX_RANGE)
    is_sound &= plausible_lengths(np.where(is_sound, n, 0))
    rows = np.flatnonzero(is_sound)
    if not rows.size:
        raise ValueError(
            f"none of {len(n)} side-scan packets holds a range and as many samples to port as to starboard; first at"
            f" byte {found.offset[0]}"
        )
    first = found.offset[rows] + _SIDE.itemsize
    kept = Packets(found.offset[rows], found.header[rows], found.skipped)
    return _Lines(kept, first, first + n[rows] + _SIDE.itemsize, n[rows], extent[rows]), len(n) - len(rows)


def _read_side(
    data: mmap.mmap, lines: _Lines, side: str, altitude: FloatArray, other: Float32Array | None
) -> tuple[Float32Array, list[str]]:
    """Samples of a side, near end first as logged, turned round where the echoes say otherwise."""
    samples = gather_lines(data, getattr(lines, side), lines.n_samples, "u1")
    if not far_end_first(samples, lines.n_samples, altitude, lines.range / lines.n_samples, other):
        return samples, []
    note = f"{side} is stored far end first (the echoes say so) and was turned round"
    return reverse_lines(samples, lines.n_samples), [note]


def _notes(packets: Packets, lines: _Lines, n_unsound: int) -> list[str]:
    ranges = ", ".join(f"{value:g}" for value in np.unique(lines.range)[:5])
    notes = [f"the layout of this format is inferred, and with it the slant range: {ranges} m"]
    notes += packets.skipped.notes("packets")
    if n_unsound:
        notes.append(f"pings dropped, for their sides or range make no sense: {n_unsound}")
    return notes


def _settings(properties: dict[str, str]) -> tuple[SonarGeometry, float, list[str]]:
    """Sonar and sound speed as the logging program was set."""
    frequencies = [_number(properties, name, _FREQUENCY_BOUNDS) for name in ("PingFreqStart", "PingFreqEnd")]
    sonar = SonarGeometry(frequency=float(np.mean(frequencies)))
    sound_speed = _number(properties, "WaterVos", _SOUND_SPEED_BOUNDS)
    if np.isfinite(sound_speed):
        return sonar, sound_speed, []
    return sonar, _SOUND_SPEED, [f"sound speed is missing or implausible: {_SOUND_SPEED:g} m/s is assumed"]


def _number(properties: dict[str, str], name: str, bounds: tuple[float, float]) -> float:
    """The first setting of a name as a number; NaN if it is none or out of its bounds."""
    text = next((value for key, value in properties.items() if key.endswith(f"\\{name}")), "")
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return np.nan
    return value if bounds[0] <= value <= bounds[1] else np.nan
