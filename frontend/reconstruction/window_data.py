"""Windows made ready for inversion at one resolution: multilooked bins, beams in the submap frame, the raster."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numba
import numpy as np
from scipy.fft import next_fast_len

from frontend.arrays import FloatArray, IntArray
from frontend.bottom import Bottom
from frontend.frames import invert, level, transform
from frontend.geometry import transducer_positions
from frontend.radiometry import Radiometry
from frontend.reconstruction.forward import Beams, Bins, Raster
from frontend.reconstruction.specular import specular_end, specular_variance
from frontend.recording import Recording
from frontend.windows import Window

_SOUND_SPEED = 1500.0  # where none is recorded [m/s]
_MOST_CELLS = 2e7  # some 10 GB of work; a window of 100 m at 3 cm has half of it


@dataclass(frozen=True)
class WindowData:
    """Everything a method needs of a window, or of several that are to give one submap, in the submap frame.

    Parameters
    ----------
    T_world_submap, T_submap_body : ndarray, shape (4, 4)
        Level frame of the anchor; the anchor's roll and pitch.
    T_submap_pings : ndarray, shape (P, 4, 4)
        Bodies of the pings.
    sensors : ndarray, shape (P, 2, 3)
        Transducers, port and starboard [m].
    intensity : ndarray, shape (P, 2, M)
        Echo intensities.
    sample_spacing : ndarray, shape (P,)
        Slant range between samples [m].
    altitude : ndarray, shape (P,)
        Height above the seafloor [m].
    first_bottom_return : ndarray, shape (P, 2)
        Slant range of the first echo [m].
    advance, turn : ndarray, shape (P,)
        Distance run [1] and angle turned [rad/m] in half the time of a metre of slant range, there and back.
    n_pings : tuple of int
        Pings of each window; they add up to P.
    """

    T_world_submap: FloatArray
    T_submap_body: FloatArray
    T_submap_pings: FloatArray
    sensors: FloatArray
    intensity: FloatArray
    sample_spacing: FloatArray
    altitude: FloatArray
    first_bottom_return: FloatArray
    advance: FloatArray
    turn: FloatArray
    n_pings: tuple[int, ...]

    @property
    def slant_range_max(self) -> float:
        """Longest slant range of any ping [m]."""
        return float(self.sample_spacing.max() * self.intensity.shape[2])

    @cached_property
    def specular_end(self) -> FloatArray:
        """Shape (2,): slant range at which the specular echo of each side ends [m]; 0 where there is none."""
        return specular_end(self.intensity, self.sample_spacing, self.first_bottom_return)


@dataclass(frozen=True)
class BinModel:
    """What an echo is worth to the likelihood.

    Parameters
    ----------
    radiometry : Radiometry
        Says how many looks a sample has, and how loud it is where there is no seafloor.
    looks_most : float
        The most looks that a bin may count: the model is never better than that.
    blur : float
        Share of the mean echo added to both echo and model, so that dark bins and the edge of the water column do not
        claim more than a bin's width can tell.
    """

    radiometry: Radiometry
    looks_most: float
    blur: float

    def noise(self, slant_range: FloatArray) -> FloatArray:
        """Noise floor of each side.

        Parameters
        ----------
        slant_range : ndarray, shape (B,)
            Where [m].

        Returns
        -------
        noise : ndarray, shape (2, B)
            As intensity.
        """
        tables, floor = self.radiometry.tables, self.radiometry.noise_floor
        if floor is None:
            return np.repeat(tables.noise[:, None], len(slant_range), axis=1)
        knots = tables.range_step * np.arange(floor.shape[1])
        return np.stack([np.interp(slant_range, knots, side) for side in floor])


def window_data(recording: Recording, window: Window, bottom: Bottom, radiometry: Radiometry) -> WindowData:
    """Collect a window's pings in the frame of its submap.

    Parameters
    ----------
    recording : Recording
        The dive.
    window : Window
        Which pings.
    bottom : Bottom
        First bottom returns and altitude of the dive.
    radiometry : Radiometry
        Says what the echoes are.

    Returns
    -------
    data : WindowData
        Arrays of the window's pings.
    """
    pings = slice(window.first_ping, window.end_ping)
    poses = recording.trajectory_dr[pings].poses
    T_world_body = poses[window.anchor_ping - window.first_ping]
    T_world_submap = level(T_world_body)
    T_submap_world = invert(T_world_submap)
    echoes = np.stack([recording.port[pings], recording.starboard[pings]], axis=1)
    speed, turn_rate = _rates(poses, recording.ping_time[pings])
    sound_speed = recording.sound_speed[pings]
    sound_speed = np.where(np.isfinite(sound_speed), sound_speed, _SOUND_SPEED)
    return WindowData(
        T_world_submap,
        T_submap_world @ T_world_body,
        T_submap_world @ poses,
        transform(T_submap_world, transducer_positions(poses, recording.sonar)),
        _usable(radiometry.intensity(echoes), bottom, pings),
        recording.sample_spacing[pings],
        bottom.altitude[pings],
        bottom.first_bottom_return[pings],
        speed / sound_speed,
        turn_rate / sound_speed,
        (len(poses),),
    )


def join(windows: Sequence[WindowData]) -> WindowData:
    """Several windows as one, so that one surface explains what each of them saw.

    Parameters
    ----------
    windows : sequence of WindowData
        At least one; all with echoes of as many samples.

    Returns
    -------
    data : WindowData
        All pings, window after window, in the frame of the first.
    """
    if len(windows) == 1:
        return windows[0]
    frames = [invert(windows[0].T_world_submap) @ window.T_world_submap for window in windows]
    pings = [T @ window.T_submap_pings for T, window in zip(frames, windows, strict=True)]
    sensors = [transform(T, window.sensors) for T, window in zip(frames, windows, strict=True)]
    names = ("intensity", "sample_spacing", "altitude", "first_bottom_return", "advance", "turn")
    rest = {name: np.concatenate([getattr(window, name) for window in windows]) for name in names}
    n_pings = tuple(n for window in windows for n in window.n_pings)
    moved = {"T_submap_pings": np.concatenate(pings), "sensors": np.concatenate(sensors)}
    return replace(windows[0], n_pings=n_pings, **moved, **rest)


def _usable(intensity: FloatArray, bottom: Bottom, pings: slice) -> FloatArray:
    """Intensities without the silent tail that follows the last bottom return."""
    if bottom.last_usable_sample is None:
        return intensity
    heard = np.arange(intensity.shape[2]) <= bottom.last_usable_sample[pings][:, :, None]
    return np.where(heard, intensity, np.nan)


def _rates(poses: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speed over ground along the heading and turn rate to port, of each ping, over about half a second."""
    if len(poses) < 2:
        return np.zeros(len(poses)), np.zeros(len(poses))
    reach = max(1, round(0.25 / float(np.median(np.diff(time)))))
    low, high = np.maximum(np.arange(len(time)) - reach, 0), np.minimum(np.arange(len(time)) + reach, len(time) - 1)
    span = time[high] - time[low]
    heading = np.unwrap(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))
    step = ((poses[high, :2, 3] - poses[low, :2, 3]) * poses[:, :2, 0]).sum(axis=1)
    return step / span, (heading[high] - heading[low]) / span


