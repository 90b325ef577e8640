"""XTF raw packets: attitude, gyro and positions that a file keeps beside its pings, at rates of their own."""

import mmap

import numpy as np
import pyxtf

from frontend.arrays import AnyArray, BoolArray, FloatArray
from sssslam.navigation.series import Series, make_series
from sssslam.readers.layout import as_float64
from sssslam.readers.ping_times import seconds_since_1970
from sssslam.readers.xtf_packets import PacketIndex, gather, layout

_ATTITUDE, _NAVIGATION = pyxtf.XTFHeaderType.attitude.value, pyxtf.XTFHeaderType.navigation.value
_GYRO, _TIMED_GYRO = pyxtf.XTFHeaderType.gyro.value, pyxtf.XTFHeaderType.sourcetime_gyro.value
_RAW_POSITION = pyxtf.XTFHeaderType.pos_raw_navigation.value
_LAYOUTS = {
    _ATTITUDE: layout(pyxtf.XTFAttitudeData),
    _NAVIGATION: layout(pyxtf.XTFHeaderNavigation),
    _GYRO: layout(pyxtf.XTFHeaderGyro),
    _TIMED_GYRO: layout(pyxtf.XTFHeaderGyro),
    _RAW_POSITION: layout(pyxtf.XTFPosRawNavigation),
}
# Field, bounds and factor of each quantity; angles become radians, positions stay as they are.
_DEGREE = float(np.radians(1.0))
_FIELDS = {
    _ATTITUDE: {
        "roll": ("Roll", 180.0, _DEGREE),
        "pitch": ("Pitch", 90.0, _DEGREE),
        "heading": ("Heading", 720.0, _DEGREE),
    },
    _GYRO: {"heading": ("Gyro", 720.0, _DEGREE)},
    _TIMED_GYRO: {"heading": ("Gyro", 720.0, _DEGREE)},
    _NAVIGATION: {"east": ("RawXcoordinate", 1e8, 1.0), "north": ("RawYcoordinate", 1e8, 1.0)},
    _RAW_POSITION: {
        "east": ("RawXcoordinate", 1e8, 1.0),
        "north": ("RawYcoordinate", 1e8, 1.0),
        "roll": ("Roll", 180.0, _DEGREE),
        "pitch": ("Pitch", 90.0, _DEGREE),
        "heading": ("Heading", 720.0, _DEGREE),
    },
}
_FRACTION_NAMES = ("Millisecond", "Microsecond")
_TENTHS_OF_MILLISECONDS = 9999  # in what pyxtf calls Microsecond, as long as no value is above


def read_raw_series(data: mmap.mmap, index: PacketIndex) -> dict[str, tuple[Series, int]]:
    """Read the raw navigation of a file.

    Parameters
    ----------
    data : mmap
        The file.
    index : PacketIndex
        Its packets.

    Returns
    -------
    series : dict of str to (Series, int)
        For each of east, north (degrees or metres, as the file header says), roll, pitch and heading (nautical, rad)
        that some packet type recorded: the longest series and the type it comes from.
    """
    found: dict[str, tuple[Series, int]] = {}
    for kind, offsets in index.raw.items():
        packets = gather(data, offsets, _LAYOUTS[kind])
        time = packet_times(packets)
        for name, (field, bound, factor) in _FIELDS[kind].items():
            series = make_series(time, _recorded(packets[field], bound, _is_empty(packets)) * factor)
            if series and (name not in found or len(series.time) > len(found[name][0].time)):
                found[name] = series, kind
    return found


def packet_times(packets: AnyArray) -> FloatArray:
    """Times of raw packets.

    Parameters
    ----------
    packets : ndarray, shape (K,)
        Packets of one type.

    Returns
    -------
    time : ndarray, shape (K,)
        Seconds since 1970 UTC; NaN where a field is out of its range.

    Notes
    -----
    The format counts the fraction of a second in tenths of milliseconds in positions and gyro, in milliseconds in
    attitude; some writers put true microseconds there, which shows by values above 9999.
    """
    civil = np.stack(
        [packets[name].astype(np.float64) for name in ("Year", "Month", "Day", "Hour", "Minute", "Second")]
    )
    name = next(name for name in _FRACTION_NAMES if name in (packets.dtype.names or ()))
    count = as_float64(packets[name])
    fine = 1e-4 if count.max(initial=0.0) <= _TENTHS_OF_MILLISECONDS else 1e-6
    unit = 1e-3 if name == "Millisecond" else fine
    civil[5] += np.where(count * unit < 1.0, count * unit, np.nan)
    return seconds_since_1970(civil)


def _recorded(field: AnyArray, bound: float, is_empty: BoolArray) -> FloatArray:
    """A field as float64; NaN beyond its bound, in packets without position, and throughout if it never was set."""
    values = as_float64(field)
    values = np.where(np.isfinite(values) & (np.abs(values) <= bound) & ~is_empty, values, np.nan)
    return values if np.any(np.nan_to_num(values) != 0) else np.full(len(values), np.nan)


def _is_empty(packets: AnyArray) -> BoolArray:
    """Position packets whose coordinates both are zero: no fix."""
    if "RawXcoordinate" not in (packets.dtype.names or ()):
        return np.zeros(len(packets), dtype=np.bool_)
    return np.asarray((packets["RawXcoordinate"] == 0) & (packets["RawYcoordinate"] == 0))
