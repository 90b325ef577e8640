"""Layout: structures as format descriptions print them, by byte offsets, and reading many of them at once."""

import mmap

import numpy as np

from frontend.arrays import AnyArray, FloatArray, IntArray
from sssslam.readers import xtf_packets


def layout(size: int, fields: dict[str, tuple[int, str]]) -> np.dtype[np.void]:
    """Make the dtype of a structure of which only some fields matter.

    Parameters
    ----------
    size : int
        Size of the structure [bytes].
    fields : dict of str to (int, str)
        Of each field, its offset [bytes] and its type with byte order.

    Returns
    -------
    dtype : dtype
        The structure.
    """
    offsets, formats = [offset for offset, _ in fields.values()], [kind for _, kind in fields.values()]
    return np.dtype({"names": list(fields), "formats": formats, "offsets": offsets, "itemsize": size})  # type: ignore[call-overload]


def gather(data: mmap.mmap, offsets: IntArray, dtype: np.dtype[np.void]) -> AnyArray:
    """Read one structure at each of many places.

    Parameters
    ----------
    data : mmap
        The file.
    offsets : ndarray of int, shape (K,)
        Where whole structures start [bytes]; none at all in a file that is shorter than one.
    dtype : dtype
        Their layout.

    Returns
    -------
    structures : ndarray of dtype, shape (K,)
        A copy of them.
    """
    return xtf_packets.gather(data, offsets, dtype) if len(offsets) else np.zeros(0, dtype)


def as_float64(numbers: AnyArray) -> FloatArray:
    """Numbers of a file in double precision, whatever not-a-number damage has made of some of them.

    Parameters
    ----------
    numbers : ndarray
        Numbers of any type.

    Returns
    -------
    numbers : ndarray of float64
        The same.
    """
    with np.errstate(invalid="ignore"):
        return numbers.astype(np.float64)