def raster_of(data: WindowData, spacing: float) -> Raster:
    """The grid that holds every line of the window.

    Parameters
    ----------
    data : WindowData
        The window.
    spacing : float
        Distance between cells [m].

    Returns
    -------
    raster : Raster
        Its origin is a whole multiple of the spacing.

    Raises
    ------
    ValueError
        If the grid would not fit in any memory.
    """
    reach = data.slant_range_max
    side = data.T_submap_pings[:, :2, 1]
    side = side / np.linalg.norm(side, axis=1, keepdims=True)
    ground = np.sqrt(np.maximum(reach**2 - (0.5 * data.altitude) ** 2, 0.0))[:, None]
    ends = np.concatenate([data.sensors[:, 0, :2] + ground * side, data.sensors[:, 1, :2] - ground * side])
    margin = 2 * spacing
    low, high = ends.min(axis=0) - margin, ends.max(axis=0) + margin
    first = np.floor(low / spacing).astype(int)
    last = np.ceil(high / spacing).astype(int)
    n_cells = float(np.prod(last - first + 1.0))
    if n_cells > _MOST_CELLS:
        raise ValueError(
            f"a window of {n_cells:.0e} cells of {spacing} m given, at most {_MOST_CELLS:.0e} wanted: "
            "larger cells or shorter windows"
        )
    n_x, n_y = (next_fast_len(int(n), real=True) for n in last - first + 1)  # for the cosine transforms
    return Raster(n_y, n_x, spacing, (float(first[0] * spacing), float(first[1] * spacing)))


