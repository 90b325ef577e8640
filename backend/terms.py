"""The squares that poses minimise, as arrays: relative poses, and what is known of anchors by themselves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backend.arrays import FloatArray, IntArray
from backend.factors import PositionFix, UnaryKnowledge
from backend.poses import tangent_covariance
from backend.stacks import RelativeStack

WORLD = -1  # in place of a target: the frame in which poses are given


@dataclass(frozen=True)
class RelativeTerms:
    """Squares of relative poses.

    Parameters
    ----------
    ends : ndarray of int, shape (R, 2)
        Target and source; a target may be ``WORLD``.
    T_target_source : ndarray, shape (R, 4, 4)
        As measured.
    roots : ndarray, shape (R, 6, 6)
        Square roots ``A`` of the information ``A.T @ A``, in the tangent.
    weights : ndarray, shape (R,)
        Of each square [1].
    """

    ends: IntArray
    T_target_source: FloatArray
    roots: FloatArray
    weights: FloatArray

    def __len__(self) -> int:
        return len(self.ends)

    def __getitem__(self, chosen: IntArray) -> "RelativeTerms":
        return RelativeTerms(self.ends[chosen], self.T_target_source[chosen], self.roots[chosen], self.weights[chosen])

    def weighted(self, weight: float) -> "RelativeTerms":
        """Weigh all alike.

        Parameters
        ----------
        weight : float
            Of each square [1].

        Returns
        -------
        terms : RelativeTerms
            The same but for that.
        """
        return replace(self, weights=np.full(len(self), weight))


@dataclass(frozen=True)
class UnaryTerms:
    """Squares of what is known of anchors by themselves.

    Parameters
    ----------
    place_anchor : ndarray of int, shape (P,)
        Anchors whose position is known, or a part of it.
    position : ndarray, shape (P, 3)
        The position in the world [m].
    precision : ndarray, shape (P, 3)
        Inverse variances of it [1/m**2].
    tilt_anchor : ndarray of int, shape (Q,)
        Anchors whose roll and pitch are known.
    up : ndarray, shape (Q, 3)
        Which way is up, in the body.
    tilt_precision : ndarray, shape (Q,)
        Inverse variances of that [1/rad**2].
    """

    place_anchor: IntArray
    position: FloatArray
    precision: FloatArray
    tilt_anchor: IntArray
    up: FloatArray
    tilt_precision: FloatArray


def relative_terms(measured: RelativeStack) -> RelativeTerms:
    """Squares of relative poses, each of weight one.

    Parameters
    ----------
    measured : RelativeStack
        The measurements, R of them.

    Returns
    -------
    terms : RelativeTerms
        In the same order.
    """
    ends = np.stack([measured.target, measured.source], axis=1)
    covariance = tangent_covariance(measured.T_target_source, measured.covariance)
    upper = np.linalg.cholesky(covariance[:, ::-1, ::-1])[:, ::-1, ::-1]  # covariance is upper @ upper.T
    roots = np.ascontiguousarray(np.linalg.inv(upper))
    return RelativeTerms(ends, np.ascontiguousarray(measured.T_target_source), roots, np.ones(len(ends)))


def first_term(T_world_anchor: FloatArray, sigmas: FloatArray) -> RelativeTerms:
    """The square that holds anchor 0 where it is.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (4, 4)
        Pose of the first anchor.
    sigmas : ndarray, shape (6,)
        Standard deviations along the world's axes [rad, rad, rad, m, m, m].

    Returns
    -------
    terms : RelativeTerms
        One.
    """
    world, zero = np.array([WORLD], dtype=np.int64), np.zeros(1, dtype=np.int64)
    return relative_terms(RelativeStack(world, zero, T_world_anchor[None], np.diag(sigmas**2)[None]))


def joined(parts: Sequence[RelativeTerms]) -> RelativeTerms:
    """Several sets of squares one after the other.

    Parameters
    ----------
    parts : sequence of RelativeTerms
        The sets, at least one.

    Returns
    -------
    terms : RelativeTerms
        All of them.
    """
    names = ("ends", "T_target_source", "roots", "weights")
    return RelativeTerms(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def unary_terms(
    T_world_anchor: FloatArray, unary: Sequence[UnaryKnowledge], fixes: Sequence[PositionFix]
) -> UnaryTerms:
    """Squares of depths, tilts and fixes.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (S, 4, 4)
        Poses with the depths, rolls and pitches as measured.
    unary : sequence of UnaryKnowledge
        How well these are known.
    fixes : sequence of PositionFix
        Positions that a satellite receiver gave; height stays free.

    Returns
    -------
    terms : UnaryTerms
        The depths and then the fixes; the tilts.
    """
    anchor: IntArray = np.array([known.anchor for known in unary], dtype=np.int64)
    fixed: IntArray = np.array([fix.anchor for fix in fixes], dtype=np.int64)
    depth_sd, tilt_sd = np.array([[known.depth_sd, known.tilt_sd] for known in unary]).reshape(-1, 2).T
    seen = np.array([[fix.east, fix.north, fix.sigma] for fix in fixes]).reshape(-1, 3)
    position, precision = np.zeros((len(anchor) + len(fixed), 3)), np.zeros((len(anchor) + len(fixed), 3))
    position[: len(anchor), 2], precision[: len(anchor), 2] = T_world_anchor[anchor, 2, 3], depth_sd**-2
    position[len(anchor) :, :2], precision[len(anchor) :, :2] = seen[:, :2], seen[:, 2:] ** -2
    up = np.ascontiguousarray(T_world_anchor[anchor, 2, :3])
    return UnaryTerms(np.concatenate([anchor, fixed]), position, precision, anchor, up, tilt_sd**-2)
