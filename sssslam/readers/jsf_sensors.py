"""JSF sensor messages: situation (types 2090 and 2091), Doppler log (2080) and pressure sensor (2060), at the pings."""

import mmap
from collections.abc import Callable, Mapping

import numpy as np

from frontend.arrays import AnyArray, BoolArray, FloatArray
from sssslam.readers.jsf_messages import Messages
from sssslam.readers.layout import as_float64, gather, layout

# A measurement this far in time from a ping is not that of the ping [s].
_MAX_GAP = 1.0
_NO_VELOCITY, _MAX_SPEED, _MAX_DEPTH = -32768, 50.0, 12e3
_HEAD: dict[str, tuple[int, str]] = {"Time": (0, "<i4"), "Milliseconds": (4, "<i4"), "Validity": (12, "<u4")}
_PRESSURE = layout(40, {**_HEAD, "Validity": (24, "<i4"), "Depth": (36, "<i4")})
_DOPPLER = layout(
    58,
    {
        **_HEAD,
        "Ranges": (16, "4<i4"),
        "Velocity": (32, "2<i2"),
        "Depth": (44, "<u2"),
        "Pitch": (46, "<i2"),
        "Roll": (48, "<i2"),
        "Heading": (50, "<u2"),
    },
)
_SITUATION = layout(
    140,
    {
        **_HEAD,
        **{name: (28 + 8 * k, "<f8") for k, name in enumerate(("Latitude", "Longitude", "Depth", "Heading"))},
        "Pitch": (60, "<f8"),
        "Roll": (68, "<f8"),
        "Forward": (100, "<f8"),
    },
)
_SITUATION_2 = layout(
    84,
    {
        **_HEAD,
        "VelocityKind": (16, "u1"),
        "Latitude": (28, "<f8"),
        "Longitude": (36, "<f8"),
        "Depth": (44, "<f4"),
        "Altitude": (48, "<f4"),
        "Velocity": (56, "2<f4"),
        "Pitch": (68, "<f4"),
        "Roll": (72, "<f4"),
        "Heading": (76, "<f4"),
    },
)
Series = Mapping[str, FloatArray]


def times(messages: AnyArray) -> FloatArray:
    """Times of messages that are not pings.

    Parameters
    ----------
    messages : ndarray, shape (K,)
        Structures with the fields ``Time`` and ``Milliseconds``.

    Returns
    -------
    time : ndarray, shape (K,)
        Seconds since 1970 UTC; NaN where they make no sense.
    """
    is_sound = (messages["Time"] > 0) & (messages["Milliseconds"] >= 0) & (messages["Milliseconds"] < 1000)
    return np.where(is_sound, messages["Time"] + messages["Milliseconds"] / 1e3, np.nan)


def is_set(flags: AnyArray, bit: int) -> BoolArray:
    """Whether a bit of flags is set.

    Parameters
    ----------
    flags : ndarray of int, shape (K,)
        The flags.
    bit : int
        Number of the bit, the lowest is 0.

    Returns
    -------
    is_set : ndarray of bool, shape (K,)
        True where it is.
    """
    return np.asarray((flags >> bit) & 1 == 1)


def at_pings(stamp: FloatArray, time: FloatArray, values: FloatArray, period: float = np.inf) -> FloatArray:
    """A measurement interpolated to the times of pings.

    Parameters
    ----------
    stamp : ndarray, shape (N,)
        Times of the pings [s].
    time, values : ndarray, shape (K,)
        When and what was measured; NaN where unknown.
    period : float
        After which values repeat, as angles do.

    Returns
    -------
    values : ndarray, shape (N,)
        Linear between measurements, the short way round; NaN more than a second from the nearest.
    """
    known = np.flatnonzero(np.isfinite(time) & np.isfinite(values))
    if not known.size:
        return np.full(len(stamp), np.nan)
    at, first = np.unique(time[known], return_index=True)
    measured = values[known][first]
    found = np.interp(stamp, at, np.unwrap(measured, period=period) if np.isfinite(period) else measured)
    after = np.clip(np.searchsorted(at, stamp), 0, len(at) - 1)
    gap = np.minimum(np.abs(at[after] - stamp), np.abs(at[np.maximum(after - 1, 0)] - stamp))
    return np.where(gap <= _MAX_GAP, found, np.nan)


