"""JSF navigation: ping headers, attitude (type 2020), NMEA strings (2002), and sensors where pings hold nothing."""

import mmap
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from operator import xor

import numpy as np

from frontend.arrays import AnyArray, BoolArray, FloatArray
from sssslam.readers.jsf_messages import NMEA, PITCH_ROLL, Messages
from sssslam.readers.jsf_pings import SonarData
from sssslam.readers.jsf_sensors import Series, at_pings, is_set, read_sensors, times
from sssslam.readers.layout import as_float64, gather, layout
from sssslam.readers.xtf_navigation import RawNavigation

ATTITUDE = layout(
    44,
    {
        "Time": (0, "<i4"),
        "Milliseconds": (4, "<i4"),
        "Pitch": (24, "<i2"),
        "Roll": (26, "<i2"),
        "Heading": (34, "<u2"),
        "Validity": (36, "<u4"),
    },
)
_NMEA_START = layout(12, {"Time": (0, "<i4"), "Milliseconds": (4, "<i4")})
# Bits of the validity flag of a ping, and of an attitude message.
_POSITION, _SPEED, _HEADING, _ATTITUDE, _ALTITUDE, _DEPTH, _SOUND_SPEED = 0, 2, 3, 5, 6, 9, 14
_PITCH_BIT, _ROLL_BIT, _HEADING_BIT = 6, 7, 9
_HALF_TURN = np.pi / 32768
_KNOT = 1852 / 3600
# Coordinate units: metres of one step of a grid; 2 is ten-thousandths of a minute of arc.
_GRID_UNITS = {1: 1e-3, 3: 0.1, 4: 0.01}
_ARC, _PER_DEGREE = 2, 600_000.0
_SOUND_SPEED_BOUNDS = (1350.0, 1650.0)
_MAX_NMEA = 200
# A sensor's positions are taken if they cover more than this share of the pings.
_COVERED = 0.9
_FILLED = ("roll", "pitch", "heading", "altitude", "depth", "speed")
_POSITION_SENTENCE = re.compile(
    rb"\$(..(?:GGA,[^,]*|RMC,[^,]*,A|GLL),(\d+\.?\d*),([NS]),(\d+\.?\d*),([EW]),[^*]*)\*([0-9A-Fa-f]{2})"
)


def read_navigation(data: mmap.mmap, messages: Messages, pings: SonarData) -> tuple[RawNavigation, bool, list[str]]:
    """Read the navigation that belongs to pings.

    Parameters
    ----------
    data : mmap
        The file.
    messages : Messages
        Its messages.
    pings : SonarData
        The pings, of one side.

    Returns
    -------
    navigation : RawNavigation
        One row a ping; speed in m/s.
    is_geographic : bool
        Whether positions are degrees.
    notes : list of str
        What was taken from where.
    """
    navigation, is_geographic, notes = _from_headers(pings.header)
    if not np.isfinite(navigation.east).any():
        longitude, latitude = _nmea_positions(data, messages.of(NMEA, _NMEA_START.itemsize + 1), pings.stamp)
        if np.isfinite(longitude).any():
            navigation, is_geographic = replace(navigation, east=longitude, north=latitude), True
            notes.append("no ping holds a position: those of the NMEA strings are taken")
    navigation, more = _with_attitude(data, messages.of(PITCH_ROLL, ATTITUDE.itemsize), pings.stamp, navigation)
    sensors = read_sensors(data, messages, pings.stamp)
    navigation, is_placed, placed = _with_place(navigation, sensors)
    navigation, filled = _filled(navigation, sensors)
    return navigation, is_geographic or is_placed, [*notes, *more, *placed, *filled]


def sound_speeds(header: AnyArray) -> tuple[FloatArray, list[str]]:
    """Sound speed of each ping.

    Parameters
    ----------
    header : ndarray of SONAR, shape (N,)
        The headers.

    Returns
    -------
    sound_speed : ndarray, shape (N,)
        As recorded where that is plausible, else 1500 [m/s].
    notes : list of str
        What was assumed.
    """
    recorded = as_float64(header["SoundSpeed"])
    is_known = (recorded >= _SOUND_SPEED_BOUNDS[0]) & (recorded <= _SOUND_SPEED_BOUNDS[1])
    n = int((~is_known).sum())
    note = f"sound speed is missing or implausible in {n} of {len(header)} pings: 1500 m/s is assumed"
    return np.where(is_known, recorded, 1500.0), [note] if n else []


def _from_headers(header: AnyArray) -> tuple[RawNavigation, bool, list[str]]:
    """Navigation of the ping headers; NaN where a flag says that it is not valid."""
    notes = []
    flags = header["Validity"]
    if not flags.any():
        # Old files have no flags: a number that is not zero was recorded.
        notes.append("no field of any ping is flagged as valid: those that are not zero are taken")
        flags = np.full(len(header), 0xFFFF, dtype=np.uint16)
    east, north, is_geographic = _positions(header, is_set(flags, _POSITION))
    # The speed in knots has tenths, and hundredths among the extending bits.
    speed = (header["Speed"] / 10 + (header["LeastSignificantBits2"] & 0xF) / 100) * _KNOT
    heading = np.where(header["Heading"] <= 36000, header["Heading"] / 100, np.nan)
    pitch_roll = is_set(flags, _ATTITUDE)
    navigation = RawNavigation(
        east=east,
        north=north,
        roll=_valid(header["Roll"] * _HALF_TURN, pitch_roll),
        pitch=_valid(header["Pitch"] * _HALF_TURN, pitch_roll),
        heading=_valid(np.radians(heading), is_set(flags, _HEADING)),
        altitude=_valid(header["Altitude"] / 1e3, is_set(flags, _ALTITUDE) & (header["Altitude"] > 0)),
        depth=_valid(header["Depth"] / 1e3, is_set(flags, _DEPTH)),
        speed=_valid(speed, is_set(flags, _SPEED)),
    )
    return navigation, is_geographic, notes


