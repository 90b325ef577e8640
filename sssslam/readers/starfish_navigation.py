"""Navigation of StarFish logs: of each kind, the packet that came last before a ping."""

import mmap

import numpy as np
from pyproj import CRS, Transformer

from frontend.arrays import AnyArray, FloatArray, IntArray
from sssslam.readers.held_navigation import fix_pings
from sssslam.readers.layout import gather
from sssslam.readers.starfish_packets import Packets, stamps
from sssslam.readers.xtf_navigation import RawNavigation

_HEADING, _POSITION, _SPEED, _DEPTH, _ALTITUDE = 0x20, 0x21, 0x22, 0x24, 0x29
_NUMBER = np.dtype([("value", "<f8")])
_UTM = np.dtype([("band", "u1"), ("zone", "u1"), ("northing", "<f8"), ("easting", "<f8"), ("altitude", "<f8")])
_BANDS = np.frombuffer(b"CDEFGHJKLMNPQRSTUVWX", np.uint8)
_FIRST_NORTHERN_BAND = ord("N")
# Units that a speed can be in [m/s]; the track is measured in steps of this time [s], longer than a fix's noise lasts.
_SPEED_UNITS = {"m/s": 1.0, "km/h": 1 / 3.6, "knots": 1852 / 3600, "miles per hour": 0.44704}
_SPEED_STEP = 2.0
# The nearest two units differ by 15 %: within half of that, which one it is is clear.
_SPEED_TOLERANCE = 0.075


def read_navigation(data: mmap.mmap, packets: Packets, at: IntArray) -> tuple[RawNavigation, list[str]]:
    """Read the navigation that belongs to pings.

    Parameters
    ----------
    data : mmap
        The file.
    packets : Packets
        Its packets.
    at : ndarray of int, shape (P,)
        Where the pings lie [bytes].

    Returns
    -------
    navigation : RawNavigation
        Longitude and latitude [deg], heading [rad], altitude and depth [m], speed [m/s]; NaN where unknown, as roll and
        pitch always are.
    notes : list of str
        What was inferred.
    """
    heading, altitude, depth, speed = (
        _last_numbers(data, packets, opcode, at, bounds)
        for opcode, bounds in (
            (_HEADING, (-360.0, 720.0)),
            (_ALTITUDE, (1e-3, 1e4)),
            (_DEPTH, (-100.0, 12e3)),
            (_SPEED, (0.0, 400.0)),
        )
    )
    fixes = packets.of(_POSITION, _UTM.itemsize)
    utm = gather(data, fixes.offset, _UTM)
    longitude, latitude = _geographic(utm)
    unit, notes = _speed_unit(utm, stamps(fixes.header), speed)
    unknown = np.full(len(at), np.nan)
    navigation = RawNavigation(
        east=_last(longitude, fixes.offset, at),
        north=_last(latitude, fixes.offset, at),
        roll=unknown,
        pitch=unknown,
        heading=np.radians(heading),
        altitude=altitude,
        depth=depth,
        speed=unit * speed,
    )
    return navigation, notes


def _last_numbers(
    data: mmap.mmap, packets: Packets, opcode: int, at: IntArray, bounds: tuple[float, float]
) -> FloatArray:
    """The number that came last before each ping; NaN where none did or it is out of bounds."""
    chosen = packets.of(opcode, _NUMBER.itemsize)
    values = _last(gather(data, chosen.offset, _NUMBER)["value"], chosen.offset, at)
    return np.where((values >= bounds[0]) & (values <= bounds[1]), values, np.nan)


def _last(values: FloatArray, offset: IntArray, at: IntArray) -> FloatArray:
    """Of values at places of the file, the last before each of other places; NaN where there is none."""
    row = np.searchsorted(offset, at) - 1
    return np.append(values, np.nan)[np.where(row >= 0, row, len(values))]


def _geographic(utm: AnyArray) -> tuple[FloatArray, FloatArray]:
    """Longitude and latitude of UTM positions [deg]; NaN where they are impossible."""
    longitude, latitude = np.full((2, len(utm)), np.nan)
    is_possible = (utm["easting"] > 1e5) & (utm["easting"] < 9e5) & (utm["northing"] >= 0) & (utm["northing"] < 1e7)
    is_possible &= (utm["zone"] >= 1) & (utm["zone"] <= 60) & np.isin(utm["band"], _BANDS)
    grid = np.where(utm["band"] >= _FIRST_NORTHERN_BAND, 32600, 32700) + utm["zone"]
    for code in np.unique(grid[is_possible]).tolist():
        rows = np.flatnonzero(is_possible & (grid == code))
        transformer = Transformer.from_crs(CRS.from_epsg(code), CRS.from_epsg(4326), always_xy=True)
        longitude[rows], latitude[rows] = transformer.transform(utm["easting"][rows], utm["northing"][rows])
    return longitude, latitude


def _speed_unit(utm: AnyArray, stamp: FloatArray, recorded: FloatArray) -> tuple[float, list[str]]:
    """The unit [m/s] in which the recorded speed fits the track; NaN if none does."""
    usual = float(np.mean(recorded[np.isfinite(recorded)])) if np.isfinite(recorded).any() else 0.0
    track = _speed_along_track(utm, stamp)
    if not (usual > 0 and track > 0):
        return np.nan, ["the unit of speed is not in the file and the track does not tell: speed is unknown"]
    name, unit = min(_SPEED_UNITS.items(), key=lambda item: abs(np.log(track / (usual * item[1]))))
    figures = f"{usual:.2f} recorded, {track:.2f} m/s along the track"
    if abs(np.log(track / (usual * unit))) > _SPEED_TOLERANCE:
        return np.nan, [f"the unit of speed is not in the file and none fits the track ({figures}): speed is unknown"]
    return unit, [f"the unit of speed is not in the file; {name} fits the track ({figures}) and is taken"]


def _speed_along_track(utm: AnyArray, stamp: FloatArray) -> float:
    """Median speed between fixes some time apart [m/s]; NaN where it cannot be told."""
    known = np.flatnonzero(np.isfinite(stamp) & np.isfinite(utm["easting"]) & np.isfinite(utm["northing"]))
    if known.size < 2:
        return np.nan
    east, north, time = utm["easting"][known], utm["northing"][known], stamp[known]
    fixes = fix_pings(east, north)
    interval = float(np.median(np.diff(time[fixes]))) if len(fixes) > 1 else 0.0
    stride = max(int(np.ceil(_SPEED_STEP / interval)), 1) if interval > 0 else 1
    chosen = fixes[::stride]
    duration = np.diff(time[chosen])
    steps = np.hypot(np.diff(east[chosen]), np.diff(north[chosen]))
    is_forward = duration > 0
    return float(np.median(steps[is_forward] / duration[is_forward])) if is_forward.any() else np.nan
