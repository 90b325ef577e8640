"""XTF samples: reading them, and which end of a line comes first."""

import mmap
from typing import Any

import numpy as np
import pyxtf

from frontend.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from sssslam.readers.xtf_blocks import Blocks
from sssslam.readers.xtf_channels import Channel, Pair

_IBM_FLOAT, _IEEE_FLOAT = pyxtf.XTFSampleFormat.ibm_float.value, pyxtf.XTFSampleFormat.float.value
_GROUND_RANGE = pyxtf.XTFCorrectionFlags.ground_range.value
_SAMPLE_TYPES = {1: "u1", 2: "<u2", 4: "<u4"}
# Block floating point of a sonar: beyond 2^-24 a 16-bit sample says nothing, so such a weight is damage.
_MAX_WEIGHT = 24
# The end of a line is decided only where the echoes clearly say so: a logarithm of a ratio, two correlations.
_MIN_CONTRAST, _MIN_LIKENESS, _MIN_LEAD = 0.4, 0.5, 0.3
_N_SAMPLED_PINGS = 200


def check_samples(pair: Pair) -> None:
    """Refuse channels whose samples cannot be understood.

    Parameters
    ----------
    pair : Pair
        The channels.

    Raises
    ------
    ValueError
        If they are ground-range corrected or in IBM floating point.
    """
    for channel in pair.channels:
        if channel.info["CorrectionFlags"] == _GROUND_RANGE:
            raise ValueError(f"channel {channel} is corrected to ground range; slant range is wanted")
        if channel.info["SampleFormat"] == _IBM_FLOAT and channel.info["BytesPerSample"] == 4:
            raise ValueError(
                f"channel {channel} holds IBM floating point; 8, 16 or 32-bit integers or IEEE floats are wanted"
            )


def sample_type(info: AnyArray) -> np.dtype[Any]:
    """The numpy type of the samples of a channel.

    Parameters
    ----------
    info : ndarray of CHANNEL, shape ()
        Its row of the channel table.

    Returns
    -------
    dtype : dtype
        Unsigned integers of 1, 2 or 4 bytes, or 4-byte floats; little endian.
    """
    is_float = info["SampleFormat"] == _IEEE_FLOAT and info["BytesPerSample"] == 4
    return np.dtype("<f4" if is_float else _SAMPLE_TYPES[int(info["BytesPerSample"])])


def read_samples(
    data: mmap.mmap, channel: Channel, blocks: Blocks, rows: IntArray, shape: tuple[int, int]
) -> Float32Array:
    """Read the samples of a channel in the order of the file.

    Parameters
    ----------
    data : mmap
        The file.
    channel : Channel
        The channel.
    blocks : Blocks
        Its blocks.
    rows : ndarray of int, shape (B,)
        The row of the result that each block fills.
    shape : tuple of int
        Pings and samples of the result.

    Returns
    -------
    samples : ndarray of float32, shape `shape`
        The samples times ``2 ** -Weight``; NaN beyond the last sample of a ping and in rows without a block.
    """
    samples = np.full(shape, np.nan, dtype=np.float32)
    dtype = sample_type(channel.info)
    for row, n, offset in zip(rows.tolist(), blocks.n_samples.tolist(), blocks.offset.tolist(), strict=True):
        samples[row, :n] = np.frombuffer(data, dtype, n, offset)
    weight = blocks.header["Weight"].astype(np.int32)
    if np.any(weight) and np.all(np.abs(weight) <= _MAX_WEIGHT):
        samples[rows] = np.ldexp(samples[rows], -weight[:, None])
    if dtype.kind == "f":
        samples[~np.isfinite(samples)] = np.nan
    return samples


def gain_notes(pair: Pair, blocks: Blocks) -> list[str]:
    """Say where the receiver's gain was changed: its codes are the maker's own and cannot be undone.

    Parameters
    ----------
    pair : Pair
        The channels.
    blocks : Blocks
        The channel blocks of all pings.

    Returns
    -------
    notes : list of str
        One for each channel whose gain changes.
    """
    notes = []
    for channel in pair.channels:
        header = blocks.header[blocks.channel == channel.index]
        codes = np.stack([header[name].astype(np.int64) for name in ("InitialGainCode", "GainCode")])
        n = int(np.any(np.diff(codes) != 0, axis=0).sum())
        if n:
            low, high = codes[1].min(), codes[1].max()
            notes.append(
                f"the gain of {channel.side} changes {n} times (codes {low} to {high}): its brightness jumps there"
            )
    return notes


