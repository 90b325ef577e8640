"""Moments: times as people and instruments write them, to seconds since 1970 UTC."""

from datetime import UTC, date, datetime

import numpy as np

from frontend.arrays import FloatArray

_DAY = 86400.0
# A bare number above is milliseconds, microseconds, nanoseconds since 1970: as seconds it would be after the year 5000.
_UNITS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))


def moment(text: str) -> float:
    """Seconds since 1970 of a written moment.

    Parameters
    ----------
    text : str
        A number (seconds; milliseconds, micro- or nanoseconds if too large for them), or ISO 8601, UTC where it names
        no zone.

    Returns
    -------
    time : float
        Seconds since 1970 UTC.

    Raises
    ------
    ValueError
        If it is neither.

    Examples
    --------
    >>> moment("2016-05-01T12:00:00.5Z") == moment("1462104000500")
    True
    """
    try:
        number = float(text)
    except ValueError:
        stamp = datetime.fromisoformat(text.strip().replace("/", "-").replace(" UTC", "Z"))
        zoned = stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)
        return zoned.timestamp()
    return number * next((unit for least, unit in _UNITS if abs(number) > least), 1.0)


def second_of_day(text: str) -> float:
    """Seconds since midnight of a time of day.

    Parameters
    ----------
    text : str
        ``12:34:56.7`` or, as in NMEA, ``123456.7``.

    Returns
    -------
    seconds : float
        Seconds since midnight.

    Raises
    ------
    ValueError
        If it is no time of day.
    """
    digits = text.strip().replace(":", "")
    hour, minute, second = int(digits[:2]), int(digits[2:4]), float(digits[4:] or 0.0)
    if not (0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 61):
        raise ValueError(f"a time of day is wanted, got {text!r}")
    return 3600.0 * hour + 60.0 * minute + second


def midnight(day: date) -> float:
    """Seconds since 1970 of the midnight that begins a day.

    Parameters
    ----------
    day : date
        The day.

    Returns
    -------
    time : float
        Seconds since 1970 UTC.
    """
    return datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()


def unroll_days(seconds: FloatArray) -> FloatArray:
    """Times of day that go on after midnight.

    Parameters
    ----------
    seconds : ndarray, shape (K,)
        Seconds since midnight in the order recorded; NaN where unknown.

    Returns
    -------
    seconds : ndarray, shape (K,)
        Seconds since the first midnight: a step back by more than half a day begins another day.
    """
    known = np.isfinite(seconds)
    unrolled = seconds.copy()
    unrolled[known] = np.unwrap(seconds[known], period=_DAY)
    return unrolled


def nearest_day(seconds: float, near: float) -> float:
    """The midnight that brings a time of day closest to a known time.

    Parameters
    ----------
    seconds : float
        Seconds since midnight.
    near : float
        A time on or about that day [s since 1970 UTC].

    Returns
    -------
    midnight : float
        Seconds since 1970 UTC.
    """
    return float(np.round((near - seconds) / _DAY) * _DAY)
