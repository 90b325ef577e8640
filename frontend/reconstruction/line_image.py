"""Echoes of registered lines in cells of equal ground range, against those of a flat floor."""

from dataclasses import dataclass

import numpy as np

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.geometry import PORT, STARBOARD, first_ray_angle, first_usable_return
from frontend.radiometry import Radiometry
from frontend.reconstruction.lines import LineFrames
from frontend.reconstruction.window_data import WindowData
from frontend.recording import SonarGeometry

NORMAL_INCIDENCE = 0.05  # sine of incidence below which samples cover no more ground: a cell is wider than they


@dataclass(frozen=True)
class LineImage:
    """What the lines saw, against what a flat floor would return; shape (L, C) all.

    Parameters
    ----------
    amplitude : ndarray
        Measured over expected amplitude [1].
    weight : ndarray
        Inverse variance of the amplitude; 0 where a cell says nothing.
    is_shadow : ndarray of bool
        Cells mostly in shadow.
    angle : ndarray
        Angle from the body's nadir, outwards [rad].
    scale : ndarray
        Amplitude of a level patch in the cell but for beam and range, which ``amplitude`` was divided by.
    """

    amplitude: FloatArray
    weight: FloatArray
    is_shadow: BoolArray
    angle: FloatArray
    scale: FloatArray


@dataclass(frozen=True)
class EchoModel:
    """How echoes become a line image.

    Parameters
    ----------
    radiometry : Radiometry
        Of the dive.
    inner_angle : float
        Inner edge of the beams off the body's nadir [rad].
    looks_most : float
        The most looks that a cell may count: the model is never better than that.
    brightest : float
        Amplitude over that of a flat floor beyond which an echo is cut.
    """

    radiometry: Radiometry
    inner_angle: float
    looks_most: float
    brightest: float


def inner_angle(sonar: SonarGeometry, main_lobe: float) -> float:
    """Inner edge of the beams' main lobe.

    Parameters
    ----------
    sonar : SonarGeometry
        Mounting and beamwidth.
    main_lobe : float
        From the axis to the edge, over the -3 dB width.

    Returns
    -------
    angle : float
        Off the body's nadir [rad]; 0 where the sonar is unknown or sees nadir.
    """
    angle = np.pi / 2 - sonar.mounting_depression - main_lobe * sonar.vertical_beamwidth
    return float(max(angle, 0.0)) if np.isfinite(angle) else 0.0


def see_lines(
    data: WindowData, is_shadow: BoolArray, frames: LineFrames, relief: FloatArray, model: EchoModel
) -> LineImage:
    """Ground-range correct the echoes of a window onto a relief.

    Parameters
    ----------
    data : WindowData
        The window.
    is_shadow : ndarray of bool, shape (P, 2, M)
        Shadow labels of its samples.
    frames : LineFrames
        The lines.
    relief : ndarray, shape (L, C)
        Relief above the flat floor of each line [m]. Where it is 0 the slant range of a cell is equation 3 of the
        paper, each side with its own first return.
    model : EchoModel
        Radiometry and what is left out.

    Returns
    -------
    image : LineImage
        Amplitudes, weights and shadow of the cells. Cells nearer to nadir than the first usable ray, before the first
        bottom return or beyond the recording have no weight.
    """
    horizontal, vertical = frames.horizontal, frames.vertical - relief
    slant_range = np.hypot(horizontal, vertical)
    energy, count, dark = _sums(data, is_shadow, frames, relief, model.radiometry.tables.noise)
    expected = _expected(frames, relief, model)
    looks = count * model.radiometry.looks
    mean = np.sqrt(np.maximum(energy, 0.0) / np.maximum(count, 1e-9) / expected)
    mean = mean / np.maximum(1 - 0.125 / np.maximum(looks, 0.25), 0.5)  # mean of the root of a gamma variate
    usable = (count > 0) & _is_single(data, frames, slant_range, model)
    noise = model.radiometry.tables.noise[frames.side]
    weight = 4 / (1 / np.maximum(looks, 1e-9) + 1 / model.looks_most) * (expected / (expected + noise)) ** 2
    return LineImage(
        np.where(usable, np.minimum(mean, model.brightest), 1.0),
        np.where(usable, weight, 0.0),
        usable & (dark > 0.5 * count),
        _angle(frames, horizontal, vertical),
        np.sqrt(_level_patch(frames, horizontal, vertical, model.radiometry.tables.exponent)),
    )