def reverse_lines(samples: Float32Array, n_samples: IntArray) -> Float32Array:
    """Turn each line round, its unused end staying at the end.

    Parameters
    ----------
    samples : ndarray of float32, shape (N, M)
        Lines of samples.
    n_samples : ndarray of int, shape (N,)
        Number of samples of each line.

    Returns
    -------
    reversed : ndarray of float32, shape (N, M)
        The same lines, last sample first.
    """
    reversed_samples = np.ascontiguousarray(samples[:, ::-1])
    for n in np.unique(n_samples):
        if n != samples.shape[1]:
            rows = np.flatnonzero(n_samples == n)
            reversed_samples[rows] = np.roll(reversed_samples[rows], n - samples.shape[1], axis=1)
    return reversed_samples


def far_end_first(
    samples: Float32Array, n_samples: IntArray, altitude: FloatArray, spacing: FloatArray, other: Float32Array | None
) -> bool | None:
    """Judge from the echoes whether lines start at the far end.

    Parameters
    ----------
    samples : ndarray of float32, shape (N, M)
        Lines in the order of the file.
    n_samples : ndarray of int, shape (N,)
        Number of samples of each line.
    altitude : ndarray, shape (N,)
        Height above the seafloor [m]; NaN where unknown.
    spacing : ndarray, shape (N,)
        Slant range between samples [m].
    other : ndarray of float32, shape (N, K), or None
        The lines of the other side, near end first.

    Returns
    -------
    far_end_first : bool or None
        None where the echoes do not say.

    Notes
    -----
    Two witnesses, the stronger first. The water column is darker than the seafloor just behind the first bottom return,
    whose range the altitude gives. Without altitude, the median line resembles that of the other side.
    """
    rows = np.linspace(0, len(samples) - 1, min(len(samples), _N_SAMPLED_PINGS)).astype(np.int64)
    lines, n = samples[rows], n_samples[rows]
    turned = reverse_lines(lines, n)
    first_bottom = altitude[rows] / spacing[rows]
    contrast = _bottom_contrast(turned, first_bottom) - _bottom_contrast(lines, first_bottom)
    if abs(contrast) > _MIN_CONTRAST:
        return bool(contrast > 0)
    if other is None:
        return None
    likeness = [_likeness(side, other[rows]) for side in (lines, turned)]
    is_clear = max(likeness) > _MIN_LIKENESS and abs(likeness[1] - likeness[0]) > _MIN_LEAD
    return likeness[1] > likeness[0] if is_clear else None


def _bottom_contrast(lines: Float32Array, first_bottom: FloatArray) -> float:
    """Median log ratio of the seafloor behind the first bottom return to the water column before it; NaN if unknown."""
    sample = np.arange(lines.shape[1]) / first_bottom[:, None]
    known = np.isfinite(lines)
    water, floor = (known & (sample > low) & (sample < high) for low, high in ((0.3, 0.8), (1.2, 1.8)))
    usable = (water.sum(axis=1) >= 3) & (floor.sum(axis=1) >= 3)
    if not usable.any():
        return float("nan")
    dim = 1e-3 * float(np.mean(np.abs(lines[known]))) + np.finfo(np.float32).tiny
    ratio = [_mean(lines[usable], part[usable]) + dim for part in (floor, water)]
    return float(np.median(np.log(ratio[0] / ratio[1])))


def _mean(lines: Float32Array, part: BoolArray) -> FloatArray:
    """Mean magnitude of a part of each line."""
    return np.asarray(np.where(part, np.abs(lines), 0.0).sum(axis=1, dtype=np.float64) / part.sum(axis=1))


def _likeness(lines: Float32Array, others: Float32Array) -> float:
    """Correlation of two median lines as far as both go; -1 where one is flat."""
    width = min(lines.shape[1], others.shape[1])
    lines, others = lines[:, :width], others[:, :width]
    columns = np.isfinite(lines).any(axis=0) & np.isfinite(others).any(axis=0)
    a, b = (np.nanmedian(np.abs(side[:, columns]), axis=0) for side in (lines, others))
    if columns.sum() < 3 or np.ptp(a) == 0 or np.ptp(b) == 0:
        return -1.0
    a, b = (np.log(side + 1e-3 * side.mean()) for side in (a, b))
    return float(np.corrcoef(a, b)[0, 1])
