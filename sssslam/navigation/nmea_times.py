"""Times of NMEA sentences, many of which hold none: from their burst, or from their place in the log."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from frontend.arrays import FloatArray

# A log repeats a burst when more than this share of its times is followed by the same sentences.
_SAME_BURSTS = 0.8


def come_in_bursts(kinds: Sequence[str], seconds: FloatArray) -> bool:
    """Whether the same sentences follow each new time in the same order, as a receiver writes them once a fix.

    Parameters
    ----------
    kinds : sequence of str
        The sentences of a log.
    seconds : ndarray, shape (K,)
        The time each of them holds [s]; NaN for none.

    Returns
    -------
    come_in_bursts : bool
        True if most times have the same sentences, once each; never for fewer than three times.
    """
    bursts: list[list[str]] = []
    second = np.nan
    for kind, own in zip(kinds, seconds.tolist(), strict=True):
        if np.isfinite(own) and own != second:
            second = own
            bursts.append([])
        if bursts:
            bursts[-1].append(kind)
    # The last one may be cut off.
    whole = Counter(map(tuple, bursts[:-1]))
    if whole.total() < 2:
        return False
    ((burst, n),) = whole.most_common(1)
    return n > _SAME_BURSTS * whole.total() and len(set(burst)) == len(burst)


def times_of_bursts(seconds: FloatArray) -> FloatArray:
    """Each sentence at the time of its burst.

    Parameters
    ----------
    seconds : ndarray, shape (K,)
        The time each of them holds [s]; NaN for none, known for one at least.

    Returns
    -------
    seconds : ndarray, shape (K,)
        Of a sentence without time, that of the last one before it; of the next one behind it where the log starts with
        a sentence without time, which then opens each burst [s].
    """
    timed = np.flatnonzero(np.isfinite(seconds))
    last = np.searchsorted(timed, np.arange(len(seconds)), side="right") - 1
    is_own = np.isfinite(seconds)
    row = last if timed[0] == 0 else np.where(is_own, last, last + 1)
    return np.asarray(seconds[timed[np.clip(row, 0, len(timed) - 1)]])


def times_of_places(seconds: FloatArray, place: FloatArray) -> FloatArray:
    """Each sentence at the time that its place in the log has.

    Parameters
    ----------
    seconds : ndarray, shape (K,)
        The time each of them holds [s]; NaN for none, known for one at least.
    place : ndarray, shape (K,)
        Numbers of their lines.

    Returns
    -------
    seconds : ndarray, shape (K,)
        Between the times of the sentences around it; at the ends, of the outermost [s].
    """
    timed = np.flatnonzero(np.isfinite(seconds))
    return np.interp(place, place[timed], seconds[timed])
