"""Navigation of XTF pings: positions, attitude, altitude, depth, speed and sound speed out of the ping headers."""

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
import pyxtf

from frontend.arrays import AnyArray, BoolArray, FloatArray
from sssslam.readers.held_navigation import stray_positions
from sssslam.readers.layout import as_float64
from sssslam.readers.ping_times import seconds_since_1970

_DEGREES = pyxtf.XTFNavUnits.latlon.value
METRES_PER_DEGREE = 111.3e3
# Sound in water [m/s]; the format's default is half of it, 750 m/s "one way".
_SOUND_SPEED, _SOUND_SPEED_BOUNDS = 1500.0, (1350.0, 1650.0)


@dataclass(frozen=True)
class RawNavigation:
    """Navigation as recorded, one row a ping; NaN where unknown.

    Parameters
    ----------
    east, north : ndarray, shape (P,)
        Longitude and latitude [deg], or grid easting and northing [m].
    roll, pitch, heading : ndarray, shape (P,)
        Nautical attitude: starboard down, nose up, clockwise from north [rad].
    altitude, depth, speed : ndarray, shape (P,)
        Above the seafloor, below the surface [m], and speed, in knots if the writer kept to the format.
    """

    east: FloatArray
    north: FloatArray
    roll: FloatArray
    pitch: FloatArray
    heading: FloatArray
    altitude: FloatArray
    depth: FloatArray
    speed: FloatArray

    def __getitem__(self, pings: AnyArray) -> Self:
        return type(self)(*(getattr(self, f.name)[pings] for f in fields(self)))


def ping_stamps(pings: AnyArray) -> FloatArray:
    """Times of the ping headers.

    Parameters
    ----------
    pings : ndarray of PING_HEADER, shape (P,)
        The headers.

    Returns
    -------
    stamps : ndarray, shape (P,)
        Seconds since 1970 UTC; NaN where a field is out of its range.
    """
    fields = [pings[name].astype(np.float64) for name in ("Year", "Month", "Day", "Hour", "Minute", "Second")]
    hundredths = pings["HSeconds"].astype(np.float64)
    fields[-1] = np.where(hundredths < 100, fields[-1] + hundredths / 100, np.nan)
    return seconds_since_1970(np.stack(fields))


def sound_speeds(pings: AnyArray) -> tuple[FloatArray, list[str]]:
    """Sound speed of each ping.

    Parameters
    ----------
    pings : ndarray of PING_HEADER, shape (P,)
        The headers.

    Returns
    -------
    sound_speed : ndarray, shape (P,)
        Sound speed [m/s].
    notes : list of str
        What was assumed.
    """
    recorded = _plausible(pings["SoundVelocity"], 0.0, np.inf)
    low, high = _SOUND_SPEED_BOUNDS
    doubled = np.where(recorded < 0.75 * low, 2 * recorded, recorded)
    is_known = (doubled >= low) & (doubled <= high)
    computed = _plausible(pings["ComputedSoundVelocity"], low, high)
    speed = np.where(is_known, doubled, np.where(np.isfinite(computed), computed, _SOUND_SPEED))
    n_assumed = int((~is_known & np.isnan(computed)).sum())
    note = (
        f"sound speed is missing or implausible in {n_assumed} of {len(pings)} pings: {_SOUND_SPEED:g} m/s is assumed"
    )
    return speed, [note] if n_assumed else []


def _plausible(field: AnyArray, low: float, high: float) -> FloatArray:
    """A field as float64; NaN outside its bounds."""
    values = as_float64(field)
    return np.where((values >= low) & (values <= high), values, np.nan)


def _recorded(field: AnyArray, low: float, high: float) -> FloatArray:
    """A field as float64; NaN outside its bounds, and everywhere if it is zero throughout: never recorded."""
    values = _plausible(field, low, high)
    return values if np.any(np.nan_to_num(values) != 0) else np.full(len(values), np.nan)


