"""Shortest paths of bounded curvature between two poses in the plane (Dubins 1957)."""

import numpy as np

from frontend.arrays import FloatArray

_WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")
_TURN = {"L": 1.0, "S": 0.0, "R": -1.0}
Pose2 = tuple[float, float, float]


def dubins_path(start: Pose2, end: Pose2, radius: float, step: float) -> FloatArray:
    """Sample the shortest path of bounded curvature from one pose to another.

    Parameters
    ----------
    start, end : tuple of float
        x [m], y [m] and yaw [rad].
    radius : float
        Smallest radius of a turn [m].
    step : float
        Largest distance between samples [m].

    Returns
    -------
    points : ndarray, shape (K, 2)
        The path, both ends included [m].
    """
    word, lengths = _shortest(start, end, radius)
    pieces, pose = [np.array([start[:2]])], start
    for letter, length in zip(word, lengths, strict=True):
        distance = np.linspace(0.0, length * radius, max(2, int(np.ceil(length * radius / step)) + 1))[1:]
        points, pose = _advance(pose, _TURN[letter] / radius, distance)
        pieces.append(points)
    return np.concatenate(pieces)


def _advance(pose: Pose2, curvature: float, distance: FloatArray) -> tuple[FloatArray, Pose2]:
    x, y, yaw = pose
    half = 0.5 * curvature * distance
    chord = distance * np.sinc(half / np.pi)
    points = np.stack([x + chord * np.cos(yaw + half), y + chord * np.sin(yaw + half)], axis=-1)
    return points, (float(points[-1, 0]), float(points[-1, 1]), float(yaw + curvature * distance[-1]))


def _shortest(start: Pose2, end: Pose2, radius: float) -> tuple[str, tuple[float, float, float]]:
    dx, dy = (end[0] - start[0]) / radius, (end[1] - start[1]) / radius
    bearing, d = np.arctan2(dy, dx), float(np.hypot(dx, dy))
    a, b = (float((yaw - bearing) % (2 * np.pi)) for yaw in (start[2], end[2]))
    found = [(word, lengths) for word in _WORDS if (lengths := _word_lengths(word, a, b, d)) is not None]
    return min(found, key=lambda path: sum(path[1]))


def _word_lengths(word: str, a: float, b: float, d: float) -> tuple[float, float, float] | None:
    """Lengths [radii] of the three pieces where the goal lies d along x; None where there is no such path."""
    first, last = _TURN[word[0]], _TURN[word[2]]
    # Centres of the first and last circle, one radius to the side of the ends.
    x = d - last * np.sin(b) + first * np.sin(a)
    y = last * np.cos(b) - first * np.cos(a)
    between, bearing = float(np.hypot(x, y)), float(np.arctan2(y, x))
    if word[1] == "S":
        return _straight(first, last, (a, b), between, bearing)
    return None if between > 4.0 else _three_turns(first, (a, b), between, bearing)


def _straight(
    first: float, last: float, yaws: tuple[float, float], between: float, bearing: float
) -> tuple[float, float, float] | None:
    if first == last:
        yaw, length = bearing, between
    elif between < 2.0:
        return None
    else:
        length = float(np.sqrt(between**2 - 4.0))
        yaw = bearing + first * float(np.arctan2(2.0, length))
    return _turned(first, yaws[0], yaw), length, _turned(last, yaw, yaws[1])


def _three_turns(first: float, yaws: tuple[float, float], between: float, bearing: float) -> tuple[float, float, float]:
    opening = float(np.arccos(between / 4.0))
    middle_in = bearing + first * (0.5 * np.pi + opening)
    middle_out = bearing - first * (0.5 * np.pi + opening) + first * 2 * np.pi
    return (
        _turned(first, yaws[0], middle_in),
        _turned(-first, middle_in, middle_out),
        _turned(first, middle_out, yaws[1]),
    )


def _turned(turn: float, yaw_from: float, yaw_to: float) -> float:
    angle = float((turn * (yaw_to - yaw_from)) % (2 * np.pi))
    return 0.0 if angle > 2 * np.pi - 1e-9 else angle
