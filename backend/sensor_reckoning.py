"""A track reckoned anew from the raw sensors, with the covariance that belongs to it."""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp
from typing_extensions import override

from backend.arrays import FloatArray, IntArray
from backend.dead_reckoning import DeadReckoning
from backend.drift_model import DeadReckoningConfig, quarter_turn
from backend.inertial_filter import Reckoned, filter_sensors
from backend.inertial_state import MISALIGNMENT, POSITION, SCALE, VELOCITY
from backend.poses import sandwich
from backend.sensor_series import Sensors, gather_fixes

_MOST_BEYOND = 1.0  # s by which pings may lie outside the sensors' answers
_NOWHERE = np.zeros(3)


class Fix(NamedTuple):
    """A position at the surface.

    Parameters
    ----------
    ping : int
        The nearest ping.
    east, north : float
        In the world frame [m].
    sigma : float
        Standard deviation on each axis [m].
    """

    ping: int
    east: float
    north: float
    sigma: float


class SensorReckoning(DeadReckoning):
    """The uncertainty of a track that the inertial filter made; asked like any other dead reckoning.

    Parameters
    ----------
    time : array_like, shape (N,)
        Time of the pings [s], strictly increasing.
    reckoned : Reckoned
        What the filter found; it must cover the pings but for a second.
    config : DeadReckoningConfig
        Errors of the sensors.

    Raises
    ------
    ValueError
        If the sensors' answers do not cover the pings.

    Notes
    -----
    Errors of heading and position at two pings are correlated: through the constants, through a heading that walks,
    through fixes. Relative covariances take the joint covariance of both from the smoother. A graph adds up the
    odometry between its anchors as if each step erred for itself; so that the sum holds over the whole dive, the
    covariance for odometry lets the heading walk besides, as far in the end as it may drift.
    """

    def __init__(self, time: ArrayLike, reckoned: Reckoned, config: DeadReckoningConfig) -> None:
        self._smoothed = reckoned.smoothed
        super().__init__(time, _poses_at(np.asarray(time, dtype=np.float64), reckoned), config)

    @property
    def T_world_body(self) -> FloatArray:
        """Shape (N, 4, 4): body poses at the pings."""
        return self._T

    @cached_property
    @override
    def covariances(self) -> FloatArray:
        covariances = self._smoothed.covariances[self._edge][:, [1, 2, 3, 0]][:, :, [1, 2, 3, 0]]
        covariances[:, 2, 2] += self.config.depth_sd**2
        return covariances

    @override
    def constant_errors(self, pings: ArrayLike) -> None:
        return None

    @override
    def unseen_variances(self, origin: int) -> FloatArray:
        variances = self._smoothed.last_variances[[SCALE, MISALIGNMENT]]
        along = (self._T[:, :2, 3] - self._T[self._pings(origin)[0], :2, 3]) ** 2
        return np.pad(variances[0] * along + variances[1] * along[:, ::-1], ((0, 0), (0, 2)))

    @override
    def odometry_covariance(self, first: int, second: int) -> FloatArray:
        i, j = self._pings([first, second])
        sideways = np.append(quarter_turn(self._T[j, :2, 3] - self._T[i, :2, 3]), 0.0)
        to_body = self._T[i, :3, :3].T
        # a heading that walks: a turn about the middle of the way, and what sways about that
        turn = np.concatenate([to_body[:, 2], 0.5 * to_body @ sideways])
        sway = np.concatenate([np.zeros(3), to_body @ sideways / np.sqrt(12.0)])
        walk = self._turn_walk * abs(self._time[j] - self._time[i])
        return super().odometry_covariance(first, second) + walk * (np.outer(turn, turn) + np.outer(sway, sway))

    @cached_property
    def _turn_walk(self) -> float:
        """Walk of the heading [rad**2/s] that in independent steps makes as much of the dive as its slow drift does."""
        duration = float(self._time[-1] - self._time[0])
        if duration == 0:
            return 0.0
        ends = np.array([0]), np.array([self.n_pings - 1])
        return float(self._planar_covariance(*ends)[0, 0, 0]) / duration

    @override
    def _accumulate(self) -> None:
        """Find the edge of an epoch nearest to each ping."""
        edges = self._smoothed.time
        self._edge = np.searchsorted(0.5 * (edges[1:] + edges[:-1]), self._time)

    @override
    def _planar_covariance(self, i: IntArray, j: IntArray) -> FloatArray:
        first, last = np.minimum(self._edge[i], self._edge[j]), np.maximum(self._edge[i], self._edge[j])
        cross = self._smoothed.cross_covariances(first, last)[:, :3, :3]
        cross = np.where((self._edge[i] > self._edge[j])[:, None, None], np.swapaxes(cross, 1, 2), cross)
        own = self._smoothed.covariances[:, :3, :3]
        # seen from ping i, whose heading swings the arm to ping j
        seen = np.tile(-np.eye(3), (len(i), 1, 1))
        seen[:, 1:, 0] = -quarter_turn(self._T[j, :2, 3] - self._T[i, :2, 3])
        mixed = seen @ cross
        covariance = sandwich(seen, own[self._edge[i]]) + own[self._edge[j]] + mixed + np.swapaxes(mixed, 1, 2)
        return covariance + self._within_epoch(i, j)

    def _within_epoch(self, i: IntArray, j: IntArray) -> FloatArray:
        """Growth over the time that the edges nearest to two pings leave out."""
        edges = self._smoothed.time
        left_out = np.abs((self._time[j] - self._time[i]) - (edges[self._edge[j]] - edges[self._edge[i]]))
        noise = np.array([self.config.sensors.gyro_noise, self.config.velocity_noise, self.config.velocity_noise])
        return left_out[:, None, None] * np.diag(noise**2)


