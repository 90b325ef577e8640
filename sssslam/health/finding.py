"""What an examination gives: rows to print, and findings with advice."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from frontend.arrays import FloatArray
from frontend.recording import Recording

# Pings looked at: enough for a percentile, few enough for an answer at once.
_N_SAMPLED_PINGS = 300


@dataclass(frozen=True)
class Finding:
    """Something suspicious.

    Parameters
    ----------
    what : str
        What was seen, with figures.
    advice : str
        What it may mean, and what to do.
    """

    what: str
    advice: str


@dataclass(frozen=True)
class Health:
    """What a recording holds.

    Parameters
    ----------
    rows : tuple of (str, str)
        What and its value, units included, in the order to print.
    findings : tuple of Finding
        What looks wrong; empty for a recording without fault.
    """

    rows: tuple[tuple[str, str], ...]
    findings: tuple[Finding, ...]


Lines = Iterator[tuple[str, str] | Finding]


def span(values: FloatArray, unit: str) -> str:
    """Least and greatest value, or one where they print alike.

    Parameters
    ----------
    values : ndarray
        At least one known value.
    unit : str
        Their unit.

    Returns
    -------
    text : str
        Four digits each.
    """
    low, high = (f"{value:.4g}" for value in (np.nanmin(values), np.nanmax(values)))
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def thinned(recording: Recording) -> Recording:
    """Some pings of a recording, evenly spread.

    Parameters
    ----------
    recording : Recording
        Any number of pings.

    Returns
    -------
    recording : Recording
        At most some hundreds of them.
    """
    return recording[:: -(-recording.n_pings // _N_SAMPLED_PINGS)]
