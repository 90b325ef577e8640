"""Lines: the samples of many pings out of a file, and the lines of two sides brought together."""

import mmap

import numpy as np

from frontend.arrays import BoolArray, Float32Array, FloatArray, IntArray

# A ping this many times longer than the mean of all is damage, and would cost its length in every other row.
_MAX_LENGTH_RATIO = 8.0


def plausible_lengths(n_samples: IntArray) -> BoolArray:
    """Which pings are of a length that the others make believable.

    Parameters
    ----------
    n_samples : ndarray of int, shape (P,)
        Number of samples of each ping.

    Returns
    -------
    is_plausible : ndarray of bool, shape (P,)
        False for an empty ping and for one much longer than the mean, so that all pings side by side take no more
        memory than a small multiple of their file.
    """
    mean = float(n_samples.mean()) if n_samples.size else 0.0
    return np.asarray((n_samples > 0) & (n_samples <= _MAX_LENGTH_RATIO * mean))


def gather_lines(data: mmap.mmap, offsets: IntArray, n_samples: IntArray, dtype: str) -> Float32Array:
    """Read the samples of many pings.

    Parameters
    ----------
    data : mmap
        The file.
    offsets : ndarray of int, shape (P,)
        Where the samples of each ping start [bytes].
    n_samples : ndarray of int, shape (P,)
        Number of samples of each ping.
    dtype : str
        Type of a sample, with its byte order.

    Returns
    -------
    lines : ndarray of float32, shape (P, M)
        Samples in the order of the file; NaN beyond the last sample of a ping.
    """
    lines = np.full((len(offsets), int(n_samples.max(initial=0))), np.nan, dtype=np.float32)
    content = np.frombuffer(data, np.uint8)
    for n in np.unique(n_samples[n_samples > 0]).tolist():
        rows = np.flatnonzero(n_samples == n)
        windows = np.lib.stride_tricks.sliding_window_view(content, n * np.dtype(dtype).itemsize)
        lines[rows, :n] = windows[offsets[rows]].view(dtype)
    return lines


def fill_width(port: Float32Array, starboard: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Give two sides the same number of samples.

    Parameters
    ----------
    port, starboard : ndarray of float32, shapes (P, M) and (P, K)
        Samples.

    Returns
    -------
    port, starboard : ndarray of float32, shape (P, max(M, K))
        The same, with NaN behind the shorter.
    """
    width = max(port.shape[1], starboard.shape[1])
    filled = [np.pad(side, ((0, 0), (0, width - side.shape[1])), constant_values=np.nan) for side in (port, starboard)]
    return filled[0], filled[1]


def nearest_in_time(time: FloatArray, other: FloatArray, tolerance: float) -> tuple[IntArray, IntArray]:
    """Bring the rows of two series together by time.

    Parameters
    ----------
    time, other : ndarray, shapes (P,) and (K,)
        Times, in any order [s].
    tolerance : float
        How far apart a pair may be [s].

    Returns
    -------
    rows, other_rows : ndarray of int, shape (N,)
        Pairs in the order of the first series; each row is used once at most.
    """
    order = np.argsort(other, kind="stable")
    middles = (other[order][1:] + other[order][:-1]) / 2
    nearest = order[np.searchsorted(middles, time)] if other.size else np.zeros(len(time), dtype=np.int64)
    close = np.flatnonzero(np.abs(other[nearest] - time) <= tolerance) if other.size else np.zeros(0, dtype=np.int64)
    _, first = np.unique(nearest[close], return_index=True)
    rows = close[np.sort(first)]
    return rows, nearest[rows]