def beams_and_bins(data: WindowData, width: float, group: int, model: BinModel) -> tuple[Beams, Bins]:
    """Average pings and samples to the resolution of a level.

    Parameters
    ----------
    data : WindowData
        The window.
    width : float
        Width of a slant-range bin [m].
    group : int
        Pings averaged to one line.
    model : BinModel
        What an echo is worth.

    Returns
    -------
    beams, bins : Beams, Bins
        Lines at the mean pose of their pings.
    """
    first = _first_pings(data.n_pings, group)
    n_bins = int(np.ceil(data.slant_range_max / width))
    sums, counts = np.zeros((len(first), 2, n_bins)), np.zeros((len(first), 2, n_bins))
    blanking = 0.6 * data.first_bottom_return
    _multilook(data.intensity, data.sample_spacing, blanking, first, group, width, sums, counts)
    mean = np.divide(sums, counts, out=np.ones_like(sums), where=counts > 0)
    blur = model.blur * _level_beyond(mean, counts)
    variance = 1.0 / np.maximum(counts * model.radiometry.looks, 1e-9) + 1.0 / model.looks_most
    variance += specular_variance(_profile(mean + blur, counts), data.specular_end / width)
    effective = np.where(counts > 0, 1.0 / variance, 0.0)
    noise = model.noise(width * np.arange(0.5, n_bins))
    return _lines(data, first[:, None] + np.arange(group)), Bins(mean + blur, effective, noise + blur, width)


def _first_pings(n_pings: Sequence[int], group: int) -> IntArray:
    """The first ping of every line: no line averages pings of two windows."""
    ends = np.cumsum(n_pings)
    return np.concatenate([end - n + group * np.arange(n // group) for n, end in zip(n_pings, ends, strict=True)])


def _lines(data: WindowData, pings: IntArray) -> Beams:
    """Mean sensors, axes and motion of groups of pings, one a row: an even group has no middle ping."""
    poses, sensors, advance, turn = (
        a[pings].mean(axis=1) for a in (data.T_submap_pings, data.sensors, data.advance, data.turn)
    )
    axes = poses[:, :3, :3] / np.linalg.norm(poses[:, :3, :3], axis=1, keepdims=True)
    side = np.stack([axes[:, :, 1], -axes[:, :, 1]], axis=1)
    return Beams(sensors, axes[:, :, 0], side, axes[:, :, 2], advance, turn)


def _level_beyond(mean: FloatArray, counts: FloatArray) -> FloatArray:
    """Shape (2, B): the largest mean echo at each range or farther."""
    return np.asarray(np.maximum.accumulate(_profile(mean, counts)[:, ::-1], axis=1)[:, ::-1])


def _profile(mean: FloatArray, counts: FloatArray) -> FloatArray:
    """Shape (2, B): the mean echo of all lines."""
    return np.asarray((mean * counts).sum(axis=0) / np.maximum(counts.sum(axis=0), 1e-9))


@numba.njit(cache=True, nogil=True)
def _multilook(intensity, spacing, blanking, first, group, width, sums, counts):  # type: ignore[no-untyped-def]
    """Share samples between the two nearest slant-range bins, as the forward model does; leave ringing out."""
    for line in range(sums.shape[0]):
        for ping in range(first[line], first[line] + group):
            for side in range(2):
                for k in range(intensity.shape[2]):
                    r = (k + 0.5) * spacing[ping]
                    value = intensity[ping, side, k]
                    if not (r > blanking[ping, side] and np.isfinite(value)):
                        continue
                    b = int(np.floor(r / width - 0.5))
                    far = r / width - 0.5 - b
                    if b >= 0:
                        sums[line, side, b] += (1 - far) * value
                        counts[line, side, b] += 1 - far
                    if b + 1 < sums.shape[2]:
                        sums[line, side, b + 1] += far * value
                        counts[line, side, b + 1] += far