def _valid(values: FloatArray, is_valid: BoolArray) -> FloatArray:
    """Values where they are valid, else NaN; NaN throughout if all that is valid is zero: never recorded."""
    known = np.where(is_valid, values, np.nan)
    return known if np.any(np.nan_to_num(known) != 0) else np.full(len(values), np.nan)


def _positions(header: AnyArray, is_valid: BoolArray) -> tuple[FloatArray, FloatArray, bool]:
    """Positions in the unit of most pings: longitude and latitude [deg], or metres of a grid."""
    units = header["CoordinateUnits"]
    is_valid = is_valid & ((header["Longitude"] != 0) | (header["Latitude"] != 0))
    is_valid &= np.isin(units, [_ARC, *_GRID_UNITS])
    kinds, counts = np.unique(units[is_valid], return_counts=True)
    unit = int(kinds[np.argmax(counts)]) if kinds.size else _ARC
    scale = _GRID_UNITS.get(unit, 1 / _PER_DEGREE)
    east, north = (scale * header[name].astype(np.float64) for name in ("Longitude", "Latitude"))
    is_valid &= units == unit
    if unit == _ARC:
        is_valid &= (np.abs(north) <= 90) & (np.abs(east) <= 360)
    return np.where(is_valid, east, np.nan), np.where(is_valid, north, np.nan), unit == _ARC


def _with_attitude(
    data: mmap.mmap, messages: Messages, stamp: FloatArray, navigation: RawNavigation
) -> tuple[RawNavigation, list[str]]:
    """The navigation with pitch and roll of attitude messages, and their heading where pings have none."""
    attitude = gather(data, messages.offset, ATTITUDE)
    time, flags = times(attitude), attitude["Validity"]
    found = {}
    for name, bit, unit in (("Pitch", _PITCH_BIT, _HALF_TURN), ("Roll", _ROLL_BIT, _HALF_TURN)):
        found[name.lower()] = at_pings(
            stamp, time, np.where(is_set(flags, bit), attitude[name] * unit, np.nan), 2 * np.pi
        )
    if not np.isfinite(navigation.heading).any():
        heading = np.where(is_set(flags, _HEADING_BIT), np.radians(attitude["Heading"] / 100), np.nan)
        found["heading"] = at_pings(stamp, time, heading, 2 * np.pi)
    used = {name: values for name, values in found.items() if np.isfinite(values).any()}
    merged = {name: np.where(np.isfinite(values), values, getattr(navigation, name)) for name, values in used.items()}
    note = f"{' and '.join(used)} are interpolated from {len(time)} attitude messages"
    return replace(navigation, **merged), [note] if used else []


def _with_place(navigation: RawNavigation, sensors: Mapping[str, Series]) -> tuple[RawNavigation, bool, list[str]]:
    """Positions of a sensor that covers the dive, which are finer than the 0.2 m of ping headers and come oftener."""
    for name, said in sensors.items():
        if {"east", "north"} <= said.keys():
            is_known = np.isfinite(said["east"]) & np.isfinite(said["north"])
            if is_known.mean() > _COVERED or not np.isfinite(navigation.east).any():
                place = {axis: np.where(is_known, said[axis], np.nan) for axis in ("east", "north")}
                return replace(navigation, **place), True, [f"position is interpolated from {name}"]
    return navigation, False, []


def _filled(navigation: RawNavigation, sensors: Mapping[str, Series]) -> tuple[RawNavigation, list[str]]:
    """What no ping holds, from the first sensor that knows it."""
    notes = []
    for name, said in sensors.items():
        lacking = [q for q in _FILLED if q in said and not np.isfinite(getattr(navigation, q)).any()]
        if lacking:
            navigation = replace(navigation, **{quantity: said[quantity] for quantity in lacking})
            notes.append(f"{', '.join(lacking)}: no ping holds any, interpolated from {name}")
    return navigation, notes


def _nmea_positions(data: mmap.mmap, messages: Messages, stamp: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Longitude and latitude [deg] of the last position string before each ping; NaN before the first."""
    when = times(gather(data, messages.offset, _NMEA_START))
    rows = []
    for offset, size, time in zip(messages.offset.tolist(), messages.header["size"].tolist(), when, strict=True):
        text = data[offset + _NMEA_START.itemsize : offset + min(int(size), _MAX_NMEA)]
        match = _POSITION_SENTENCE.match(text)
        if match and np.isfinite(time) and reduce(xor, match[1]) == int(match[6], 16):
            rows.append((time, _degrees(match[4], match[5]), _degrees(match[2], match[3])))
    if not rows:
        return np.full(len(stamp), np.nan), np.full(len(stamp), np.nan)
    at, longitude, latitude = np.array(sorted(rows), dtype=np.float64).T
    last = np.searchsorted(at, stamp, side="right") - 1
    return np.where(last >= 0, longitude[last], np.nan), np.where(last >= 0, latitude[last], np.nan)


def _degrees(text: bytes, hemisphere: bytes) -> float:
    """Degrees of ``dddmm.mmmm``; south and west are negative."""
    degrees, minutes = divmod(float(text), 100)
    return (-1 if hemisphere in b"SW" else 1) * (degrees + minutes / 60)
