"""Named values: pings from columns or arrays with the names of the open container, for tables and archives.

One value a ping: ``time`` (seconds since 1970), a position as ``latitude`` and ``longitude`` [deg] or as ``x`` and
``y`` [m] of a local frame, ``sample_spacing`` or ``slant_range_max`` [m]; where known ``sound_speed`` [m/s], ``z`` or
``depth`` and ``altitude`` [m], ``speed`` [m/s], ``roll`` (starboard down) and ``pitch`` (nose down) [rad], and ``yaw``
[rad] (counter-clockwise from east) or ``heading_deg`` (clockwise from north). One for all: ``frequency`` [Hz],
``horizontal_beamwidth``, ``vertical_beamwidth``, ``mounting_depression`` [rad], ``lever_arm_port``,
``lever_arm_starboard`` (forward, port, up) [m], ``quantity``, ``origin_latitude`` and ``origin_longitude`` [deg] of the
local frame.
"""

from collections.abc import Mapping

import numpy as np

from frontend.arrays import AnyArray, Float32Array, FloatArray
from frontend.georeference import Georeference
from frontend.recording import Quantity, SonarGeometry
from sssslam.readers.dives import Pings
from sssslam.readers.xtf_navigation import RawNavigation

SERIES = (
    *("time", "latitude", "longitude", "x", "y", "z", "depth", "altitude", "speed", "roll", "pitch", "yaw"),
    *("heading_deg", "sample_spacing", "slant_range_max", "sound_speed"),
)
NUMBERS = ("frequency", "horizontal_beamwidth", "vertical_beamwidth", "mounting_depression")
ARMS = ("lever_arm_port", "lever_arm_starboard")
ORIGIN = ("origin_latitude", "origin_longitude")
QUANTITY = "quantity"
_SOUND_SPEED, _SOUND_SPEED_BOUNDS = 1500.0, (100.0, 10e3)
# Nothing of a dive is larger, the seconds since 1970 included: beyond it is damage.
_MAX_NUMBER = 1e11
# Degrees up to these are positions; in a frame whose origin is further out, no track could be.
_MAX_LATITUDE, _MAX_LONGITUDE = 90.0, 360.0


