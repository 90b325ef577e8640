"""Spread the correction of the anchors over every ping between them."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from backend.arrays import BoolArray, FloatArray, IntArray
from backend.dead_reckoning import DeadReckoning
from backend.poses import as_poses

_Sides = tuple[IntArray, IntArray, FloatArray]  # anchors before and after each ping, weight of the one after
_Correction = tuple[FloatArray, FloatArray, FloatArray]  # shift (S, 3), yaw (S,) and tilt (S, 3) of each anchor


def spread_correction(
    time: ArrayLike, T_world_body_dr: ArrayLike, anchor_pings: ArrayLike, T_world_anchor: ArrayLike
) -> FloatArray:
    """Correct every ping by what the pose graph found for the anchors around it.

    Parameters
    ----------
    time : array_like, shape (N,)
        Time of the pings [s], strictly increasing.
    T_world_body_dr : array_like, shape (N, 4, 4)
        Dead-reckoned body poses.
    anchor_pings : array_like of int, shape (S,)
        Pings of the anchors, strictly increasing.
    T_world_anchor : array_like, shape (S, 4, 4)
        Corrected body poses of the anchors.

    Returns
    -------
    T_world_body : ndarray, shape (N, 4, 4)
        Corrected poses: the anchors' own at the anchors; where no anchor moved, bit for bit what was given.

    Raises
    ------
    ValueError
        If times, poses and anchors do not fit each other.

    Notes
    -----
    Each anchor carries the dead-reckoned track around it as a rigid piece, turned about the vertical, and two
    neighbouring pieces are blended by a weight whose first and second derivatives vanish at the anchors: position,
    velocity and acceleration are continuous. Before the first and after the last anchor that anchor's piece goes on.
    Depth, roll and pitch keep what was measured but for the anchors' small changes of them.
    """
    T_dr, anchors = as_poses(T_world_body_dr, "T_world_body_dr"), as_poses(T_world_anchor, "T_world_anchor")
    time = np.asarray(time, dtype=np.float64)
    if time.shape != (len(T_dr),):
        raise ValueError(f"one time a pose is wanted, got {time.shape} times and {len(T_dr)} poses")
    pings = _check_pings(anchor_pings, len(T_dr), len(anchors))
    sides = _neighbours(time, pings)
    correction = _anchor_corrections(T_dr[pings], anchors)
    T = np.where(_is_changed(correction, sides)[:, None, None], _corrected(T_dr, pings, correction, sides), T_dr)
    T[pings] = anchors
    return T


def spread_sigmas(dead_reckoning: DeadReckoning, anchor_pings: ArrayLike, anchor_sigmas: ArrayLike) -> FloatArray:
    """Standard deviations of every ping from those of the anchors.

    Parameters
    ----------
    dead_reckoning : DeadReckoning
        The uncertainty of the track between the anchors.
    anchor_pings : array_like of int, shape (S,)
        Pings of the anchors, strictly increasing.
    anchor_sigmas : array_like, shape (S, 4)
        Standard deviations of the anchors' x, y, z [m] and yaw [rad].

    Returns
    -------
    sigmas : ndarray, shape (N, 4)
        Of x, y, z [m] and yaw [rad] at every ping.

    Raises
    ------
    ValueError
        If the anchors are not pings of the track or not one row of sigmas an anchor is given.

    Notes
    -----
    Beyond the first and the last anchor dead reckoning adds its growth, and the anchor's heading error its lever arm.
    Between two anchors variances go over linearly, which is right for pure dead reckoning; where the anchors know more
    than dead reckoning from one to the other, the dead-reckoned bridge between them is added. Nowhere is it more than
    what dead reckoning from either of the two anchors gives.

    The pose graph takes velocity errors for independent from anchor to anchor. What is constant of them stretches and
    turns the whole track about the first anchor and no closure sees it: it is added everywhere.
    """
    sigmas = np.asarray(anchor_sigmas, dtype=np.float64)
    pings = _check_pings(anchor_pings, dead_reckoning.n_pings, len(sigmas))
    left, right, _ = _neighbours(dead_reckoning.time, pings)
    variance = sigmas**2
    forward = _predicted(dead_reckoning, pings[left], variance[left])
    backward = _predicted(dead_reckoning, pings[right], variance[right])
    between = _bridged(dead_reckoning, (pings[left], pings[right]), (variance[left], variance[right]))
    inside = np.minimum(between, np.minimum(forward, backward))
    unseen = dead_reckoning.unseen_variances(int(pings[0]))
    return np.sqrt(np.where((left == right)[:, None], forward, inside) + unseen)


def _predicted(dead_reckoning: DeadReckoning, anchor: IntArray, variance: FloatArray) -> FloatArray:
    """Variances of every ping by dead reckoning from an anchor each."""
    predicted = variance + dead_reckoning.drift_variances(anchor, np.arange(len(anchor)))
    arm = dead_reckoning.positions - dead_reckoning.positions[anchor]
    predicted[:, :2] += arm[:, 1::-1] ** 2 * variance[:, 3:]
    return predicted


def _bridged(
    dead_reckoning: DeadReckoning, anchors: tuple[IntArray, IntArray], variances: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Variances of every ping between two anchors each."""
    ping, (left, right) = np.arange(len(anchors[0])), variances
    from_left, from_right = (dead_reckoning.drift_variances(anchor, ping) for anchor in anchors)
    total = from_left + from_right
    share = np.divide(from_left, total, out=np.zeros_like(total), where=total > 0)
    unexplained = np.clip(dead_reckoning.drift_variances(*anchors) - np.abs(right - left), 0.0, None)
    return np.asarray(left + share * (right - left) + share * (1.0 - share) * unexplained)


