"""Strapdown mechanisation: attitude, velocity and position from turn rates and specific forces, and their errors.

Holds over a flat Earth that turns: Coriolis forces, below a twentieth of a MEMS accelerometer's bias, are left out.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from backend.arrays import FloatArray
from backend.inertial_state import FORCE_BIAS, GRAVITY, GYRO_BIAS, N_MOVING, N_STATES, POSITION, VELOCITY, State


class Motion(NamedTuple):
    """An epoch's motion on the grid of times, and how errors go through it.

    Parameters
    ----------
    attitude : ndarray, shape (G, 3, 3)
        Rotation from the body to the world.
    velocity, position : ndarray, shape (G, 3)
        In the world [m/s, m].
    transition, noise : ndarray, shape (22, 22)
        Of the error state from the first to the last time.
    """

    attitude: FloatArray
    velocity: FloatArray
    position: FloatArray
    transition: FloatArray
    noise: FloatArray


def mechanise(state: State, time: FloatArray, inertial: FloatArray, noise: FloatArray, earth: FloatArray) -> Motion:
    """Carry a state through an epoch.

    Parameters
    ----------
    state : State
        At the first time.
    time : ndarray, shape (G,)
        Times [s].
    inertial : ndarray, shape (G, 6)
        Turn rate [rad/s] and specific force [m/s2] along the body's axes, as measured.
    noise : ndarray, shape (G, 2)
        Their white noise from each time to the next [rad/sqrt(s), m/s/sqrt(s)].
    earth : ndarray, shape (3,)
        Turn rate of the world itself [rad/s].

    Returns
    -------
    motion : Motion
        On all the times.
    """
    unbiased = inertial - np.concatenate([state.vector[GYRO_BIAS], state.vector[FORCE_BIAS]])
    attitude, track = np.empty((time.size, 3, 3)), np.empty((time.size, 6))
    attitude[0] = state.attitude
    track[0] = state.vector[VELOCITY.start : POSITION.stop]
    transition, covariance = np.eye(N_MOVING), np.zeros((N_MOVING, N_MOVING))
    _mechanise((time, unbiased, noise, earth), attitude, track, (transition, covariance))
    F, Q = np.eye(N_STATES), np.zeros((N_STATES, N_STATES))
    F[:N_MOVING, :N_MOVING], Q[:N_MOVING, :N_MOVING] = transition, 0.5 * (covariance + covariance.T)
    return Motion(attitude, track[:, :3], track[:, 3:], F, Q)


@njit(cache=True)
def _mechanise(measured, attitude, track, errors):  # type: ignore[no-untyped-def]
    """Step through the times; trapezoids for rates and forces, the error's transition to second order."""
    time, inertial, noise, earth = measured
    transition, covariance = errors
    up = np.array([0.0, 0.0, GRAVITY])
    for k in range(time.size - 1):
        dt = time[k + 1] - time[k]
        rate = 0.5 * (inertial[k, :3] + inertial[k + 1, :3])
        R = attitude[k]
        attitude[k + 1] = _exponential(-earth * dt) @ (R @ _exponential(rate * dt))
        half = 0.5 * (R + attitude[k + 1])
        force = 0.5 * (R @ np.ascontiguousarray(inertial[k, 3:]))
        force += 0.5 * (attitude[k + 1] @ np.ascontiguousarray(inertial[k + 1, 3:]))
        acceleration = force - up
        track[k + 1, :3] = track[k, :3] + acceleration * dt
        track[k + 1, 3:] = track[k, 3:] + track[k, :3] * dt + 0.5 * acceleration * dt**2
        lever = 0.5 * (track[k] + track[k + 1])
        A, G = _dynamics(half, lever, earth)
        step = np.eye(15) + dt * A + 0.5 * dt**2 * (A @ A)
        transition[:] = step @ transition
        covariance[:] = step @ covariance @ step.T + noise[k, 0] ** 2 * dt * (G @ G.T)
        for axis in range(3, 6):
            covariance[axis, axis] += noise[k, 1] ** 2 * dt


@njit(cache=True)
def _dynamics(R, lever, earth):  # type: ignore[no-untyped-def]
    """How errors change, and what a turn by the gyro's noise does to them: it swings velocity and position."""
    A, G = np.zeros((15, 15)), np.zeros((15, 3))
    A[:3, :3] = -_cross(earth)
    A[:3, 9:12] = -R
    G[:3] = np.eye(3)
    G[3:6] = _cross(lever[:3])
    G[6:9] = _cross(lever[3:])
    A[3:9] = G[3:9] @ A[:3]
    A[3:6, :3] += _cross(np.array([0.0, 0.0, -GRAVITY]))
    A[3:6, 12:15] = -R
    for axis in range(3):
        A[6 + axis, 3 + axis] += 1.0
    return A, G


@njit(cache=True)
def _cross(a):  # type: ignore[no-untyped-def]
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


@njit(cache=True)
def _exponential(w):  # type: ignore[no-untyped-def]
    """Rodrigues' rotation by a rotation vector."""
    angle = np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
    W = _cross(w)
    if angle < 1e-6:
        return np.eye(3) + W + 0.5 * W @ W
    return np.eye(3) + np.sin(angle) / angle * W + (1.0 - np.cos(angle)) / angle**2 * (W @ W)