def raw_navigation(pings: AnyArray, nav_units: int) -> tuple[RawNavigation, bool, list[str]]:
    """Take the navigation out of ping headers.

    Parameters
    ----------
    pings : ndarray of PING_HEADER, shape (P,)
        The headers.
    nav_units : int
        The file header's unit of positions: 3 degrees, 0 metres.

    Returns
    -------
    navigation : RawNavigation
        One row a ping.
    is_geographic : bool
        Whether positions are degrees.
    notes : list of str
        What was assumed.
    """
    east, north, notes = _positions(pings)
    is_geographic, more = _are_degrees(east, north, nav_units)
    bad = (np.abs(north) > 90) | (np.abs(east) > 360) if is_geographic else np.hypot(east, north) > 1e8
    heading = _recorded(pings["SensorHeading"], -360.0, 720.0)
    if np.isnan(heading).all():
        heading = _recorded(pings["ShipGyro"], -360.0, 720.0)
        more = [*more, "no sensor heading: the ship's gyro is taken"] if np.isfinite(heading).any() else more
    altitudes = [_plausible(pings[name], 1e-3, 1e4) for name in ("SensorPrimaryAltitude", "SensorAuxAltitude")]
    navigation = RawNavigation(
        east=np.where(bad, np.nan, east),
        north=np.where(bad, np.nan, north),
        roll=np.radians(_recorded(pings["SensorRoll"], -180.0, 180.0)),
        pitch=np.radians(_recorded(pings["SensorPitch"], -90.0, 90.0)),
        heading=np.radians(heading),
        altitude=altitudes[0] if np.isfinite(altitudes[0]).any() else altitudes[1],
        depth=_recorded(pings["SensorDepth"], -100.0, 12e3),
        speed=_recorded(pings["SensorSpeed"], 0.0, 100.0),
    )
    return navigation, is_geographic, notes + more


def _positions(pings: AnyArray) -> tuple[FloatArray, FloatArray, list[str]]:
    """East and north of the sensor, or else of the ship; NaN where both are zero."""
    for body, notes in (("Sensor", []), ("Ship", ["no sensor position: the ship's is taken"])):
        east, north = (as_float64(pings[f"{body}{axis}coordinate"]) for axis in "XY")
        is_good = np.isfinite(east) & np.isfinite(north) & ((east != 0) | (north != 0))
        if is_good.any():
            return np.where(is_good, east, np.nan), np.where(is_good, north, np.nan), notes
    return np.full(len(pings), np.nan), np.full(len(pings), np.nan), []


def _are_degrees(east: FloatArray, north: FloatArray, nav_units: int) -> tuple[bool, list[str]]:
    """Whether positions are degrees: as the header says, unless most are beyond what degrees can be."""
    known = np.isfinite(east)
    can_be = bool(np.mean((np.abs(east[known]) <= 360) & (np.abs(north[known]) <= 90)) > 0.5) if known.any() else True
    if nav_units == _DEGREES:
        return can_be, [] if can_be else ["the header says degrees, but positions are beyond 360: metres are assumed"]
    if nav_units == pyxtf.XTFNavUnits.meters.value:
        return False, []
    unit = "degrees" if can_be else "metres"
    return can_be, [f"the header's unit of positions, {nav_units}, is unknown: {unit} are assumed"]


def without_positions(navigation: RawNavigation) -> tuple[RawNavigation, list[str]]:
    """Navigation of a file that has no position: all pings at the origin, until other navigation is joined.

    Parameters
    ----------
    navigation : RawNavigation
        Navigation as recorded.

    Returns
    -------
    navigation : RawNavigation
        East and north are 0 in every ping.
    notes : list of str
        That it is so.
    """
    origin = np.zeros(len(navigation.east))
    note = f"none of {len(origin)} pings has a position (all are zero or not finite): all are placed at the origin"
    return replace(navigation, east=origin, north=origin.copy()), [note]


def good_pings(navigation: RawNavigation, is_geographic: bool) -> BoolArray:
    """Pings whose position can be used.

    Parameters
    ----------
    navigation : RawNavigation
        Navigation as recorded.
    is_geographic : bool
        Whether positions are degrees.

    Returns
    -------
    is_good : ndarray of bool, shape (P,)
        True where the position is known and does not stray from its neighbours.
    """
    is_good = np.isfinite(navigation.east) & np.isfinite(navigation.north)
    known = np.flatnonzero(is_good)
    if known.size:
        east, north = navigation.east[known], navigation.north[known]
        if is_geographic:
            east = np.unwrap(east, period=360) * METRES_PER_DEGREE * np.cos(np.radians(np.median(north)))
            north = north * METRES_PER_DEGREE
        is_good[known] = ~stray_positions(east, north)
    return is_good
