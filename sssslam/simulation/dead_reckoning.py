"""The track a vehicle reckons on board: its own sensors' velocity along its own heading, integrated."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import rotation_world_body, wrap_angle
from frontend.trajectory import Trajectory
from sssslam.simulation.sensors import Series


def dead_reckon(sensors: dict[str, Series], time: FloatArray, start: tuple[float, float]) -> Trajectory:
    """Integrate what the sensors say.

    Parameters
    ----------
    sensors : dict of str to dict of str to ndarray
        Series of compass or directional_gyro, depth, and dvl or speed_log, as `sensors.sense` gives them.
    time : ndarray, shape (N,)
        When the track is wanted [s].
    start : tuple of float
        x and y at time 0 [m]: the last fix.

    Returns
    -------
    trajectory_dr : Trajectory
        The dead-reckoned track. Without bottom lock the last velocity is kept.
    """
    ticks, velocity = _body_velocity(sensors)
    edges = np.concatenate([[0.0], ticks])
    attitude = sensors["compass" if "compass" in sensors else "directional_gyro"]
    roll, pitch, yaw = _attitude(attitude, 0.5 * (edges[1:] + edges[:-1]))
    step = (rotation_world_body(roll, pitch, yaw) @ velocity[..., None])[..., 0] * np.diff(edges)[:, None]
    track = np.concatenate([[start], start + np.cumsum(step[:, :2], axis=0)])
    x, y = (np.interp(time, edges, axis) for axis in track.T)
    depth = np.interp(time, sensors["depth"]["time"], sensors["depth"]["depth"])
    roll, pitch, yaw = _attitude(attitude, time)
    return Trajectory(time, x, y, -depth, roll, pitch, wrap_angle(yaw))


def _attitude(series: Series, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    roll, pitch, yaw = (np.interp(time, series["time"], np.unwrap(series[n])) for n in ("roll", "pitch", "yaw"))
    return roll, pitch, yaw


def _body_velocity(sensors: dict[str, Series]) -> tuple[FloatArray, FloatArray]:
    if "dvl" not in sensors:
        speed = sensors["speed_log"]["speed"]
        return sensors["speed_log"]["time"], np.stack([speed, 0 * speed, 0 * speed], axis=-1)
    dvl = sensors["dvl"]
    velocity = np.stack([dvl[f"velocity_{axis}"] for axis in "xyz"], axis=-1)
    locked = np.isfinite(velocity[:, 0])
    if not locked.any():
        raise ValueError("the DVL never sees the bottom: a longer dvl_range_max or a lower altitude is wanted")
    last = np.maximum.accumulate(np.where(locked, np.arange(locked.size), int(np.argmax(locked))))
    return dvl["time"], velocity[last]