def _check_pings(anchor_pings: ArrayLike, n_pings: int, n_anchors: int) -> IntArray:
    """Refuse anchors that are not pings of the track, in order."""
    pings = np.asarray(anchor_pings)
    if pings.shape != (n_anchors,) or n_anchors == 0:
        raise ValueError(f"one ping an anchor is wanted, got pings of shape {pings.shape} for {n_anchors} anchors")
    if np.any(np.diff(pings) <= 0) or pings[0] < 0 or pings[-1] >= n_pings:
        raise ValueError(f"anchor pings must increase strictly within 0..{n_pings - 1}, got {pings[0]}..{pings[-1]}")
    return pings.astype(np.int64)


def _neighbours(time: FloatArray, pings: IntArray) -> _Sides:
    """The anchors before and after each ping, the same one beyond the ends, and the weight of the one after."""
    after = np.searchsorted(pings, np.arange(len(time)), side="right")
    left, right = np.clip(after - 1, 0, None), np.clip(after, None, len(pings) - 1)
    duration = time[pings[right]] - time[pings[left]]
    share = np.divide(time - time[pings[left]], duration, out=np.zeros(len(time)), where=duration > 0)
    return left, right, share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def _anchor_corrections(T_dr: FloatArray, T: FloatArray) -> _Correction:
    """Shift, turn about the vertical and remaining tilt of each anchor; exactly zero where it did not move."""
    shift = T[:, :3, 3] - T_dr[:, :3, 3]
    turn = np.arctan2(T[:, 1, 0], T[:, 0, 0]) - np.arctan2(T_dr[:, 1, 0], T_dr[:, 0, 0])
    is_same = (T[:, :3, :3] == T_dr[:, :3, :3]).all(axis=(1, 2))
    yaw = np.unwrap(np.where(is_same, 0.0, (turn + np.pi) % (2.0 * np.pi) - np.pi))
    rest = Rotation.from_matrix(T[:, :3, :3]) * (_about_vertical(yaw) * Rotation.from_matrix(T_dr[:, :3, :3])).inv()
    return shift, yaw, np.where(is_same[:, None], 0.0, rest.as_rotvec())


def _is_changed(correction: _Correction, sides: _Sides) -> BoolArray:
    """Whether any of the two anchors of each ping moved."""
    shift, yaw, tilt = correction
    is_moved = (shift != 0).any(axis=1) | (yaw != 0) | (tilt != 0).any(axis=1)
    return np.asarray(is_moved[sides[0]] | is_moved[sides[1]])


def _corrected(T_dr: FloatArray, pings: IntArray, correction: _Correction, sides: _Sides) -> FloatArray:
    """Every ping between the rigid pieces of its two anchors."""
    shift, yaw, tilt = correction
    left, right, weight = sides
    by_left, by_right = (_moved(T_dr, pings[side], shift[side], yaw[side]) for side in (left, right))
    turn = Rotation.from_rotvec(_blend(tilt, sides)) * _about_vertical(_blend(yaw, sides))
    T = T_dr.copy()
    T[:, :3, 3] += by_left + weight[:, None] * (by_right - by_left)
    T[:, :3, :3] = turn.as_matrix() @ T_dr[:, :3, :3]
    return T


def _moved(T_dr: FloatArray, anchor: IntArray, shift: FloatArray, yaw: FloatArray) -> FloatArray:
    """How far each ping moves with the rigid piece of its anchor."""
    arm = T_dr[:, :3, 3] - T_dr[anchor, :3, 3]
    cos, sin = np.cos(yaw) - 1.0, np.sin(yaw)
    swing = [cos * arm[:, 0] - sin * arm[:, 1], sin * arm[:, 0] + cos * arm[:, 1], np.zeros_like(yaw)]
    return shift + np.stack(swing, axis=1)


def _about_vertical(yaw: FloatArray) -> Rotation:
    """Turns about the world's vertical."""
    return Rotation.from_rotvec(np.multiply.outer(yaw, [0.0, 0.0, 1.0]))


def _blend(values: FloatArray, sides: _Sides) -> FloatArray:
    """Go over from the value of the anchor before to that of the anchor after."""
    left, right, weight = sides
    weight = weight.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[left] + weight * (values[right] - values[left]))
