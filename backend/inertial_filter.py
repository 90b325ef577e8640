"""An error-state Kalman filter over inertial unit, velocity log, compass, depth and fixes, smoothed over the dive."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from backend.arrays import FloatArray
from backend.drift_model import DeadReckoningConfig
from backend.inertial_state import HEADING, N_STATES, POSITION, VELOCITY, State, prior_covariance
from backend.mechanisation import Motion, mechanise
from backend.sensor_models import GATED, MODELS, Residual, View
from backend.sensor_series import Sensors, SensorSeries, gather
from backend.smoother import Smoothed, Step, make_step, smooth

_Estimate = tuple[State, FloatArray]  # a state and the covariance of its error


class Reckoned(NamedTuple):
    """A track from sensors.

    Parameters
    ----------
    smoothed : Smoothed
        States at the edges of the epochs, with covariance; positions from the origin.
    origin : ndarray, shape (3,)
        Where the dive starts [m].
    time : ndarray, shape (G,)
        Every time at which a sensor answered [s].
    attitude : ndarray, shape (G, 3, 3)
        Smoothed rotation from the body to the world at these.
    """

    smoothed: Smoothed
    origin: FloatArray
    time: FloatArray
    attitude: FloatArray


def filter_sensors(
    sensors: Sensors, config: DeadReckoningConfig, start: tuple[float, float], earth: FloatArray
) -> Reckoned:
    """Estimate the track that all sensors agree on best.

    Parameters
    ----------
    sensors : mapping of str to mapping of str to ndarray
        Series by sensor; see `backend.sensor_series.gather`.
    config : DeadReckoningConfig
        Errors of the sensors.
    start : tuple of float
        x and y at the first time [m]: the gauge, or, where there are fixes, as good as one of them.
    earth : ndarray, shape (3,)
        Turn rate of the Earth in the world frame [rad/s]; zero where the place is unknown.

    Returns
    -------
    reckoned : Reckoned
        The smoothed track.

    Raises
    ------
    ValueError
        If the sensors do not say enough; see `backend.sensor_series.gather`.
    """
    series, origin = _seen_from_start(gather(sensors, config.sensors), start)
    start_sd = config.sensors.gnss_sd if "gnss" in series.answers else 0.0
    prior = prior_covariance(config, "compass" in series.answers, series.has_imu, start_sd)
    estimate, steps = (_first_state(series), prior), list[Step]()
    for epoch in pairwise(series.edges):
        motion = _motion(series, epoch, estimate[0], earth)
        predicted = _predict(estimate, motion, series.time[epoch[1]] - series.time[epoch[0]], config)
        steps.append(make_step(estimate, predicted, motion.transition))
        estimate = _update(predicted, _residuals(series, epoch, motion, predicted[0], config), config)
    smoothed = smooth(series.time[series.edges], steps, estimate)
    return Reckoned(smoothed, origin, series.time, _attitudes(series, smoothed, earth))


def _seen_from_start(series: SensorSeries, start: tuple[float, float]) -> tuple[SensorSeries, FloatArray]:
    """Depth and fixes as they are from where the dive starts, and that place."""
    depth = float(series.answers["depth"].at(series.time[:1])[0, 0])
    moved = {"depth": np.array([depth]), "gnss": np.array(start)}
    answers = {
        name: replace(answer, values=answer.values - moved[name]) if name in moved else answer
        for name, answer in series.answers.items()
    }
    return replace(series, answers=answers), np.array([*start, -depth])


def _first_state(series: SensorSeries) -> State:
    """Attitude and speed as first measured, at the origin."""
    attitude = Rotation.from_euler("ZYX", series.first_attitude[::-1]).as_matrix()
    vector, first = np.zeros(N_STATES), series.time[:1]
    speeds = series.answers["dvl"] if "dvl" in series.answers else series.answers["speed_log"]
    ahead = np.zeros(3)
    ahead[: speeds.values.shape[1]] = speeds.at(first)[0]
    vector[VELOCITY] = attitude @ ahead
    return State(attitude, vector)


def _motion(series: SensorSeries, epoch: tuple[int, int], state: State, earth: FloatArray) -> Motion:
    span = slice(epoch[0], epoch[1] + 1)
    return mechanise(state, series.time[span], series.inertial[span], series.noise[span], earth)


def _attitudes(series: SensorSeries, smoothed: Smoothed, earth: FloatArray) -> FloatArray:
    """Attitudes within the epochs, as the gyro has them from one smoothed edge to the next."""
    attitude = np.empty((series.time.size, 3, 3))
    attitude[series.edges] = smoothed.attitude
    for k, (first, last) in enumerate(pairwise(series.edges)):
        turned = _motion(series, (first, last), State(smoothed.attitude[k], smoothed.vector[k]), earth).attitude
        left = Rotation.from_matrix(smoothed.attitude[k + 1] @ turned[-1].T).as_rotvec()
        share = (series.time[first:last] - series.time[first]) / (series.time[last] - series.time[first])
        attitude[first:last] = Rotation.from_rotvec(np.multiply.outer(share, left)).as_matrix() @ turned[:-1]
    return attitude


def _predict(estimate: _Estimate, motion: Motion, duration: float, config: DeadReckoningConfig) -> _Estimate:
    """Carry state and covariance through an epoch."""
    from filterpy.kalman import predict  # half a second to import

    state, P = estimate
    vector, Q = state.vector.copy(), motion.noise.copy()
    vector[VELOCITY], vector[POSITION] = motion.velocity[-1], motion.position[-1]
    Q[HEADING, HEADING] += config.heading_walk**2 * duration
    _, P = predict(np.zeros(N_STATES), P, F=motion.transition, Q=Q)
    return State(motion.attitude[-1], vector), 0.5 * (P + P.T)


def _residuals(
    series: SensorSeries, epoch: tuple[int, int], motion: Motion, state: State, config: DeadReckoningConfig
) -> list[tuple[str, Residual]]:
    """What the sensors answered within an epoch, against what was expected."""
    (first, last), time, found = epoch, series.time, []
    for name, answers in series.answers.items():
        begin, end = np.searchsorted(answers.time, time[[first, last]], side="right")
        if begin == end:
            continue
        at = np.searchsorted(time, answers.time[begin:end]) - first
        lag = time[last] - answers.time[begin:end]
        track = motion.attitude[at], motion.velocity[at], motion.position[at]
        view = View(*track, lag, state.vector, answers.rate)
        found.append((name, MODELS[name](view, answers.values[begin:end], config)))
    return found


def _update(predicted: _Estimate, residuals: list[tuple[str, Residual]], config: DeadReckoningConfig) -> _Estimate:
    """Correct state and covariance by all that is believed."""
    from filterpy.kalman import update  # half a second to import

    state, P = predicted
    taken = [residual for name, residual in residuals if name not in GATED or _is_likely(residual, P, config)]
    if not taken:
        return predicted
    z, H = (np.concatenate(part) for part in list(zip(*taken, strict=True))[:2])
    R = np.zeros((len(z), len(z)))
    place = 0
    for residual in taken:
        block = slice(place, place + len(residual.difference))
        R[block, block], place = residual.covariance, block.stop
    error, P = update(np.zeros(N_STATES), P, z, R, H)  # in Joseph's form
    return state.plus(error), 0.5 * (P + P.T)


def _is_likely(residual: Residual, P: FloatArray, config: DeadReckoningConfig) -> bool:
    """Whether a difference is one that errors as stated make."""
    z, H, R = residual
    distance = z @ np.linalg.solve(H @ P @ H.T + R, z)
    return bool(distance <= _largest(config.sensors.gate_probability, len(z)))


@cache
def _largest(probability: float, n: int) -> float:
    """Squared distance that a share of n normal numbers stays below."""
    return float(chi2.ppf(probability, n))
