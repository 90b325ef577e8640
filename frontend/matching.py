"""Matching: from the features of two submaps to candidate transforms between them."""

from dataclasses import dataclass

import numba
import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray, IntArray
from frontend.features import Features
from frontend.frames import planar_parameters, planar_pose, transform
from frontend.priors import Prior


class MatchingConfig(BaseModel):
    """What makes feature matches agree."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    tolerance: float = Field(
        default=2.0,
        gt=0,
        description="Horizontal distance within which a match agrees with a transform [m]; two cells of the grid.",
    )
    height_tolerance: float = Field(
        default=1.0,
        gt=0,
        description="The same for the height [m]: long-wave error of a reconstruction, not of the gauge.",
    )
    min_baseline: float = Field(
        default=8.0,
        gt=0,
        description="Least distance of two matches that make a transform [m]: shorter ones leave the yaw open.",
    )
    min_inliers: int = Field(
        default=4, ge=2, description="Agreeing matches [1] that make a candidate; two always agree, chance gives three."
    )
    n_candidates: int = Field(
        default=3, gt=0, description="Distinct candidates handed on [1]; verification is dearer than keeping them all."
    )
    separation: float = Field(
        default=6.0,
        gt=0,
        description="Candidates closer than this [m] and 0.1 rad are the same; about a relief wavelength.",
    )


_SAME_YAW = 0.1  # [rad], see `separation`


@dataclass(frozen=True)
class Candidate:
    """A transform worth verifying.

    Parameters
    ----------
    T_target_source : ndarray, shape (4, 4)
        Level: yaw and shift.
    n_inliers : int
        Feature matches that agree with it.
    """

    T_target_source: FloatArray
    n_inliers: int


def match(
    target: Features, source: Features, prior: Prior | None = None, config: MatchingConfig | None = None
) -> list[Candidate]:
    """Propose transforms between two submaps from their features alone.

    Parameters
    ----------
    target, source : Features
        The features of the two submaps.
    prior : Prior, optional
        Predicted transform with covariance; candidates outside its gate are not made.
    config : MatchingConfig, optional
        Tolerances.

    Returns
    -------
    candidates : list of Candidate
        Distinct transforms, the one with most agreeing matches first; empty where nothing agrees.
    """
    return find_consensus(target, source, mutual_matches(target, source), prior, config)


def mutual_matches(target: Features, source: Features) -> IntArray:
    """Pairs of features that are each other's nearest in descriptor space.

    Parameters
    ----------
    target, source : Features
        The features of the two submaps.

    Returns
    -------
    matches : ndarray of int, shape (M, 2)
        Index of the target's and of the source's feature.
    """
    if not len(target) or not len(source):
        return np.empty((0, 2), dtype=np.int64)
    a, b = (np.ascontiguousarray(f.descriptors, dtype=np.float32) for f in (target, source))
    to_source, to_target = np.zeros(len(a), dtype=np.int64), np.zeros(len(b), dtype=np.int64)
    _nearest(a, np.ascontiguousarray(b.T), to_source, to_target)
    mutual = np.flatnonzero(to_target[to_source] == np.arange(len(target)))
    return np.column_stack([mutual, to_source[mutual]]).astype(np.int64)


def find_consensus(
    target: Features,
    source: Features,
    matches: IntArray,
    prior: Prior | None = None,
    config: MatchingConfig | None = None,
) -> list[Candidate]:
    """Transforms of yaw and shift that many matches agree with.

    Every pair of matches is tried, so the outcome depends on no random number.

    Parameters
    ----------
    target, source : Features
        The features of the two submaps.
    matches : ndarray of int, shape (M, 2)
        Pairs of feature indices.
    prior : Prior, optional
        Predicted transform with covariance.
    config : MatchingConfig, optional
        Tolerances.

    Returns
    -------
    candidates : list of Candidate
        Distinct transforms, each refined on the matches that agree with it.
    """
    config = config or MatchingConfig()
    p, q = target.keypoints[matches[:, 0]], source.keypoints[matches[:, 1]]
    hypotheses = _hypotheses(p, q, prior, config)
    candidates = []
    for x, y, z, yaw in _distinct(_counted(hypotheses, p, q, config), config):
        T = _refined(planar_pose(x, y, yaw, z), p, q, config)
        candidates.append(Candidate(T, int(agreeing(p, q, T, config).sum())))
    kept = [c for c in candidates if c.n_inliers >= config.min_inliers]
    return sorted(kept, key=lambda candidate: -candidate.n_inliers)


def agreeing(
    points_target: FloatArray, points_source: FloatArray, T_target_source: FloatArray, config: MatchingConfig
) -> FloatArray:
    """Which matched points a transform brings together.

    Parameters
    ----------
    points_target, points_source : ndarray, shape (M, 3)
        Matched points [m].
    T_target_source : ndarray, shape (4, 4)
        The transform; its height is not used: the offset of a window's heights says nothing about the place.
    config : MatchingConfig
        Tolerances.

    Returns
    -------
    agrees : ndarray of bool, shape (M,)
        True within both tolerances, heights counted from their median difference.
    """
    error = transform(T_target_source, points_source) - points_target
    near = np.hypot(error[:, 0], error[:, 1]) <= config.tolerance
    offset = np.median(error[near, 2]) if near.any() else 0.0
    return np.asarray(near & (np.abs(error[:, 2] - offset) <= config.height_tolerance))


def _hypotheses(p: FloatArray, q: FloatArray, prior: Prior | None, config: MatchingConfig) -> FloatArray:
    """x, y, z, yaw of every pair of matches with baselines that fit, inside the gate, shape (H, 4)."""
    arguments = (np.ascontiguousarray(p), np.ascontiguousarray(q))
    limits = np.array([config.min_baseline, config.tolerance, config.height_tolerance])
    n = _fit(*arguments, limits, np.empty((0, 4)))
    hypotheses = np.empty((n, 4))
    _fit(*arguments, limits, hypotheses)
    if prior is None or not n:
        return hypotheses
    x, y, _, yaw = hypotheses.T
    return np.asarray(hypotheses[prior.squared_distance(x, y, yaw) <= prior.limit])


def _counted(hypotheses: FloatArray, p: FloatArray, q: FloatArray, config: MatchingConfig) -> FloatArray:
    """The hypotheses with enough agreeing matches, most first, shape (H, 4)."""
    counts = np.zeros(len(hypotheses), dtype=np.int64)
    tolerances = np.array([config.tolerance, config.height_tolerance])
    _count(np.ascontiguousarray(hypotheses), np.ascontiguousarray(p), np.ascontiguousarray(q), tolerances, counts)
    enough = np.flatnonzero(counts >= config.min_inliers)
    return hypotheses[enough[np.argsort(-counts[enough], kind="stable")]]


def _distinct(hypotheses: FloatArray, config: MatchingConfig) -> list[FloatArray]:
    """The first hypotheses that differ from all before them."""
    chosen: list[FloatArray] = []
    while len(hypotheses) and len(chosen) < config.n_candidates:
        best = hypotheses[0]
        chosen.append(best)
        far = np.hypot(hypotheses[:, 0] - best[0], hypotheses[:, 1] - best[1]) > config.separation
        turned = np.abs(np.angle(np.exp(1j * (hypotheses[:, 3] - best[3])))) > _SAME_YAW
        hypotheses = hypotheses[far | turned]
    return chosen


def _refined(T: FloatArray, p: FloatArray, q: FloatArray, config: MatchingConfig) -> FloatArray:
    """Least squares of yaw and shift over the matches that agree (planar Procrustes)."""
    agrees = agreeing(p, q, T, config)
    if agrees.sum() < 2:
        return T
    centre_p, centre_q = p[agrees].mean(axis=0), q[agrees].mean(axis=0)
    a, b = p[agrees] - centre_p, q[agrees] - centre_q
    yaw = float(np.arctan2(np.sum(b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0]), np.sum(b[:, :2] * a[:, :2])))
    turned = transform(planar_pose(0.0, 0.0, yaw), centre_q)
    x, y, z = centre_p - turned
    return planar_pose(float(x), float(y), yaw, float(z)) if _is_near(T, x, y, yaw, config) else T


def _is_near(T: FloatArray, x: float, y: float, yaw: float, config: MatchingConfig) -> bool:
    """Whether a refinement stayed with its hypothesis."""
    x_0, y_0, yaw_0 = planar_parameters(T)
    turn = abs(np.angle(np.exp(1j * (yaw - yaw_0))))
    return bool(np.hypot(x - x_0, y - y_0) <= config.separation and turn <= 2 * _SAME_YAW)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _nearest(a: FloatArray, b: FloatArray, to_b: IntArray, to_a: IntArray) -> None:
    """Column of b nearest to each row of a, and the other way; the first of equals."""
    best = np.full(b.shape[1], np.inf, dtype=np.float32)
    for i in range(a.shape[0]):
        distance = np.zeros(b.shape[1], dtype=np.float32)
        for d in range(a.shape[1]):
            value = a[i, d]
            for j in range(b.shape[1]):
                difference = b[d, j] - value
                distance[j] += difference * difference
        to_b[i] = np.argmin(distance)
        for j in range(b.shape[1]):
            if distance[j] < best[j]:
                best[j], to_a[j] = distance[j], i


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _fit(p: FloatArray, q: FloatArray, limits: FloatArray, out: FloatArray) -> int:
    """Fill in x, y, z, yaw of the pairs of matches with baselines that fit, as far as there is room; their number."""
    n = 0
    for i in range(len(p)):
        for j in range(i + 1, len(p)):
            p_x, p_y, q_x, q_y = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], q[j, 0] - q[i, 0], q[j, 1] - q[i, 1]
            if abs((p[j, 2] - p[i, 2]) - (q[j, 2] - q[i, 2])) > limits[2]:
                continue
            length_p, length_q = np.sqrt(p_x * p_x + p_y * p_y), np.sqrt(q_x * q_x + q_y * q_y)
            if min(length_p, length_q) < limits[0] or abs(length_p - length_q) > limits[1]:
                continue
            if n < len(out):
                yaw = np.arctan2(p_y, p_x) - np.arctan2(q_y, q_x)
                cosine, sine = np.cos(yaw), np.sin(yaw)
                x, y = (q[i, 0] + q[j, 0]) / 2, (q[i, 1] + q[j, 1]) / 2
                out[n, 0] = (p[i, 0] + p[j, 0]) / 2 - cosine * x + sine * y
                out[n, 1] = (p[i, 1] + p[j, 1]) / 2 - sine * x - cosine * y
                out[n, 2], out[n, 3] = ((p[i, 2] + p[j, 2]) - (q[i, 2] + q[j, 2])) / 2, yaw
            n += 1
    return n


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _count(hypotheses: FloatArray, p: FloatArray, q: FloatArray, tolerances: FloatArray, counts: IntArray) -> None:
    """Number of matches within both tolerances of each hypothesis."""
    for h in range(hypotheses.shape[0]):
        x, y, z, yaw = hypotheses[h]
        cosine, sine = np.cos(yaw), np.sin(yaw)
        for k in range(p.shape[0]):
            e_x = x + cosine * q[k, 0] - sine * q[k, 1] - p[k, 0]
            e_y = y + sine * q[k, 0] + cosine * q[k, 1] - p[k, 1]
            e_z = z + q[k, 2] - p[k, 2]
            if e_x * e_x + e_y * e_y <= tolerances[0] ** 2 and abs(e_z) <= tolerances[1]:
                counts[h] += 1
