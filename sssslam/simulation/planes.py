"""The beam plane of an array at each ping: where it is, how it is turned and how it moves."""

from typing import NamedTuple

import numpy as np

from frontend.arrays import AnyArray, FloatArray
from frontend.frames import rotation_world_body
from frontend.trajectory import Trajectory

_FIELDS = (
    *("x", "y", "z", "forward_x", "forward_y", "forward_z", "out_x", "out_y", "down_x", "down_y", "down_z"),
    *("roll", "speed_forward", "speed_out", "speed_down", "turn_out", "turn_down", "roll_rate"),
)
PLANE = np.dtype([(name, np.float64) for name in _FIELDS])


class Rates(NamedTuple):
    """Velocity [m/s] and angular rate [rad/s] of the body in the world frame, each (N, 3)."""

    velocity: FloatArray
    angular_rate: FloatArray


class Mounting(NamedTuple):
    """An array on the body: place, forward-port-up [m]; 1 for port or -1 for starboard; turned forward [rad]."""

    lever_arm: tuple[float, float, float]
    side: float
    squint: float = 0.0


def at_rest(n: int) -> Rates:
    """Rates of a vehicle that stops for each ping and hops to the next.

    Parameters
    ----------
    n : int
        Number of pings.

    Returns
    -------
    rates : Rates
        Zeros.
    """
    return Rates(np.zeros((n, 3)), np.zeros((n, 3)))


def beam_planes(trajectory: Trajectory, rates: Rates, mounting: Mounting) -> AnyArray:
    """Place the beam plane of one array.

    Parameters
    ----------
    trajectory : Trajectory
        True body poses at the pings.
    rates : Rates
        Their motion between transmission and reception.
    mounting : Mounting
        The array on the body.

    Returns
    -------
    planes : structured ndarray, shape (N,)
        Position of the array, world axes of its plane (forward, out, down), the angle ``roll`` from the body's
        downward axis to the plane's (added to an angle in the plane it gives the one off the body's nadir), and the
        array's motion along these axes.
    """
    side, body = mounting.side, rotation_world_body(trajectory.roll, trajectory.pitch, trajectory.yaw)
    arm, rotation = body @ np.asarray(mounting.lever_arm), body @ rotation_world_body(0, 0, -side * mounting.squint)
    velocity = rates.velocity + np.cross(rates.angular_rate, arm)
    forward = rotation[:, :, 0]
    out = side * np.stack([-forward[:, 1], forward[:, 0], np.zeros(len(forward))], axis=-1)
    out /= np.linalg.norm(out, axis=-1, keepdims=True)
    down = -side * np.cross(forward, out)
    turn = np.cross(rates.angular_rate, forward)
    columns = {
        **dict(zip("xyz", (trajectory.positions + arm).T, strict=True)),
        **dict(zip(("forward_x", "forward_y", "forward_z"), forward.T, strict=True)),
        **dict(zip(("out_x", "out_y"), out.T[:2], strict=True)),
        **dict(zip(("down_x", "down_y", "down_z"), down.T, strict=True)),
        "roll": np.arctan2(_dot(down, side * rotation[:, :, 1]), _dot(down, -rotation[:, :, 2])),
        "speed_forward": _dot(velocity, forward),
        "speed_out": _dot(velocity, out),
        "speed_down": _dot(velocity, down),
        "turn_out": _dot(turn, out),
        "turn_down": _dot(turn, down),
        "roll_rate": -side * _dot(rates.angular_rate, forward),
    }
    planes = np.recarray(len(forward), dtype=PLANE)
    for name in _FIELDS:
        planes[name] = columns[name]
    return planes


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray((a * b).sum(axis=-1))
