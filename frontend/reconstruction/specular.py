"""Specular echo: a mirror-like floor straight below, which no table over angles tells."""

from itertools import pairwise

import numpy as np

from frontend.arrays import FloatArray

_NEAR = 1.25  # times the first bottom return: within 37 degrees of the nadir
_STEP = 0.04  # of the first bottom return: strips whose mean echoes are compared
_FALL = 1.0  # natural logarithm of the mean echo from strip to strip or bin to bin; Lambert's law gives a tenth


def specular_end(intensity: FloatArray, sample_spacing: FloatArray, first_bottom_return: FloatArray) -> FloatArray:
    """Where the specular echo of a window ends.

    Parameters
    ----------
    intensity : ndarray, shape (P, 2, S)
        Echoes of its pings, port and starboard; NaN where nothing is known.
    sample_spacing : ndarray, shape (P,)
        Slant range between samples [m].
    first_bottom_return : ndarray, shape (P, 2)
        Slant range of the first bottom return [m].

    Returns
    -------
    end : ndarray, shape (2,)
        Slant range [m] of the last place near the nadir beyond which the mean echo falls by more than a factor e within
        a twenty-fifth of the first bottom return; 0 on a side that hears no specular echo.
    """
    edges = float(np.median(first_bottom_return)) * np.arange(1 - 2 * _STEP, _NEAR, _STEP)
    samples = (edges / float(np.median(sample_spacing))).astype(int)
    near = intensity[:, :, : int(samples[-1]) + 1]
    known = np.isfinite(near)
    sums, counts = np.where(known, near, 0.0).sum(axis=0), known.sum(axis=0)
    strips = [slice(first, max(end, first + 1)) for first, end in pairwise(samples)]
    level = np.array([sums[:, k].sum(axis=1) / np.maximum(counts[:, k].sum(axis=1), 1) for k in strips])
    falls = (level[1:] > 0) & (level[1:] < np.exp(-_FALL) * level[:-1])
    return np.array([edges[np.flatnonzero(side)[-1] + 2] if side.any() else 0.0 for side in falls.T])


def specular_variance(level: FloatArray, end: FloatArray) -> FloatArray:
    """How wrong the model may be on the flanks of a specular echo, where a degree of slope changes decibels.

    Parameters
    ----------
    level : ndarray, shape (2, B)
        Mean echo of all lines in each slant-range bin, positive.
    end : ndarray, shape (2,)
        Where the specular echo ends [bins].

    Returns
    -------
    variance : ndarray, shape (2, B)
        Of the logarithm of the echo: the square of what the larger step to a neighbouring bin has beyond 1; 0 farther
        out, and where there is no specular echo.
    """
    beyond = np.maximum(np.abs(np.diff(np.log(np.maximum(level, 1e-30)), axis=1)) - _FALL, 0.0)
    padded = np.pad(beyond, [(0, 0), (1, 1)])
    flank = np.maximum(padded[:, 1:], padded[:, :-1])
    return np.where(np.arange(level.shape[1]) < end[:, None], flank**2, 0.0)
