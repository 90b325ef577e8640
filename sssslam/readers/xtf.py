"""XTF, the eXtended Triton Format: the side-scan recordings of most towfish and AUVs."""

import hashlib
import mmap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frontend.arrays import FloatArray
from frontend.georeference import Georeference
from frontend.recording import Recording, SonarGeometry
from sssslam.readers.layout import as_float64
from sssslam.readers.ping_times import repair_times
from sssslam.readers.xtf_better_navigation import better_navigation
from sssslam.readers.xtf_blocks import Blocks, read_blocks
from sssslam.readers.xtf_channels import Channel, Pair, choose_pair, side_scan_channels
from sssslam.readers.xtf_lines import Lines, Rows, match_sides, read_sides, slant_ranges
from sssslam.readers.xtf_navigation import (
    RawNavigation,
    good_pings,
    ping_stamps,
    raw_navigation,
    sound_speeds,
    without_positions,
)
from sssslam.readers.xtf_packets import (
    PING_HEADER,
    SIDE_TYPES,
    FileHeader,
    PacketIndex,
    gather,
    index_packets,
    map_file,
    read_file_header,
)
from sssslam.readers.xtf_raw_packets import read_raw_series
from sssslam.readers.xtf_samples import check_samples, gain_notes
from sssslam.readers.xtf_trajectory import make_trajectory, speed_in_metres

_MAX_LEVER_ARM = 100.0


@dataclass(frozen=True)
class _Dive:
    """What one file holds, before a local frame is chosen."""

    path: Path
    sha256: str
    lines: Lines
    sample_spacing: FloatArray
    sound_speed: FloatArray
    time: FloatArray
    navigation: RawNavigation
    is_geographic: bool
    sonar: SonarGeometry
    n_dropped: int
    notes: list[str]


def read_xtf(path: str | Path, channels: str | None = None) -> Recording:
    """Read one XTF file.

    Parameters
    ----------
    path : str or Path
        The file.
    channels : str or None
        ``"3,4"`` for two channel numbers counted from 1, ``"900kHz"`` for the pair next to a frequency, or None for the
        finer pair.

    Returns
    -------
    recording : Recording
        Its side-scan pings; the notes say what was decided, repaired or assumed.

    Raises
    ------
    ValueError
        If the file gives no recording; the line says why.
    """
    return read_xtf_files([Path(path)], channels)[0]


def read_xtf_files(paths: Sequence[Path], channels: str | None = None) -> list[Recording]:
    """Read several XTF files into one local frame.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    channels : str or None
        As for `read_xtf`.

    Returns
    -------
    recordings : list of Recording
        One a file, in the order of time; the origin of their frame is the first good ping of the first.

    Raises
    ------
    ValueError
        If a file gives no recording, or some positions are degrees and some are metres.
    """
    dives = sorted((_extract(path, channels) for path in paths), key=lambda dive: dive.time[0])
    first = dives[0]
    for dive in dives[1:]:
        if dive.is_geographic != first.is_geographic:
            raise ValueError(
                f"{first.path} and {dive.path}: one has positions in degrees and one in metres; one kind is wanted"
            )
    origin = float(first.navigation.east[0]), float(first.navigation.north[0])
    georeference = Georeference(latitude=origin[1], longitude=origin[0]) if first.is_geographic else None
    return [_recording(dive, georeference, origin) for dive in dives]


def _extract(path: Path, channels: str | None) -> _Dive:
    """Everything of one file; its name goes before any complaint."""
    try:
        return _read_dive(path, map_file(path), channels)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _read_dive(path: Path, data: mmap.mmap, channels: str | None) -> _Dive:
    # Packets, and the channel blocks in them
    header = read_file_header(data)
    index = index_packets(data, header.start)
    pings = gather(data, index.pings, PING_HEADER)
    blocks = read_blocks(data, index, pings, header.channels)

    # The two channels
    sound_speed, notes = sound_speeds(pings)
    slant_range = slant_ranges(blocks, sound_speed)
    listing = side_scan_channels(header.channels, blocks, slant_range)
    _check_listing(listing, header, index)
    pair = choose_pair(listing, channels)
    check_samples(pair)

    # The pings that have samples and a position
    rows = match_sides(pair, blocks, slant_range, pings["PingNumber"].astype(np.int64))
    _check_rows(rows)
    navigation, is_geographic, more = raw_navigation(pings[rows.ping], header.nav_units)
    time, repairs = repair_times(ping_stamps(pings[rows.ping]), _nominal_interval(blocks, rows))
    navigation, replaced = better_navigation(navigation, is_geographic, time, read_raw_series(data, index))
    is_good = good_pings(navigation, is_geographic)
    if not is_good.any():
        navigation, unplaced = without_positions(navigation)
        is_good, is_geographic, more = ~is_good, False, [*more, *unplaced]
    rows, navigation, time = rows[is_good], navigation[is_good], time[is_good]
    lines = read_sides(data, pair, blocks, rows, navigation.altitude)
    n_dropped = index.n_cut + _count_dropped(len(pings), blocks, pair, rows)

    notes = [
        *_notes(index, listing, pair, n_dropped),
        *lines.notes,
        *gain_notes(pair, blocks),
        *more,
        *notes,
        *repairs,
        *replaced,
    ]
    sha256, sonar = hashlib.sha256(data).hexdigest(), _sonar(pair)
    geometry = rows.sample_spacing, sound_speed[rows.ping]
    return _Dive(path, sha256, lines, *geometry, time, navigation, is_geographic, sonar, n_dropped, notes)


