"""Dead reckoning: how far a track without fixes may have drifted, from one ping to any other.

The errors of a heading reference and a Doppler log grow along the track: the heading wanders and deviates with the
heading itself, the velocity is scaled and turned, and both are noisy. To first order each step adds an error of its
own, a planar twist seen from the world's origin, and the twists add up. So sums over the track, taken once, answer for
any two pings. A constant heading bias turns the whole track and no relative pose: it stays out of these.
"""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from backend.arrays import FloatArray, IntArray
from backend.constant_errors import ConstantErrors
from backend.drift_model import DeadReckoningConfig, constant_sds, deviation, propagate, quarter_turn
from backend.poses import as_poses, cross_matrix, sandwich

__all__ = ["DeadReckoning", "DeadReckoningConfig"]

_PLANAR = [2, 3, 4]  # yaw, x, y in a 6-vector


class DeadReckoning:
    """The uncertainty of a dead-reckoned track.

    Parameters
    ----------
    time : array_like, shape (N,)
        Time of the pings [s], strictly increasing.
    T_world_body_dr : array_like, shape (N, 4, 4)
        Dead-reckoned body poses.
    config : DeadReckoningConfig
        Errors of the sensors.

    Raises
    ------
    ValueError
        If poses and times do not fit, time does not increase or a pose is not rigid.

    Notes
    -----
    Holds to first order: heading errors small against one radian. The track itself stands for the true one.
    """

    def __init__(self, time: ArrayLike, T_world_body_dr: ArrayLike, config: DeadReckoningConfig | None = None) -> None:
        self._time = np.array(time, dtype=np.float64)
        self._T = as_poses(T_world_body_dr, "T_world_body_dr").copy()
        self.config = config or DeadReckoningConfig()
        if self._time.shape != (len(self._T),) or len(self._T) == 0:
            raise ValueError(f"one time a pose is wanted, got {self._time.shape} times and {len(self._T)} poses")
        if not np.all(np.diff(self._time) > 0):
            raise ValueError("time must increase strictly from ping to ping")
        self._accumulate()

    @property
    def time(self) -> FloatArray:
        """Shape (N,): time of the pings [s]."""
        return self._time

    @property
    def positions(self) -> FloatArray:
        """Shape (N, 3): dead-reckoned positions [m]."""
        return self._T[:, :3, 3]

    @property
    def n_pings(self) -> int:
        """Number of pings N."""
        return len(self._time)

    def relative_covariances(self, first: ArrayLike, second: ArrayLike) -> FloatArray:
        """Covariances of the pose of one ping seen from another, for many pairs at once.

        Parameters
        ----------
        first, second : array_like of int, shape (P,)
            Pings; either may be the earlier.

        Returns
        -------
        covariance : ndarray, shape (P, 6, 6)
            Covariance of ``T_first_second`` along the axes of the first body, rotation first [rad**2, rad m, m**2].
        """
        return self._relative(first, second, slack=1.0)

    def relative_covariance(self, first: int, second: int) -> FloatArray:
        """Covariance of the pose of one ping seen from another.

        Parameters
        ----------
        first, second : int
            Pings; either may be the earlier.

        Returns
        -------
        covariance : ndarray, shape (6, 6)
            As `relative_covariances` gives it.
        """
        return np.asarray(self.relative_covariances([first], [second])[0])

    def odometry_covariance(self, first: int, second: int) -> FloatArray:
        """Covariance for an odometry factor, whose graph holds depth, roll and pitch of each anchor by themselves.

        Parameters
        ----------
        first, second : int
            Pings.

        Returns
        -------
        covariance : ndarray, shape (6, 6)
            Like `relative_covariance`, but with depth and tilt so loose that they are not counted twice.
        """
        return np.asarray(self._relative([first], [second], slack=self.config.unary_slack)[0])

    def constant_errors(self, pings: ArrayLike) -> ConstantErrors | None:
        """What errors that are constant over the dive do to the first of some pings and to each step to the next.

        Parameters
        ----------
        pings : array_like of int, shape (S,)
            The pings, ascending.

        Returns
        -------
        constants : ConstantErrors or None
            Of scale, misalignment and the two deviations of the heading, which ``odometry_covariance`` holds too; None
            where the track's errors are of another kind.
        """
        numbers = self._pings(pings)
        i, j = numbers[:-1], numbers[1:]
        steps = self._at_pings(j) @ (self._constant[j] - self._constant[i])
        moves = np.zeros((len(numbers), 6, steps.shape[2]))
        moves[1:, _PLANAR] = steps
        moves[0, _PLANAR] = (self._at_pings(numbers[:1]) @ (self._constant[numbers[:1]] + self._at_start))[0]
        to_body = np.swapaxes(self._T[i, :3, :3], 1, 2)
        moves[1:, :3], moves[1:, 3:] = to_body @ moves[1:, :3], to_body @ moves[1:, 3:]
        return ConstantErrors(moves, self._turned(i, j, self._random_covariance(i, j), self.config.unary_slack))

    def drift_variances(self, first: ArrayLike, second: ArrayLike) -> FloatArray:
        """How far the track may have drifted between pings, along the world's axes.

        Parameters
        ----------
        first, second : array_like of int, shape (P,)
            Pings; either may be the earlier.

        Returns
        -------
        variances : ndarray, shape (P, 4)
            Of x, y, z [m**2] and yaw [rad**2] of the second ping when the first is known; z does not drift.
        """
        i, j = self._pings(first), self._pings(second)
        yaw, x, y = np.moveaxis(np.diagonal(self._planar_covariance(i, j), axis1=1, axis2=2), 1, 0)
        return np.stack([x, y, np.zeros_like(x), yaw], axis=1)

    def unseen_variances(self, origin: int) -> FloatArray:
        """How far the whole track may be stretched and turned about one ping beyond what a graph can say.

        Parameters
        ----------
        origin : int
            The ping whose position is known.

        Returns
        -------
        variances : ndarray, shape (N, 4)
            Of x, y, z [m**2] and yaw [rad**2] of every ping: none, as the graph solves for the constant errors.
        """
        self._pings(origin)
        return np.zeros((self.n_pings, 4))

    @cached_property
    def covariances(self) -> FloatArray:
        """Shape (N, 4, 4): covariance of x, y, z and yaw in the world when the position of the first ping is known."""
        return propagate(self._time, self._T, self.config)

    @cached_property
    def sigmas(self) -> FloatArray:
        """Shape (N, 4): standard deviations of x, y, z [m] and yaw [rad] when the first ping's position is known."""
        return np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))

    def _pings(self, pings: ArrayLike) -> IntArray:
        """Check ping numbers."""
        numbers = np.atleast_1d(np.asarray(pings)).astype(np.int64)
        if numbers.size and not (numbers.min() >= 0 and numbers.max() < len(self._time)):
            raise ValueError(f"pings must lie in 0..{len(self._time) - 1}, got {numbers.min()}..{numbers.max()}")
        return numbers

    def _accumulate(self) -> None:
        """Sum the twists of all steps: covariance of the random ones, sensitivity to the constant ones."""
        config, dt = self.config, np.diff(self._time)
        self._position = self._T[:, :2, 3] - self._T[:, :2, 3].mean(axis=0)
        step, middle = np.diff(self._position, axis=0), 0.5 * (self._position[1:] + self._position[:-1])
        # a turn about the middle of the step: one in yaw, minus J p in x and y
        turn = np.concatenate([np.ones((len(step), 1)), -quarter_turn(middle)], axis=1)
        sideways = np.pad(quarter_turn(step), ((0, 0), (1, 0)))
        walk = np.einsum("ka,kb->kab", turn, turn) + np.einsum("ka,kb->kab", sideways, sideways) / 12.0
        random = config.heading_walk**2 * walk + config.velocity_noise**2 * np.diag([0.0, 1.0, 1.0])
        self._random = _cumulate(dt[:, None, None] * random)
        deviating = np.einsum("ka,kb->kab", turn, np.diff(deviation(self._T), axis=0))
        scaled = np.pad(step, ((0, 0), (1, 0)))
        constant = np.concatenate([scaled[:, :, None], sideways[:, :, None], deviating], axis=2)
        self._constant = _cumulate(constant * constant_sds(config))
        # the heading deviates at the first ping too: a turn of all that comes after about it
        at_start = np.concatenate([[1.0], -quarter_turn(self._position[0])])
        self._at_start = np.outer(at_start, np.pad(deviation(self._T)[0], (2, 0)) * constant_sds(config))

    def _planar_covariance(self, i: IntArray, j: IntArray) -> FloatArray:
        """Covariance of yaw, x and y of ping j, seen from ping i, along the world's axes."""
        constant = self._at_pings(j) @ (self._constant[j] - self._constant[i])
        return self._random_covariance(i, j) + constant @ np.swapaxes(constant, 1, 2)

    def _random_covariance(self, i: IntArray, j: IntArray) -> FloatArray:
        """The part of it that is no constant error's."""
        return sandwich(self._at_pings(j), self._random[np.maximum(i, j)] - self._random[np.minimum(i, j)])

    def _at_pings(self, j: IntArray) -> FloatArray:
        """What twists about the world's origin are at pings."""
        at_ping = np.tile(np.eye(3), (len(j), 1, 1))
        at_ping[:, 1:, 0] = quarter_turn(self._position[j])
        return at_ping

    def _relative(self, first: ArrayLike, second: ArrayLike, slack: float) -> FloatArray:
        """Covariances of relative poses along the first body's axes, depth and tilt sigmas times the slack."""
        i, j = self._pings(first), self._pings(second)
        return self._turned(i, j, self._planar_covariance(i, j), slack) * (i != j)[:, None, None]

    def _turned(self, i: IntArray, j: IntArray, planar: FloatArray, slack: float) -> FloatArray:
        """Covariances of yaw, x and y with those of depth and tilt, along the first body's axes."""
        covariance = np.zeros((len(i), 6, 6))
        covariance[np.ix_(range(len(i)), _PLANAR, _PLANAR)] = planar
        covariance[:, 5, 5] += 2.0 * (slack * self.config.depth_sd) ** 2
        covariance += (slack * self.config.tilt_sd) ** 2 * _tilt_pattern(self._T[j, :3, 3] - self._T[i, :3, 3])
        turn = np.zeros((len(i), 6, 6))
        turn[:, :3, :3] = turn[:, 3:, 3:] = np.swapaxes(self._T[i, :3, :3], 1, 2)
        return sandwich(turn, covariance)


def _cumulate(steps: FloatArray) -> FloatArray:
    """Sums up to each ping, zero at the first."""
    return np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])


def _tilt_pattern(lever: FloatArray) -> FloatArray:
    """Covariance per unit of tilt variance: both bodies tilt, and the first swings the lever arm."""
    first = np.concatenate([np.tile(-np.eye(3)[:, :2], (len(lever), 1, 1)), cross_matrix(lever)[:, :, :2]], axis=1)
    second = np.eye(6)[:, :2]
    return first @ np.swapaxes(first, 1, 2) + second @ second.T
