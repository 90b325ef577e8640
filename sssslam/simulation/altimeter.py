"""The altitude a DVL reports: four slanted beams against the seafloor."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import rotation_world_body
from frontend.heightfield import Heightfield
from frontend.trajectory import Trajectory

_JANUS = np.radians(30.0)
_BEAMS_BODY = np.stack(
    [
        np.array([np.sin(_JANUS) * np.cos(azimuth), np.sin(_JANUS) * np.sin(azimuth), -np.cos(_JANUS)])
        for azimuth in np.radians([45.0, 135.0, 225.0, 315.0])
    ]
)


def beam_ranges(trajectory: Trajectory, floor: Heightfield) -> FloatArray:
    """Range along each of the four beams of a DVL to the seafloor.

    Parameters
    ----------
    trajectory : Trajectory
        True body poses.
    floor : Heightfield
        The seafloor.

    Returns
    -------
    ranges : ndarray, shape (N, 4)
        Distance along the beams, 30 degrees off the body's vertical [m]; NaN where a beam meets no floor.
    """
    rotation = rotation_world_body(trajectory.roll, trajectory.pitch, trajectory.yaw)
    direction = np.einsum("nij,bj->nbi", rotation, _BEAMS_BODY)
    start = trajectory.positions[:, None, :]
    ranges = (start[..., 2] - floor.sample(trajectory.x, trajectory.y)[:, None]) / -direction[..., 2]
    for _ in range(20):
        point = start + ranges[..., None] * direction
        excess = point[..., 2] - floor.sample(point[..., 0], point[..., 1])
        # Half a step: slopes up to the steepness of the beam itself converge.
        ranges = ranges + 0.7 * excess / -direction[..., 2]
    return np.where(np.abs(excess) < 0.05, ranges, np.nan)


def measured_altitude(ranges: FloatArray, noise: float, rng: np.random.Generator) -> FloatArray:
    """Altitude from the four ranges of a DVL, as its firmware gives it.

    Parameters
    ----------
    ranges : ndarray, shape (N, 4)
        Ranges along the beams [m]; NaN without a bottom.
    noise : float
        Standard deviation of a range's white noise [m].
    rng : Generator
        Source of the noise.

    Returns
    -------
    altitude : ndarray, shape (N,)
        Mean vertical part of the ranges of a level vehicle [m]; NaN where fewer than three beams have a bottom.
    """
    noisy = (ranges + noise * rng.standard_normal(ranges.shape)) * np.cos(_JANUS)
    locked = np.isfinite(noisy)
    n_locked = locked.sum(axis=-1)
    total = np.where(locked, noisy, 0.0).sum(axis=-1)
    return np.where(n_locked >= 3, total / np.maximum(n_locked, 1), np.nan)