def _check_listing(listing: list[Channel], header: FileHeader, index: PacketIndex) -> None:
    """Refuse a file without side-scan pings, saying what it holds instead."""
    if listing:
        return
    n_sides = int(np.isin(header.channels["TypeOfChannel"], SIDE_TYPES).sum())
    kinds = (
        ", ".join(f"{n} packets of type {kind}" for kind, n in index.kinds.items())
        or f"no whole packet from byte {header.start} on"
    )
    what = "no side-scan ping with samples" if n_sides else "no side-scan channel"
    raise ValueError(f"the file has {what} ({kinds}); an XTF with port or starboard pings is wanted")


def _check_rows(rows: Rows) -> None:
    if not len(rows.ping):
        raise ValueError("port and starboard have different sample spacings in every ping; one spacing is wanted")


def _nominal_interval(blocks: Blocks, rows: Rows) -> float:
    """Time between pings where no stamp tells: as recorded, or the time that sound needs there and back [s]."""
    sides = np.maximum(rows.port, rows.starboard)
    recorded = as_float64(blocks.header["SecondsPerPing"][sides])
    known = recorded[(recorded > 1e-3) & (recorded < 60)]
    travel = float(np.median(rows.sample_spacing * blocks.n_samples[sides])) * 2 / 1500.0
    return float(np.median(known)) if known.size else max(travel, 1e-3)


def _count_dropped(n_pings: int, blocks: Blocks, pair: Pair, rows: Rows) -> int:
    """Sonar packets of the pair, or without a whole block, that gave no line."""
    of_pair = np.isin(blocks.channel, [c.index for c in pair.channels])
    empty = np.setdiff1d(np.arange(n_pings), blocks.ping)
    used = np.concatenate([blocks.ping[side[side >= 0]] for side in (rows.port, rows.starboard)])
    return len(np.setdiff1d(np.union1d(blocks.ping[of_pair], empty), used))


def _notes(index: PacketIndex, listing: list[Channel], pair: Pair, n_dropped: int) -> list[str]:
    notes = []
    if len(listing) > len(pair.channels):
        others = ", ".join(str(c) for c in listing if c not in pair.channels)
        notes.append(f"channels {pair} are taken; the file also has {others}")
    for side in ("port", "starboard"):
        if getattr(pair, side) is None:
            notes.append(f"the file has no {side} channel: that side is unknown")
    notes += index.skipped.notes("packets")
    if n_dropped:
        notes.append(f"pings dropped, for lack of position or samples: {n_dropped}")
    return notes


def _sonar(pair: Pair) -> SonarGeometry:
    """The sonar as the channel table has it; zero means unknown there."""
    info = pair.channels[0].info
    beamwidth, vertical, tilt = (
        float(np.radians(angle)) if 0 < angle < 180 else np.nan
        for angle in (float(info[name]) for name in ("HorizBeamAngle", "BeamWidth", "TiltAngle"))
    )
    port, starboard = _lever_arm(pair.port), _lever_arm(pair.starboard)
    return SonarGeometry(pair.channels[0].frequency, beamwidth, vertical, tilt, port, starboard)


def _lever_arm(channel: Channel | None) -> tuple[float, float, float]:
    """Transducer in the body frame [m]; the file has starboard, forward, down."""
    if channel is None:
        return 0.0, 0.0, 0.0
    starboard, forward, down = (float(channel.info[f"Offset{axis}"]) for axis in "XYZ")
    arm = forward, 0.0 - starboard, 0.0 - down  # 0 - 0 is 0, but -0 prints a sign
    return arm if all(abs(value) < _MAX_LEVER_ARM for value in arm) else (0.0, 0.0, 0.0)


def _recording(dive: _Dive, georeference: Georeference | None, origin: tuple[float, float]) -> Recording:
    """The dive of one file in the local frame."""
    trajectory, notes = make_trajectory(dive.navigation, dive.time, georeference, origin)
    speed, more = speed_in_metres(dive.navigation.speed, trajectory)
    if georeference is None and origin != (0.0, 0.0):
        notes.append(
            f"positions are metres of an unnamed grid; the origin is easting {origin[0]:.3f}, northing {origin[1]:.3f}"
        )
    return Recording(
        port=dive.lines.port,
        starboard=dive.lines.starboard,
        sample_spacing=dive.sample_spacing,
        sound_speed=dive.sound_speed,
        trajectory_dr=trajectory,
        altitude=dive.navigation.altitude,
        depth=dive.navigation.depth,
        speed=speed,
        sonar=dive.sonar,
        georeference=georeference,
        source=dive.path.name.encode("utf-8", "replace").decode(),
        source_sha256=dive.sha256,
        notes=(*dive.notes, *notes, *more),
        n_dropped=dive.n_dropped,
    )
