"""Ground-range images of a window: lines corrected over a flat floor and stacked as if the track were straight."""

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import BoolArray, FloatArray
from frontend.radiometry import Radiometry
from frontend.reconstruction.window_data import WindowData
from frontend.recording import Quantity
from frontend.shadows import ShadowConfig, expected_echo, label_shadows

_MOST_PIXELS = 2e7  # some gigabytes of work


class ImageConfig(BaseModel):
    """How lines become images."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    n_levels: int = Field(
        default=4, ge=1, le=8, description="Images of the pyramid [1], each twice as fine as the one before."
    )
    exponent_intensity: float = Field(
        default=2.0, ge=1, le=6, description="Exponent [1] of cos(incidence) where intensity is seen: Lambert's law."
    )
    exponent_amplitude: float = Field(
        default=1.0, ge=1, le=6, description="Exponent [1] of cos(incidence) where amplitude is seen: its root."
    )
    looks_most: float = Field(
        default=6.0, gt=0, description="Looks [1] that a pixel may count; relief below a pixel makes the rest."
    )
    nadir: float = Field(
        default=0.3, ge=0, description="Ground range over altitude [1] below which brightness says nothing of slope."
    )
    brightest: float = Field(
        default=5.0, gt=1, description="Level [1] over a flat floor's at which pixels are cut; tames wreckage and fish."
    )


@dataclass(frozen=True)
class Course:
    """A straight track at constant speed, in the submap frame.

    Parameters
    ----------
    start : ndarray, shape (2,)
        Position of the first ping [m].
    step : ndarray, shape (2,)
        Way from ping to ping [m].
    """

    start: FloatArray
    step: FloatArray

    @property
    def direction(self) -> FloatArray:
        """Shape (2,): unit vector along the track."""
        return np.asarray(self.step / np.hypot(*self.step))


@dataclass(frozen=True)
class GroundImage:
    """One image a side (port, starboard), rows along the track, columns outwards from nadir.

    Parameters
    ----------
    level : ndarray, shape (2, n_y, n_x)
        Echo over that of a flat floor [1].
    looks : ndarray, shape (2, n_y, n_x)
        Independent looks behind it; 0 where there is no echo.
    looks_most : float
        The most looks that a pixel may count.
    sensor_height, nadir_height : ndarray, shape (n_y,)
        Sonar and the floor below it, in the submap frame [m].
    spacing : tuple of float
        Distance between rows and between columns [m].
    exponent : float
        Exponent of the cosine of incidence.
    power : float
        What the level must be raised to, to be intensity: 1, or 2 for amplitude.
    """

    level: FloatArray
    looks: FloatArray
    looks_most: float
    sensor_height: FloatArray
    nadir_height: FloatArray
    spacing: tuple[float, float]
    exponent: float
    power: float = 1.0

    @property
    def ground_range(self) -> FloatArray:
        """Shape (n_x,): middles of the columns [m]."""
        return np.asarray((np.arange(self.level.shape[2]) + 0.5) * self.spacing[1])

    @property
    def weight(self) -> FloatArray:
        """Shape (2, n_y, n_x): one over the relative variance of a pixel."""
        return self.looks * self.looks_most / (self.looks + self.looks_most)


def straight_course(data: WindowData) -> Course:
    """The straight track at constant speed that is nearest to a window's pings.

    Parameters
    ----------
    data : WindowData
        The window.

    Returns
    -------
    course : Course
        Along the anchor's heading, a millimetre a ping, where the vehicle stands still.
    """
    place = data.sensors[:, :, :2].mean(axis=1)
    ping = np.arange(len(place)) - 0.5 * (len(place) - 1)
    step = ping @ place / max(float(ping @ ping), 1.0)
    if np.hypot(*step) < 1e-3:
        step = np.array([1e-3, 0.0])
    return Course(place.mean(axis=0) + ping[0] * step, step)


def pings_a_row(course: Course, n_pings: int, spacing: float) -> int:
    """Number of pings averaged to one row.

    Parameters
    ----------
    course : Course
        The straight track.
    n_pings : int
        Pings of the window.
    spacing : float
        Wanted distance between rows [m].

    Returns
    -------
    group : int
        At least one; no more than the window has.
    """
    return int(np.clip(round(spacing / float(np.hypot(*course.step))), 1, n_pings))


def ground_image(data: WindowData, radiometry: Radiometry, spacing: float, config: ImageConfig) -> GroundImage:
    """Correct a window's lines to ground range and stack them.

    Parameters
    ----------
    data : WindowData
        The window.
    radiometry : Radiometry
        Beam pattern, range law and noise floor: what a flat floor would have given.
    spacing : float
        Size of a pixel [m].
    config : ImageConfig
        How.

    Returns
    -------
    image : GroundImage
        Its level is 1 on average.

    Raises
    ------
    ValueError
        If nothing lies within range of a flat floor, or the image would not fit in any memory.

    Notes
    -----
    ``ground_range = sqrt(slant_range**2 - altitude**2)``. Holds for a flat, level seafloor, a level vehicle and one
    sound speed; roll, pitch and yaw are taken for zero. Samples are averaged with the share of them in a pixel.
    """
    course = straight_course(data)
    group = pings_a_row(course, len(data.sensors), spacing)
    altitude, sensor = (_rows(part, group) for part in (data.altitude, data.sensors[:, :, 2].mean(axis=1)))
    echoes = _recorded(data, radiometry)
    known = np.isfinite(echoes)
    total, count = (stacked(np.asarray(part, float), data, spacing) for part in (np.where(known, echoes, 0), known))
    ground_range = (np.arange(total.shape[2]) + 0.5) * spacing
    slant_range = np.hypot(altitude[:, None], ground_range)
    flat = expected_echo(slant_range, altitude, (0 * altitude, 0 * altitude), radiometry.tables)
    level, looks = _levels(total, count, np.moveaxis(flat, 1, 0), radiometry)
    looks = np.where(ground_range < config.nadir * altitude[:, None], 0.0, looks)
    power, exponent = (1.0, config.exponent_intensity)
    if radiometry.quantity == Quantity.AMPLITUDE:
        power, exponent = (2.0, config.exponent_amplitude)
    looks, most = power**2 * looks, power**2 * config.looks_most  # a root halves relative errors
    size = (float(np.hypot(*course.step)) * group, spacing)
    level = np.minimum(level / _mean_level(level, looks), config.brightest)
    return GroundImage(level, looks, most, sensor, sensor - altitude, size, exponent, power)


def stacked(values: FloatArray, data: WindowData, spacing: float) -> FloatArray:
    """Sums of samples over the pixels of both images.

    Parameters
    ----------
    values : ndarray, shape (P, 2, M)
        One number a sample.
    data : WindowData
        The window.
    spacing : float
        Size of a pixel [m].

    Returns
    -------
    sums : ndarray, shape (2, n_y, n_x)
        Port and starboard; a sample on the border of two pixels is shared between them.

    Raises
    ------
    ValueError
        If nothing lies within range of a flat floor, or the image would not fit in any memory.
    """
    group = pings_a_row(straight_course(data), len(values), spacing)
    n_x = _columns(data, spacing, len(values) // group)
    sums = np.cumsum(np.pad(values, ((0, 0), (0, 0), (1, 0))), axis=-1)
    ends = np.sqrt((np.arange(n_x + 1) * spacing) ** 2 + data.altitude[:, None] ** 2) / data.sample_spacing[:, None]
    sample = np.arange(sums.shape[-1], dtype=np.float64)
    at_ends = np.array([[np.interp(end, sample, side) for side in ping] for end, ping in zip(ends, sums, strict=True)])
    return np.asarray(np.moveaxis(_rows(np.diff(at_ends, axis=-1), group), 1, 0) * group)


def shadow_image(is_shadow: BoolArray, data: WindowData, spacing: float) -> BoolArray:
    """A shadow map of samples as one of pixels.

    Parameters
    ----------
    is_shadow : ndarray of bool, shape (P, 2, M)
        Which samples of each line lie in shadow.
    data : WindowData
        The window.
    spacing : float
        Size of a pixel [m].

    Returns
    -------
    is_shadow : ndarray of bool, shape (2, n_y, n_x)
        Pixels more than half of whose samples do.
    """
    share = stacked(is_shadow.astype(np.float64), data, spacing)
    return np.asarray(share > 0.5 * stacked(np.ones(is_shadow.shape), data, spacing))


def shadows_of_lines(data: WindowData, radiometry: Radiometry, config: ShadowConfig) -> BoolArray:
    """The shadow map that each line of a window gives by itself, the vehicle taken for level.

    Parameters
    ----------
    data : WindowData
        The window.
    radiometry : Radiometry
        What a lit floor would return.
    config : ShadowConfig
        How dark is dark.

    Returns
    -------
    is_shadow : ndarray of bool, shape (P, 2, M)
        Port and starboard.
    """
    slant_range = (np.arange(data.intensity.shape[2]) + 0.5) * data.sample_spacing[:, None]
    level = 0 * data.altitude
    expected = expected_echo(slant_range, data.altitude, (level, level), radiometry.tables)
    return label_shadows(data.intensity, expected, data.sample_spacing, radiometry.tables.noise, config)


def _rows(values: FloatArray, group: int) -> FloatArray:
    """Averages over the pings of a row; pings left over at the end are left out."""
    n_y = len(values) // group
    return np.asarray(values[: n_y * group].reshape(n_y, group, *values.shape[1:]).mean(axis=1))


def _columns(data: WindowData, spacing: float, n_y: int) -> int:
    reach, altitude = data.slant_range_max, float(data.altitude.min())
    n_x = int(np.sqrt(max(reach**2 - altitude**2, 0.0)) / spacing)
    if n_x < 1:
        raise ValueError(
            f"a slant range of {reach:.3g} m and an altitude of {altitude:.3g} m given: a range beyond it is wanted"
        )
    if 2 * n_x * n_y > _MOST_PIXELS:
        raise ValueError(
            f"an image of {2 * n_x * n_y:.0e} pixels of {spacing} m given, at most {_MOST_PIXELS:.0e} wanted: "
            "larger pixels or shorter windows"
        )
    return n_x


def _recorded(data: WindowData, radiometry: Radiometry) -> FloatArray:
    return np.sqrt(data.intensity) if radiometry.quantity == Quantity.AMPLITUDE else data.intensity


def _levels(
    total: FloatArray, count: FloatArray, flat: FloatArray, radiometry: Radiometry
) -> tuple[FloatArray, FloatArray]:
    """Shape (2, n_y, n_x): echoes over a flat floor's, and their looks, fewer where noise drowns the echo."""
    noise = radiometry.tables.noise[:, None, None]
    mean = np.divide(total, count, out=np.zeros_like(total), where=count > 1e-6)
    power = 2.0 if radiometry.quantity == Quantity.AMPLITUDE else 1.0
    level = (np.maximum(mean**power - noise, 0.0) / flat) ** (1 / power)
    looks = np.where(count > 1e-6, count * radiometry.looks * (flat / (flat + noise)) ** 2, 0.0)
    return level, looks


def _mean_level(level: FloatArray, looks: FloatArray) -> float:
    """Mean of the pixels that are lit; what is brighter than thrice the median counts as that."""
    lit = level[(looks > 0) & (level > 0)]
    if lit.size == 0:
        return 1.0
    median = float(np.median(lit))
    return float(np.minimum(lit[lit > 0.1 * median], 3 * median).mean())
