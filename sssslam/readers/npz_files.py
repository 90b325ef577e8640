"""NumPy archives (`.npz`): recordings as named arrays.

``port`` and ``starboard`` have the shape (pings, samples), near end first; one may be missing. The other names are
those of `sssslam.readers.named_values`; an array of one value serves all pings.
"""

import mmap
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from frontend.arrays import AnyArray, Float32Array, FloatArray
from frontend.recording import Recording
from sssslam.readers.dives import Pings, read_dives
from sssslam.readers.layout import as_float64
from sssslam.readers.named_values import ARMS, NUMBERS, ORIGIN, QUANTITY, SERIES, as_samples, make_pings

# A file that says it unpacks to more than so many times its size, and more than this, is a bomb [bytes].
_MAX_RATIO, _SMALL = 200, 1 << 24
# What zipfile, zlib and numpy raise over damage, beside ValueError.
_DAMAGE = (
    *(OSError, EOFError, KeyError, IndexError, TypeError, OverflowError, MemoryError, NotImplementedError),
    *(RuntimeError, SyntaxError, UnicodeError, struct.error, tokenize.TokenError, zipfile.BadZipFile, zlib.error),
)
_SIDES = ("port", "starboard")


def read_npz_files(paths: Sequence[Path]) -> list[Recording]:
    """Read NumPy archives.

    Parameters
    ----------
    paths : sequence of Path
        The files.

    Returns
    -------
    recordings : list of Recording
        One a file, in the order of time.

    Raises
    ------
    ValueError
        If a file gives no recording.
    """
    return read_dives(paths, _read_pings)


def _read_pings(path: Path, data: mmap.mmap) -> Pings:
    arrays = _load(path, len(data))
    port, starboard = _sides(arrays)
    n_pings = len(port)
    series = {name: _series(arrays[name], name, n_pings) for name in SERIES if name in arrays}
    numbers = {name: _numbers(arrays[name], name) for name in (*NUMBERS, *ARMS, *ORIGIN) if name in arrays}
    quantity = str(arrays[QUANTITY]) if QUANTITY in arrays else "unknown"
    return make_pings((port, starboard), series, numbers, quantity)


def _load(path: Path, size: int) -> dict[str, AnyArray]:
    """The arrays that have a known name; nothing is unpickled."""
    names = {*_SIDES, *SERIES, *NUMBERS, *ARMS, *ORIGIN, QUANTITY}
    try:
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > max(_MAX_RATIO * size, _SMALL):
            raise ValueError(f"the archive says it unpacks to {unpacked:.3g} bytes from {size}; less is wanted")
        with np.load(path, allow_pickle=False) as arrays:
            found = {name: arrays[name] for name in arrays.files if name in names}
    except _DAMAGE as error:
        raise ValueError(f"the archive is damaged ({' '.join(str(error).split())})") from None
    # An entry without the signature of an array comes as its bytes.
    for name, array in found.items():
        if not isinstance(array, np.ndarray):
            raise ValueError(f"{name} is no array but {len(array)} bytes; an array is wanted")
    return found


def _sides(arrays: dict[str, AnyArray]) -> tuple[Float32Array, Float32Array]:
    """Port and starboard; one that is missing is unknown throughout."""
    given = [_numbers(arrays[name], name) for name in _SIDES if name in arrays]
    if not given:
        raise ValueError("port and starboard are missing; at least one, of shape (pings, samples), is wanted")
    if any(side.ndim != 2 for side in given) or len({side.shape for side in given}) > 1 or not given[0].size:
        shapes = " and ".join(str(side.shape) for side in given)
        raise ValueError(f"port and starboard have the shapes {shapes}; one shape (pings, samples) is wanted")
    unknown = np.full(given[0].shape, np.nan, dtype=np.float32)
    port, starboard = (as_samples(arrays[name]) if name in arrays else unknown for name in _SIDES)
    return port, starboard


def _numbers(array: AnyArray, name: str) -> FloatArray:
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{name} is of type {array.dtype}; numbers are wanted")
    return as_float64(array)


def _series(array: AnyArray, name: str, n_pings: int) -> FloatArray:
    """One value a ping; a single one is repeated."""
    values = _numbers(array, name)
    if values.size == 1:
        return np.full(n_pings, values.ravel()[0])
    if values.shape != (n_pings,):
        raise ValueError(f"{name} has the shape {values.shape}; ({n_pings},), one value a ping, is wanted")
    return values
