"""Slant range to seafloor: transducers in the world, and the flat-floor relations under any attitude."""

import numpy as np
from numpy.typing import ArrayLike

from frontend.arrays import FloatArray
from frontend.recording import SonarGeometry

PORT, STARBOARD = 0, 1


def transducer_positions(T_world_body: ArrayLike, sonar: SonarGeometry) -> FloatArray:
    """Positions of the two transducers.

    Parameters
    ----------
    T_world_body : array_like, shape (N, 4, 4)
        Body poses.
    sonar : SonarGeometry
        Its lever arms are used.

    Returns
    -------
    positions_world : ndarray, shape (N, 2, 3)
        Port and starboard transducer [m].
    """
    T = np.asarray(T_world_body, dtype=np.float64)
    arms = np.array([sonar.lever_arm_port, sonar.lever_arm_starboard])
    return np.asarray(np.einsum("nij,sj->nsi", T[:, :3, :3], arms) + T[:, None, :3, 3])


def slant_to_ground_range(slant_range: ArrayLike, altitude: ArrayLike, pitch: ArrayLike = 0.0) -> FloatArray:
    """Project slant ranges onto a flat, level seafloor.

    Parameters
    ----------
    slant_range : array_like, shape (M,) or (N, M)
        Distance from transducer to echo [m].
    altitude : array_like, shape (N,)
        Height of the transducer above the seafloor at each ping [m].
    pitch : array_like, shape (N,) or scalar
        Pitch of the body at each ping [rad]; the beam plane meets the floor at ``altitude / cos(pitch)``.

    Returns
    -------
    ground_range : ndarray, shape (N, M)
        Horizontal across-track distance from nadir [m]; NaN in the water column.

    Raises
    ------
    ValueError
        If an altitude is not positive.

    Notes
    -----
    ``ground_range = sqrt(slant_range**2 - (altitude / cos(pitch))**2)``. Roll does not move an echo of a given slant
    range. Holds for a flat, level seafloor and one sound speed.

    Examples
    --------
    >>> slant_to_ground_range([2.0, 5.0], altitude=[3.0])
    array([[nan,  4.]])
    """
    altitude = np.atleast_1d(np.asarray(altitude, dtype=np.float64))
    if not np.all(altitude > 0):
        raise ValueError(f"altitude must be positive, got {np.min(altitude)} m")
    perpendicular = (altitude / np.cos(pitch))[:, None]
    square = np.atleast_2d(np.asarray(slant_range, dtype=np.float64)) ** 2 - perpendicular**2
    return np.sqrt(np.where(square >= 0, square, np.nan))


def off_nadir_angle(slant_range: ArrayLike, altitude: ArrayLike, attitude: tuple[ArrayLike, ArrayLike]) -> FloatArray:
    """Angle from the body's nadir, in the beam plane, of flat-floor echoes on each side.

    Parameters
    ----------
    slant_range : array_like, shape (M,) or (N, M)
        Distance from transducer to echo [m].
    altitude : array_like, shape (N,)
        Height of the transducer above the seafloor [m].
    attitude : tuple of array_like, shapes (N,)
        Roll (starboard down) and pitch of the body [rad].

    Returns
    -------
    angle : ndarray, shape (N, 2, M)
        Port and starboard angles [rad], positive outwards; NaN in the water column.

    Notes
    -----
    ``slant_range = altitude / (cos(pitch) cos(t))`` with t measured from the vertical in the beam plane; a
    starboard-down roll turns the body's nadir towards port, so it is
    ``t - roll`` on port and ``t + roll`` on starboard.
    """
    roll, pitch = (np.asarray(a, dtype=np.float64) for a in attitude)
    perpendicular = (np.asarray(altitude, dtype=np.float64) / np.cos(pitch))[:, None]
    ratio = perpendicular / np.atleast_2d(np.asarray(slant_range, dtype=np.float64))
    t = np.arccos(np.where(ratio <= 1, ratio, np.nan))
    return np.stack([t - roll[:, None], t + roll[:, None]], axis=1)