def reckon(
    sensors: Sensors,
    time: ArrayLike,
    start: tuple[float, float],
    config: DeadReckoningConfig,
    earth: Sequence[float] | FloatArray = _NOWHERE,
) -> SensorReckoning:
    """Reckon a track from raw sensors.

    Parameters
    ----------
    sensors : mapping of str to mapping of str to ndarray
        Series by sensor, each with its ``time``: compass or directional_gyro (roll, pitch, yaw [rad]), dvl (velocity_x,
        _y, _z [m/s], NaN without bottom lock) or speed_log (speed [m/s]), depth [m], and where there are imu
        (angular_rate_x.. [rad/s], specific_force_x.. [m/s2]) and gnss (position_x, _y [m]); body forward-port-up.
    time : array_like, shape (N,)
        Time of the pings [s], strictly increasing.
    start : tuple of float
        x and y where the dive begins [m].
    config : DeadReckoningConfig
        Errors of the sensors.
    earth : sequence of float, shape (3,)
        Turn rate of the Earth in the world frame [rad/s]; zero where the place is unknown.

    Returns
    -------
    reckoning : SensorReckoning
        The track and its uncertainty.

    Raises
    ------
    ValueError
        If the sensors do not say enough or do not cover the pings.
    """
    reckoned = filter_sensors(sensors, config, start, np.asarray(earth, dtype=np.float64))
    return SensorReckoning(time, reckoned, config)


def surface_fixes(sensors: Sensors, time: ArrayLike, sigma: float) -> list[Fix]:
    """Fixes at the surface as what a pose graph may take: a ping, where it was, how well.

    Parameters
    ----------
    sensors : mapping of str to mapping of str to ndarray
        Series by sensor; those of gnss count.
    time : array_like, shape (N,)
        Time of the pings [s].
    sigma : float
        Error of a fix on each axis [m].

    Returns
    -------
    fixes : list of Fix
        In the order of time; those farther than a second from any ping are left out.
    """
    pings, answers = np.asarray(time, dtype=np.float64), gather_fixes(sensors)
    if answers is None:
        return []
    nearest = np.searchsorted(0.5 * (pings[1:] + pings[:-1]), answers.time)
    near = np.abs(pings[nearest] - answers.time) <= _MOST_BEYOND
    rows = zip(nearest[near], answers.values[near], strict=True)
    return [Fix(int(ping), float(east), float(north), sigma) for ping, (east, north) in rows]


def _poses_at(time: FloatArray, reckoned: Reckoned) -> FloatArray:
    """Poses between the edges of the epochs: positions by their velocities too, attitudes on great arcs."""
    edges, vector = reckoned.smoothed.time, reckoned.smoothed.vector
    if time.size and not (time.min() >= edges[0] - _MOST_BEYOND and time.max() <= edges[-1] + _MOST_BEYOND):
        raise ValueError(
            f"the sensors must cover the pings: they answer from {edges[0]:.3f} to {edges[-1]:.3f} s, pings come from "
            f"{time.min():.3f} to {time.max():.3f} s"
        )
    T, at = np.tile(np.eye(4), (time.size, 1, 1)), time - edges[0]
    inside = np.clip(at, 0.0, edges[-1] - edges[0])
    spline = CubicHermiteSpline(edges - edges[0], vector[:, POSITION], vector[:, VELOCITY])
    T[:, :3, 3] = reckoned.origin + spline(inside) + (at - inside)[:, None] * spline(inside, 1)
    turning = Slerp(reckoned.time - edges[0], Rotation.from_matrix(reckoned.attitude))
    T[:, :3, :3] = turning(inside).as_matrix()
    return T