def as_samples(numbers: AnyArray) -> Float32Array:
    """Numbers as samples.

    Parameters
    ----------
    numbers : ndarray
        Numbers of any type.

    Returns
    -------
    samples : ndarray of float32
        The same; NaN for what is not finite.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        samples = numbers.astype(np.float32)
    return np.where(np.isfinite(samples), samples, np.float32(np.nan))


def make_pings(
    sides: tuple[Float32Array, Float32Array],
    series: Mapping[str, FloatArray],
    numbers: Mapping[str, FloatArray],
    quantity: str,
) -> Pings:
    """Make pings of named values.

    Parameters
    ----------
    sides : tuple of ndarray of float32, shape (P, M)
        Port and starboard, near end first; NaN where there is no sample.
    series : mapping of str to ndarray, shape (P,)
        Values of each ping, by the names of `SERIES`.
    numbers : mapping of str to ndarray
        Values for all, by the names of `NUMBERS`, `ARMS` (three each) and `ORIGIN`.
    quantity : str
        What the samples are.

    Returns
    -------
    pings : Pings
        The pings.

    Raises
    ------
    ValueError
        If something needed is missing or of the wrong size.
    """
    port, starboard = sides
    series = {name: np.where(np.abs(values) < _MAX_NUMBER, values, np.nan) for name, values in series.items()}
    is_geographic = _is_geographic(series)
    unknown = np.full(len(port), np.nan)
    sound_speed, notes = _sound_speed(series.get("sound_speed", unknown))
    depth = series.get("depth", -series["z"] if "z" in series else unknown)
    yaw = series.get("yaw", np.pi / 2 - np.radians(series.get("heading_deg", unknown)))
    east, north = _position(series, is_geographic)
    return Pings(
        port=port,
        starboard=starboard,
        sample_spacing=_sample_spacing(series, port.shape[1]),
        sound_speed=sound_speed,
        stamp=series["time"],
        navigation=RawNavigation(
            east=east,
            north=north,
            roll=series.get("roll", unknown),
            pitch=-series.get("pitch", unknown),
            heading=np.pi / 2 - yaw,
            altitude=series.get("altitude", unknown),
            depth=depth,
            speed=series.get("speed", unknown),
        ),
        sonar=_sonar(numbers, quantity),
        notes=tuple(notes),
        is_geographic=is_geographic,
        is_local=not is_geographic,
        georeference=_georeference(numbers) if not is_geographic else None,
    )


def _is_geographic(series: Mapping[str, FloatArray]) -> bool:
    """Whether the position is latitude and longitude; refused if there is none, or no time."""
    if "time" not in series:
        raise ValueError("time is missing; seconds since 1970 for each ping are wanted")
    pairs = (("latitude", "longitude"), ("x", "y"))
    found = [pair for pair in pairs if all(name in series for name in pair)]
    if not found:
        raise ValueError("the position is missing; latitude and longitude, or x and y, are wanted")
    return found[0] == pairs[0]


def _position(series: Mapping[str, FloatArray], is_geographic: bool) -> tuple[FloatArray, FloatArray]:
    if not is_geographic:
        return series["x"], series["y"]
    latitude, longitude = series["latitude"], series["longitude"]
    is_possible = (np.abs(latitude) <= _MAX_LATITUDE) & (np.abs(longitude) <= _MAX_LONGITUDE)
    return np.where(is_possible, longitude, np.nan), np.where(is_possible, latitude, np.nan)


def _sample_spacing(series: Mapping[str, FloatArray], n_samples: int) -> FloatArray:
    if "sample_spacing" in series:
        return series["sample_spacing"]
    if "slant_range_max" not in series:
        raise ValueError("the range is missing; sample_spacing or slant_range_max [m] is wanted")
    return series["slant_range_max"] / n_samples


def _sound_speed(recorded: FloatArray) -> tuple[FloatArray, list[str]]:
    is_known = (recorded > _SOUND_SPEED_BOUNDS[0]) & (recorded < _SOUND_SPEED_BOUNDS[1])
    n = int((~is_known).sum())
    note = f"sound speed is missing or impossible in {n} of {len(recorded)} pings: {_SOUND_SPEED:g} m/s is assumed"
    return np.where(is_known, recorded, _SOUND_SPEED), [] if is_known.all() else [note]


def _sonar(numbers: Mapping[str, FloatArray], quantity: str) -> SonarGeometry:
    for name, size in (*((name, 1) for name in (*NUMBERS, *ORIGIN)), *((name, 3) for name in ARMS)):
        if name in numbers and numbers[name].size != size:
            raise ValueError(f"{name} has {numbers[name].size} numbers; {size} wanted")
        if name in numbers and not np.isfinite(numbers[name]).all():
            raise ValueError(f"{name} is {' '.join(map(str, numbers[name].ravel()))}; finite numbers are wanted")
    if quantity not in list(Quantity):
        raise ValueError(f"quantity is {quantity[:40]!r}; {', '.join(Quantity)} is wanted")
    values = [float(numbers[name].ravel()[0]) if name in numbers else np.nan for name in NUMBERS]
    frequency, horizontal, vertical, depression = (np.nan if np.isnan(value) else value for value in values)
    arms = (numbers.get(name, np.zeros(3)).ravel() for name in ARMS)
    port, starboard = ((float(forward), float(port), float(up)) for forward, port, up in arms)
    return SonarGeometry(frequency, horizontal, vertical, depression, port, starboard, Quantity(quantity))


def _georeference(numbers: Mapping[str, FloatArray]) -> Georeference | None:
    if not all(name in numbers for name in ORIGIN):
        return None
    latitude, longitude = (float(numbers[name].ravel()[0]) for name in ORIGIN)
    if not (abs(latitude) < _MAX_LATITUDE and abs(longitude) <= _MAX_LONGITUDE):
        raise ValueError(f"the origin is {latitude:g}, {longitude:g}; a latitude and a longitude in degrees are wanted")
    return Georeference(latitude, longitude)
