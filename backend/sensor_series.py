"""Raw sensor series on one grid of times, cut into the epochs of the inertial filter."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from backend.arrays import FloatArray, IntArray
from backend.inertial_state import GRAVITY
from backend.sensor_errors import SensorErrorsConfig

Sensors = Mapping[str, Mapping[str, FloatArray]]
_IMU = tuple(f"{name}_{axis}" for name in ("angular_rate", "specific_force") for axis in "xyz")
_COLUMNS = {
    "compass": ("yaw",),
    "tilt": ("roll", "pitch"),
    "dvl": ("velocity_x", "velocity_y", "velocity_z"),
    "speed_log": ("speed",),
    "depth": ("depth",),
    "gnss": ("position_x", "position_y"),
}
_HEADINGS = ("compass", "directional_gyro")
_SPEEDS = ("dvl", "speed_log")
_LONGEST_STEP = 0.5  # s between answers of an inertial unit; over more, something may have happened unseen


@dataclass(frozen=True)
class Answers:
    """What one sensor answered.

    Parameters
    ----------
    time : ndarray, shape (M,)
        When [s], strictly increasing.
    values : ndarray, shape (M, K)
        What; finite.
    """

    time: FloatArray
    values: FloatArray

    @cached_property
    def rate(self) -> float:
        """Answers a second [1/s]."""
        return float(1.0 / np.median(np.diff(self.time))) if self.time.size > 1 else 1.0

    def at(self, time: FloatArray) -> FloatArray:
        """Answers between the answers, on straight lines; shape (T, K)."""
        return np.stack([np.interp(time, self.time, column) for column in self.values.T], axis=-1)


@dataclass(frozen=True)
class SensorSeries:
    """All sensors of a dive on one grid.

    Parameters
    ----------
    time : ndarray, shape (G,)
        Every time at which any sensor answered, from the first to the last of the inertial unit [s].
    inertial : ndarray, shape (G, 6)
        Turn rate [rad/s] and specific force [m/s2] in the body frame.
    noise : ndarray, shape (G, 2)
        Their white noise until the next time [rad/sqrt(s), m/s/sqrt(s)].
    edges : ndarray of int, shape (E + 1,)
        Where on the grid the epochs begin and end.
    answers : dict of str to Answers
        By what is measured: compass, tilt, dvl, speed_log, depth, gnss; those that have any.
    has_imu : bool
        Whether rates and forces were measured, not derived from attitude and speed.
    first_attitude : ndarray, shape (3,)
        Roll, pitch and yaw at the first time [rad].
    """

    time: FloatArray
    inertial: FloatArray
    noise: FloatArray
    edges: IntArray
    answers: dict[str, Answers]
    has_imu: bool
    first_attitude: FloatArray

    @property
    def n_epochs(self) -> int:
        """Number of epochs E."""
        return len(self.edges) - 1


def can_reckon(sensors: Sensors) -> bool:
    """Whether sensors say enough for dead reckoning.

    Parameters
    ----------
    sensors : mapping of str to mapping of str to ndarray
        Series by sensor.

    Returns
    -------
    can_reckon : bool
        True with a heading, a speed and a depth; an inertial unit makes it better.
    """
    return (
        any(name in sensors for name in _HEADINGS)
        and any(_is_known(sensors, n) for n in _SPEEDS)
        and "depth" in sensors
    )


def gather(sensors: Sensors, config: SensorErrorsConfig) -> SensorSeries:
    """Put raw series on one grid.

    Parameters
    ----------
    sensors : mapping of str to mapping of str to ndarray
        Series by sensor, each with its ``time`` [s] and columns as a simulated recording has them; rows that are not
        finite, or not later than those before, are left out.
    config : SensorErrorsConfig
        Length of an epoch, and noise where nothing is measured.

    Returns
    -------
    series : SensorSeries
        The grid.

    Raises
    ------
    ValueError
        If no heading, no speed or no depth is there, or a column is missing or has another length than its time.
    """
    if not can_reckon(sensors):
        given = ", ".join(sorted(sensors)) or "none"
        raise ValueError(
            f"dead reckoning from sensors wants compass or directional_gyro, dvl or speed_log with answers, and depth; "
            f"got {given}"
        )
    attitude = _rows(sensors, next(name for name in _HEADINGS if name in sensors), ("roll", "pitch", "yaw"))
    attitude = Answers(attitude.time, np.unwrap(attitude.values, axis=0))
    answers = {
        name: _rows(sensors, _source(sensors, name), columns)
        for name, columns in _COLUMNS.items()
        if _is_known(sensors, _source(sensors, name))
    }
    has_imu = _is_known(sensors, "imu")
    imu = _rows(sensors, "imu", _IMU) if has_imu else _derived(attitude, answers)
    return _on_one_grid((attitude, imu), answers, has_imu, config)


def gather_fixes(sensors: Sensors) -> Answers | None:
    """Positions at the surface.

    Parameters
    ----------
    sensors : mapping of str to mapping of str to ndarray
        Series by sensor.

    Returns
    -------
    fixes : Answers or None
        x and y [m]; None without a fix.
    """
    return _rows(sensors, "gnss", _COLUMNS["gnss"]) if _is_known(sensors, "gnss") else None


def _source(sensors: Sensors, name: str) -> str:
    """The sensor that measures something."""
    return name if name != "tilt" else next(source for source in _HEADINGS if source in sensors)


def _is_known(sensors: Sensors, name: str) -> bool:
    """Whether a sensor has at least one answer."""
    if name not in sensors:
        return False
    columns = [np.asarray(values, dtype=np.float64) for key, values in sensors[name].items() if key[:5] != "range"]
    return all(len(c) == len(columns[0]) for c in columns) and bool(np.all(np.isfinite(columns), axis=0).any())


def _rows(sensors: Sensors, name: str, columns: tuple[str, ...]) -> Answers:
    """The finite rows of a sensor, in the order of time."""
    series = sensors[name]
    missing = [column for column in ("time", *columns) if column not in series]
    if missing:
        raise ValueError(f"sensor {name} has no {missing[0]}: {', '.join(('time', *columns))} wanted")
    time, values = np.asarray(series["time"], dtype=np.float64), [np.asarray(series[c], np.float64) for c in columns]
    wrong = next((c for c, v in zip(columns, values, strict=True) if v.shape != time.shape or time.ndim != 1), None)
    if wrong is not None:
        raise ValueError(
            f"sensor {name}: {wrong} of shape {np.shape(series[wrong])} given, one a time wanted: {time.shape}"
        )
    finite = np.isfinite(time) & np.isfinite(values).all(axis=0)
    time, rows = time[finite], np.stack(values, axis=-1)[finite]
    later = np.ones(time.size, dtype=np.bool_)
    later[1:] = time[1:] > np.maximum.accumulate(time)[:-1]
    return Answers(time[later], rows[later])


def _derived(attitude: Answers, answers: Mapping[str, Answers]) -> Answers:
    """Rates and forces of a vehicle without an inertial unit: as attitude and speed say, none of it well."""
    time, rotation = attitude.time, Rotation.from_euler("ZYX", attitude.values[:, ::-1])
    before, after = np.maximum(np.arange(time.size) - 1, 0), np.minimum(np.arange(time.size) + 1, time.size - 1)
    span = np.maximum(time[after] - time[before], 1e-9)[:, None]
    rate = (rotation[before].inv() * rotation[after]).as_rotvec() / span
    speeds = answers["dvl"] if "dvl" in answers else answers["speed_log"]
    forward = np.pad(speeds.at(time)[:, :1], ((0, 0), (0, 2)))
    force = rotation.inv().apply([0.0, 0.0, GRAVITY]) + np.cross(rate, forward)
    return Answers(time, np.concatenate([rate, force], axis=1))


def _on_one_grid(
    sources: tuple[Answers, Answers], answers: dict[str, Answers], has_imu: bool, config: SensorErrorsConfig
) -> SensorSeries:
    """Merge the times of all sensors and cut them into epochs."""
    attitude, imu = sources
    first, last = imu.time[0], imu.time[-1]
    time = np.unique(np.concatenate([imu.time, *(a.time for a in answers.values())]))
    time = time[(time >= first) & (time <= last)]
    if time.size < 2:
        raise ValueError(f"dead reckoning from sensors wants answers over some time, got {time.size} times")
    steps = np.append(np.arange(first, last, config.epoch), last)
    edges = np.unique(np.searchsorted(time, steps, side="left"))
    noise = _noise(time, imu, has_imu, config)
    return SensorSeries(time, imu.at(time), noise, edges, answers, has_imu, attitude.at(time[:1])[0])


def _noise(time: FloatArray, imu: Answers, has_imu: bool, config: SensorErrorsConfig) -> FloatArray:
    """White noise of each step: the unit's own, or that of what goes unmeasured where it does not answer."""
    measured = np.array([config.gyro_noise, config.accelerometer_noise])
    unmeasured = np.array([config.turn_noise, config.acceleration_noise])
    interval = np.clip(np.searchsorted(imu.time, time, side="right") - 1, 0, max(imu.time.size - 2, 0))
    is_gap = np.diff(imu.time)[interval] > _LONGEST_STEP if imu.time.size > 1 else np.ones(time.size, dtype=np.bool_)
    return np.where((is_gap | (not has_imu))[:, None], unmeasured, measured)
