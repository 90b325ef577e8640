"""Navigation of Humminbird records."""

import numpy as np

from frontend.arrays import FloatArray
from sssslam.readers.humminbird_records import DEPTH, EAST, HEADING, NORTH, SPEED, Records
from sssslam.readers.whole_metres import smooth_whole_metres
from sssslam.readers.xtf_navigation import RawNavigation

# Positions: Mercator metres on a sphere with the equator of the International ellipsoid of 1924; the latitude on it is
# geocentric, and the ratio is that of the ellipsoid's axes, squared.
_RADIUS, _AXES_SQUARED = 6378388.0, 1.0067642927


def read_navigation(records: Records) -> RawNavigation:
    """Take the navigation out of records.

    Parameters
    ----------
    records : Records
        Records of one side.

    Returns
    -------
    navigation : RawNavigation
        Longitude and latitude [deg], heading [rad], altitude [m] (the depth under the transducer) and speed [m/s]; NaN
        where unknown, as roll, pitch and depth always are.
    """
    east, north = (records.field(tag).astype(np.uint32).view(np.int32) for tag in (EAST, NORTH))
    longitude, latitude = _geographic(*smooth_whole_metres(east, north))
    unknown = np.full(len(longitude), np.nan)
    # Zero is what a unit writes that does not know; of heading and speed, only the lower half is the figure.
    heading, speed = ((records.field(tag) & 0xFFFF) / 10 for tag in (HEADING, SPEED))
    altitude = records.field(DEPTH) / 10
    return RawNavigation(
        east=longitude,
        north=latitude,
        roll=unknown,
        pitch=unknown,
        heading=np.radians(np.where((heading <= 360) & heading.any(), heading, np.nan)),
        altitude=np.where((altitude > 0) & (altitude < 1e3), altitude, np.nan),
        depth=unknown,
        speed=np.where((speed <= 100) & speed.any(), speed, np.nan),
    )


def _geographic(east: FloatArray, north: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Longitude and latitude of Mercator metres [deg]."""
    conformal = 2 * np.arctan(np.exp(np.clip(north / _RADIUS, -10, 10))) - np.pi / 2
    latitude = np.degrees(np.arctan(np.tan(conformal) * _AXES_SQUARED))
    return np.degrees(east / _RADIUS), latitude
