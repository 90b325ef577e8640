"""Lowrance SL2 and SL3: the recordings of Lowrance and Simrad fish finders with StructureScan."""

import mmap
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from frontend.arrays import AnyArray, FloatArray
from frontend.recording import Recording, SonarGeometry
from sssslam.readers.dives import Pings, read_dives
from sssslam.readers.layout import as_float64
from sssslam.readers.lines import fill_width
from sssslam.readers.lowrance_frames import Frames, read_frames
from sssslam.readers.lowrance_sides import choose_sides, find_sides, read_sides
from sssslam.readers.whole_metres import smooth_whole_metres
from sssslam.readers.xtf_channels import Pair
from sssslam.readers.xtf_navigation import RawNavigation

# Positions: Mercator metres on a sphere of the polar radius of WGS 84.
_RADIUS = 6356752.3142
_FOOT, _KNOT = 0.3048, 1852 / 3600
_SOUND_SPEED = 1500.0
_MAX_DEPTH, _MAX_SPEED = 2000.0, 100.0


def read_lowrance_files(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    """Read SL2 and SL3 files into one local frame.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    channels : str or None
        ``"1,2"`` for two channel numbers counted from 1, ``"800kHz"`` for the pair next to a frequency, or None for the
        finer pair.

    Returns
    -------
    recordings : list of Recording
        One a file, in the order of time.

    Raises
    ------
    ValueError
        If a file gives no recording.
    """
    return read_dives(paths, partial(_read_pings, channels))


def _read_pings(channels: str | None, path: Path, data: mmap.mmap) -> Pings:
    del path  # a recording is one file
    frames = read_frames(data)
    sides = find_sides(frames)
    if not sides:
        raise ValueError(f"the file has no side-scan frame ({_kinds(frames)}); channel 3, 4 or 5 is wanted")
    pair, port, starboard = choose_sides(sides, channels)
    main = port or starboard
    assert main is not None  # a pair has at least one channel
    navigation, notes = _navigation(main.header)
    *lines, turned = read_sides(data, pair, port, starboard, navigation.altitude)
    filled = fill_width(lines[0], lines[1])
    start = int(frames.header["HardwareTime"][0])
    chosen = {channel.index for channel in pair.channels}
    n_dropped = max(len(side.offset) for channel, side in sides if channel.index in chosen) - len(main.offset)
    return Pings(
        port=filled[0],
        starboard=filled[1],
        sample_spacing=main.spacing,
        sound_speed=np.full(len(main.offset), _SOUND_SPEED),
        stamp=start + main.header["Time"] / 1e3,
        navigation=navigation,
        sonar=SonarGeometry(frequency=pair.channels[0].frequency),
        notes=(*_notes(frames, pair, n_dropped), *turned, *notes),
        n_dropped=n_dropped,
    )


def _kinds(frames: Frames) -> str:
    kinds, counts = np.unique(frames.header["Channel"], return_counts=True)
    listing = [f"{n} frames of channel {kind}" for kind, n in zip(kinds.tolist(), counts.tolist(), strict=True)]
    return ", ".join(listing[:10]) or "no whole frame"


def _navigation(header: AnyArray) -> tuple[RawNavigation, list[str]]:
    """Navigation of frames; the depth is that under the transducer, so it is an altitude."""
    longitude, latitude = _geographic(*smooth_whole_metres(header["East"], header["North"]))
    heading, course = (_plausible(header[name], -2 * np.pi, 4 * np.pi) for name in ("Heading", "Course"))
    has_heading = bool(np.isfinite(heading).any())
    unknown = np.full(len(header), np.nan)
    altitude = _plausible(header["Depth"], 0.0, _MAX_DEPTH / _FOOT) * _FOOT
    navigation = RawNavigation(
        east=longitude,
        north=latitude,
        roll=unknown,
        pitch=unknown,
        heading=heading if has_heading else course,
        altitude=np.where(altitude > 0, altitude, np.nan),
        depth=unknown,
        speed=_plausible(header["Speed"], 0.0, _MAX_SPEED / _KNOT) * _KNOT,
    )
    takes_course = not has_heading and bool(np.isfinite(course).any())
    return navigation, ["no compass heading: the course of the GNSS is taken"] if takes_course else []


def _geographic(east: FloatArray, north: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Longitude and latitude of Mercator metres [deg]."""
    latitude = 2 * np.arctan(np.exp(np.clip(north / _RADIUS, -10, 10))) - np.pi / 2
    return np.degrees(east / _RADIUS), np.degrees(latitude)


def _plausible(field: AnyArray, low: float, high: float) -> FloatArray:
    """A field; NaN outside its bounds, and everywhere if it is zero throughout: never recorded."""
    values = as_float64(field)
    known = np.where((values >= low) & (values <= high), values, np.nan)
    return known if np.any(np.nan_to_num(known) != 0) else np.full(len(values), np.nan)


def _notes(frames: Frames, pair: Pair, n_dropped: int) -> list[str]:
    notes = [
        f"sound speed is not in the file: {_SOUND_SPEED:g} m/s is assumed",
        "positions are whole metres of a Mercator map: their steps are smoothed",
    ]
    if not frames.header["HardwareTime"][0]:
        notes.append("the file does not tell the start: times are counted from the start of the recording")
    for side in ("port", "starboard"):
        if getattr(pair, side) is None:
            notes.append(f"the file has no {side} channel: that side is unknown")
    notes += frames.skipped.notes("frames")
    if n_dropped:
        notes.append(f"pings dropped, for lack of a partner on the other side: {n_dropped}")
    return notes