def read_sensors(data: mmap.mmap, messages: Messages, stamp: FloatArray) -> dict[str, Series]:
    """Read what sensors say at the times of pings.

    Parameters
    ----------
    data : mmap
        The file.
    messages : Messages
        Its messages.
    stamp : ndarray, shape (N,)
        Times of the pings [s].

    Returns
    -------
    sensors : dict of str to dict of str to ndarray, shape (N,)
        By the name of the sensor, the better first, the quantities of `RawNavigation` that it knows anywhere: longitude
        and latitude as ``east`` and ``north`` [deg], nautical attitude [rad], metres, metres a second.
    """
    found: dict[str, Series] = {}
    for name, (kind, dtype, say) in _SENSORS.items():
        rows = messages.of(kind, dtype.itemsize)
        if len(rows.offset):
            said = gather(data, rows.offset, dtype)
            period = {"east": 360.0, "heading": 2 * np.pi}
            at = {q: at_pings(stamp, times(said), v, period.get(q, np.inf)) for q, v in say(said).items()}
            found[name] = {q: values for q, values in at.items() if np.isfinite(values).any()}
    return found


def _where(values: AnyArray, is_valid: BoolArray, most: float) -> FloatArray:
    """Numbers that are valid and can be."""
    numbers = as_float64(values)
    return np.where(is_valid & (np.abs(numbers) <= most), numbers, np.nan)


def _place(said: AnyArray, is_valid: BoolArray) -> dict[str, FloatArray]:
    """Longitude and latitude; the place without either is none."""
    is_valid = is_valid & ((said["Longitude"] != 0) | (said["Latitude"] != 0))
    return {"east": _where(said["Longitude"], is_valid, 360.0), "north": _where(said["Latitude"], is_valid, 90.0)}


def _angles(said: AnyArray, bits: Mapping[str, int], unit: float) -> dict[str, FloatArray]:
    flags = said["Validity"]
    return {
        name.lower(): np.radians(unit * _where(said[name], is_set(flags, bit), 360.0 / unit))
        for name, bit in bits.items()
    }


def _situation(said: AnyArray) -> dict[str, FloatArray]:
    flags = said["Validity"]
    return {
        **_place(said, is_set(flags, 1) & is_set(flags, 2)),
        **_angles(said, {"Heading": 4, "Pitch": 5, "Roll": 6}, 1.0),
        "depth": _where(said["Depth"], is_set(flags, 3), _MAX_DEPTH),
        "speed": _where(said["Forward"], is_set(flags, 10), _MAX_SPEED),
    }


def _situation_2(said: AnyArray) -> dict[str, FloatArray]:
    flags = said["Validity"]
    velocity = _where(said["Velocity"], is_set(flags, 6)[:, None], _MAX_SPEED)
    # North and east, forward and starboard, or turned from those by 45 degrees.
    turned = (velocity[:, 0] - velocity[:, 1]) / np.sqrt(2)
    over_ground = np.hypot(velocity[:, 0], velocity[:, 1])
    speed = np.select([said["VelocityKind"] == k for k in (0, 1, 2)], [over_ground, velocity[:, 0], turned], np.nan)
    return {
        **_place(said, is_set(flags, 1) & is_set(flags, 2)),
        **_angles(said, {"Heading": 10, "Pitch": 8, "Roll": 9}, 1.0),
        "depth": _where(said["Depth"], is_set(flags, 3), _MAX_DEPTH),
        "altitude": _where(said["Altitude"], is_set(flags, 4), _MAX_DEPTH),
        "speed": speed,
    }


def _doppler(said: AnyArray) -> dict[str, FloatArray]:
    flags, velocity = said["Validity"], said["Velocity"]
    is_sound = ~is_set(flags, 31)
    starboard, forward = (velocity[:, k] / 1e3 for k in (0, 1))
    speed = np.where(is_set(flags, 1), forward, np.hypot(starboard, forward))
    ranges = np.where(said["Ranges"] > 0, said["Ranges"] / 100, np.nan)
    n_beams = np.isfinite(ranges).sum(axis=1)
    altitude = np.nansum(ranges, axis=1) / np.maximum(n_beams, 1)
    return {
        **_angles(said, {"Heading": 6, "Pitch": 7, "Roll": 8}, 0.01),
        "depth": _where(said["Depth"] / 10, is_sound & is_set(flags, 10), _MAX_DEPTH),
        "altitude": _where(altitude, is_sound & is_set(flags, 5) & (n_beams > 0), _MAX_DEPTH),
        "speed": _where(speed, is_sound & is_set(flags, 0) & np.all(velocity != _NO_VELOCITY, axis=1), _MAX_SPEED),
    }


def _pressure(said: AnyArray) -> dict[str, FloatArray]:
    return {"depth": _where(said["Depth"], is_set(said["Validity"], 5), _MAX_DEPTH)}


# The type of message, its layout, and what it says; the better first.
_SENSORS: dict[str, tuple[int, np.dtype[np.void], Callable[[AnyArray], dict[str, FloatArray]]]] = {
    "situation messages (2091)": (2091, _SITUATION_2, _situation_2),
    "situation messages (2090)": (2090, _SITUATION, _situation),
    "Doppler log (2080)": (2080, _DOPPLER, _doppler),
    "pressure sensor (2060)": (2060, _PRESSURE, _pressure),
}