def _sums(
    data: WindowData, is_shadow: BoolArray, frames: LineFrames, relief: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Shapes (L, C): energy above the noise, samples, and samples in shadow that fall into each cell."""
    heard = np.isfinite(data.intensity)
    excess = np.where(heard, data.intensity - noise[None, :, None], 0.0)
    cumulative = [_cumulated(values) for values in (excess, heard, is_shadow & heard)]
    mean_distance = data.altitude / np.maximum(data.T_submap_pings[:, 2, 2], 0.1)
    sums = np.zeros((3, *frames.shape))
    edges = np.concatenate([relief[:, :1], 0.5 * (relief[:, 1:] + relief[:, :-1]), relief[:, -1:]], axis=1)
    for pings in frames.pings.T:
        change = mean_distance[pings] - mean_distance[frames.pings].mean(axis=1)  # heave within the line
        first, last = _samples(data.sample_spacing[pings], frames, edges, change)
        for side in (PORT, STARBOARD):
            columns = frames.side == side
            for total, sum_to in zip(sums, cumulative, strict=True):
                total[:, columns] += _between(sum_to[pings, side], first[:, columns], last[:, columns])
    return sums[0], sums[1], sums[2]


def _cumulated(values: FloatArray | BoolArray) -> FloatArray:
    return np.pad(np.cumsum(values, axis=-1, dtype=np.float64), ((0, 0), (0, 0), (1, 0)))


def _samples(
    sample_spacing: FloatArray, frames: LineFrames, edges: FloatArray, change: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Shapes (L, C): first and last sample, in fractions, between the edges of each cell; one sample at least."""
    half, below = 0.5 * frames.spacing, frames.vertical + change[:, None]
    ends = [
        np.hypot(frames.horizontal + sign * half, below - relief) / sample_spacing[:, None]
        for sign, relief in ((-1.0, edges[:, :-1]), (1.0, edges[:, 1:]))
    ]
    first, last = np.minimum(*ends), np.maximum(*ends)
    lack = np.maximum(1.0 - (last - first), 0.0)
    return first - 0.5 * lack, last + 0.5 * lack


def _between(sum_to: FloatArray, first: FloatArray, last: FloatArray) -> FloatArray:
    """Sum of a piecewise constant function over intervals, from its sums up to each sample."""
    n = sum_to.shape[1] - 1
    found = []
    for end in (first, last):
        at = np.clip(end, 0, n)
        whole = np.minimum(at.astype(np.int64), n - 1)
        low, high = (np.take_along_axis(sum_to, whole + k, axis=1) for k in (0, 1))
        found.append(low + (at - whole) * (high - low))
    return np.asarray(found[1] - found[0])


def _expected(frames: LineFrames, relief: FloatArray, model: EchoModel) -> FloatArray:
    """Shape (L, C): intensity of level ground at the height of each cell, the mean over the samples in it."""
    down, exponent = frames.vertical - relief, model.radiometry.tables.exponent
    top, base = np.zeros(frames.shape), np.zeros(frames.shape)
    for share in np.linspace(-0.4, 0.4, 5):
        out = frames.horizontal + share * frames.spacing
        slant_range = np.hypot(out, down)
        density = np.abs(out) / slant_range  # samples a metre of ground
        beam = _beam_and_range(slant_range, _angle(frames, out, down), frames.side, model)
        top += density * beam * _level_patch(frames, out, down, exponent)
        base += density
    return np.asarray(top / base)


def _angle(frames: LineFrames, horizontal: FloatArray, down: FloatArray) -> FloatArray:
    """Shape (L, C): angle off the body's nadir, outwards."""
    outwards = np.where(frames.side == PORT, 1.0, -1.0)
    return np.asarray(outwards * (np.arctan2(horizontal, down) - frames.roll[:, None]))


def _level_patch(frames: LineFrames, horizontal: FloatArray, down: FloatArray, exponent: float) -> FloatArray:
    """Lambert's law on level ground, times the ground that a sample covers."""
    slant_range = np.hypot(horizontal, down)
    cosine = np.clip(down * frames.up[:, 2:] / slant_range, 0.02, 1.0)
    return np.asarray(cosine**exponent / np.hypot(horizontal / slant_range, NORMAL_INCIDENCE))


def _beam_and_range(slant_range: FloatArray, angle: FloatArray, side: IntArray, model: EchoModel) -> FloatArray:
    """Shape (L, C): intensity but for what the seafloor does."""
    tables = model.radiometry.tables
    knots = tables.angle_first + tables.angle_step * np.arange(tables.log_beam.shape[1])
    beams = [np.interp(angle, knots, log_beam) for log_beam in tables.log_beam]
    law = np.interp(slant_range, tables.range_step * np.arange(tables.log_range.size), tables.log_range)
    return np.asarray(np.exp(np.where(side == PORT, beams[PORT], beams[STARBOARD]) + law))


def _is_single(data: WindowData, frames: LineFrames, slant_range: FloatArray, model: EchoModel) -> BoolArray:
    """Cells beyond layover and water column and within the recording."""
    angle = first_ray_angle(frames.roll, model.inner_angle)[:, frames.side]
    outside = np.abs(frames.horizontal) >= frames.vertical * np.tan(angle)
    altitude = frames.distance * np.cos(frames.pitch)
    b = first_usable_return(altitude, (frames.roll, frames.pitch), model.inner_angle)
    heard_from = np.minimum(data.first_bottom_return[frames.pings].mean(axis=1), 1.2 * b)  # a fish is no bottom
    end = (data.sample_spacing[frames.pings].min(axis=1) * data.intensity.shape[2])[:, None]
    return np.asarray(outside & (slant_range > heard_from[:, frames.side]) & (slant_range < end - 0.5 * frames.spacing))
