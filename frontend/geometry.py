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


def first_ray_angle(roll: ArrayLike, inner_angle: float) -> FloatArray:
    """Angle from the vertical, in the beam plane, of the first ray of each side that meets the floor only once.

    Parameters
    ----------
    roll : array_like, shape (N,)
        Roll, starboard down [rad].
    inner_angle : float
        Inner edge of the beams off the body's nadir [rad].

    Returns
    -------
    angle : ndarray, shape (N, 2)
        Port and starboard [rad], not negative.

    Notes
    -----
    ``|gamma + roll|`` on port and ``|gamma - roll|`` on starboard. On the side that a roll turns inward past nadir
    the echoes of ``|angle|`` to either side of nadir fall on one another (layover); what lies beyond is single. These
    are the angles phi and phi' of [1]_ less 90 degrees, both cases of phi' in one formula.

    References
    ----------
    .. [1] Woock, "Deep-Sea Seafloor Shape Reconstruction from Side-Scan Sonar Data for AUV Navigation", OCEANS 2011.

    Examples
    --------
    >>> first_ray_angle([0.1], inner_angle=0.25).round(2)
    array([[0.35, 0.15]])
    """
    roll = np.atleast_1d(np.asarray(roll, dtype=np.float64))
    return np.abs(np.stack([inner_angle + roll, inner_angle - roll], axis=1))


def first_usable_return(altitude: ArrayLike, attitude: tuple[ArrayLike, ArrayLike], inner_angle: float) -> FloatArray:
    """Slant range of the first ray of each side that meets a flat floor only once.

    Parameters
    ----------
    altitude : array_like, shape (N,)
        Height of the transducer above the seafloor [m].
    attitude : tuple of array_like, shapes (N,)
        Roll (starboard down) and pitch (nose down) [rad].
    inner_angle : float
        Inner edge of the beams off the body's nadir [rad].

    Returns
    -------
    first_return : ndarray, shape (N, 2)
        b of each side [m]: ``altitude / (cos(pitch) cos(angle))`` with the angle of `first_ray_angle`. It is where the
        layover ends on a side that sees past nadir, and the first bottom return on one that does not.
    """
    roll, pitch = attitude
    perpendicular = np.atleast_1d(np.asarray(altitude, dtype=np.float64)) / np.cos(pitch)
    return perpendicular[:, None] / np.cos(first_ray_angle(roll, inner_angle))


def extended_ground_range(
    slant_range: ArrayLike, first_return: ArrayLike, roll: ArrayLike, inner_angle: float
) -> FloatArray:
    """Ground range of echoes when all that is known of the altitude is the first usable return of each side.

    Parameters
    ----------
    slant_range : array_like, shape (M,) or (N, M)
        Distance from transducer to echo [m].
    first_return : array_like, shape (N, 2)
        Slant range of the first ray that meets the floor only once, port and starboard [m].
    roll : array_like, shape (N,)
        Roll, starboard down [rad].
    inner_angle : float
        Inner edge of the beams off the body's nadir [rad].

    Returns
    -------
    ground_range : ndarray, shape (N, 2, M)
        Across-track distance from nadir [m]; NaN before the first return: water column or layover.

    Raises
    ------
    ValueError
        If a first return is not positive.

    Notes
    -----
    Equation 4 of [1]_, ``r_g = b cos(phi) + sqrt(r_s**2 - b**2 sin(phi)**2)``, plus ``b sin(angle)`` from nadir to
    the foot that r_g is counted from. Each side has its own b, and b holds the pitch. Holds for a flat, level floor.

    References
    ----------
    .. [1] Woock, "Deep-Sea Seafloor Shape Reconstruction from Side-Scan Sonar Data for AUV Navigation", OCEANS 2011.
    """
    b = np.asarray(first_return, dtype=np.float64)
    if not np.all(b > 0):
        raise ValueError(f"first return must be positive, got {np.min(b)} m")
    angle = first_ray_angle(roll, inner_angle)
    phi = np.pi / 2 + angle
    slant = np.atleast_2d(np.asarray(slant_range, dtype=np.float64))[:, None, :]
    square = slant**2 - ((b * np.sin(phi)) ** 2)[..., None]
    ground_range = (b * (np.sin(angle) + np.cos(phi)))[..., None] + np.sqrt(np.maximum(square, 0.0))
    return np.where(slant >= b[..., None], ground_range, np.nan)


def altitude_from_first_return(
    first_return: ArrayLike, attitude: tuple[ArrayLike, ArrayLike], inner_angle: float
) -> FloatArray:
    """Altitude that goes with the first usable return of each side.

    Parameters
    ----------
    first_return : array_like, shape (N, 2)
        Slant range of the first ray that meets the floor only once, port and starboard [m].
    attitude : tuple of array_like, shapes (N,)
        Roll (starboard down) and pitch (nose down) [rad].
    inner_angle : float
        Inner edge of the beams off the body's nadir [rad].

    Returns
    -------
    altitude : ndarray, shape (N, 2)
        Height of the transducer above the floor [m].

    Notes
    -----
    Equation 1 of [1]_, ``h = f cos(pitch)``, with ``f = b cos(angle)``; the ensonified strip lies
    ``f sin(pitch)`` behind the vehicle when the nose is down (equation 2). Holds for a flat, level floor.

    References
    ----------
    .. [1] Woock, "Deep-Sea Seafloor Shape Reconstruction from Side-Scan Sonar Data for AUV Navigation", OCEANS 2011.
    """
    roll, pitch = attitude
    f = np.asarray(first_return, dtype=np.float64) * np.cos(first_ray_angle(roll, inner_angle))
    return f * np.cos(np.atleast_1d(np.asarray(pitch, dtype=np.float64)))[:, None]
