"""GTSAM's factors of a graph of anchors: the first pose, odometry, depth, roll and pitch, loop closures."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import gtsam
import numpy as np

from backend.arrays import FloatArray
from backend.poses import RelativePose, tangent_covariance

_UP = np.array([0.0, 0.0, 1.0])
_FREE = 1e6  # sigma of what a depth does not tell [m]


@dataclass(frozen=True)
class UnaryKnowledge:
    """What the sensors know of one anchor by itself: depth, roll and pitch.

    Parameters
    ----------
    anchor : int
        Number of the anchor.
    depth_sd : float
        Standard deviation of z [m].
    tilt_sd : float
        Standard deviation of roll and pitch [rad].
    """

    anchor: int
    depth_sd: float
    tilt_sd: float


@dataclass(frozen=True)
class PositionFix:
    """Where a satellite receiver saw an anchor.

    Parameters
    ----------
    anchor : int
        Number of the anchor.
    east, north : float
        Position in the world [m].
    sigma : float
        Standard deviation of each [m].
    """

    anchor: int
    east: float
    north: float
    sigma: float


def first_pose_factor(T_world_anchor: FloatArray, sigmas: FloatArray) -> gtsam.PriorFactorPose3:
    """Hold anchor 0 where it is.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (4, 4)
        Pose of the first anchor.
    sigmas : ndarray, shape (6,)
        Standard deviations along the world's axes [rad, rad, rad, m, m, m].

    Returns
    -------
    factor : gtsam.PriorFactorPose3
        The factor.
    """
    covariance = tangent_covariance(T_world_anchor, np.diag(sigmas**2))
    return gtsam.PriorFactorPose3(0, gtsam.Pose3(T_world_anchor), gtsam.noiseModel.Gaussian.Covariance(covariance))


def between_factor(relative: RelativePose) -> gtsam.BetweenFactorPose3:
    """Hold two anchors together.

    Parameters
    ----------
    relative : RelativePose
        The measurement.

    Returns
    -------
    factor : gtsam.BetweenFactorPose3
        The factor.
    """
    covariance = tangent_covariance(relative.T_target_source, relative.covariance)
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    return gtsam.BetweenFactorPose3(relative.target, relative.source, gtsam.Pose3(relative.T_target_source), noise)


def between_factors(relative_poses: Sequence[RelativePose], scale: float = 1.0) -> list[gtsam.BetweenFactorPose3]:
    """Hold many pairs of anchors together.

    Parameters
    ----------
    relative_poses : sequence of RelativePose
        The measurements.
    scale : float
        Standard deviations are taken this much larger.

    Returns
    -------
    factors : list of gtsam.BetweenFactorPose3
        As `between_factor` makes them, the covariances turned all at once.
    """
    if not relative_poses:
        return []
    T = np.stack([relative.T_target_source for relative in relative_poses])
    covariances = tangent_covariance(T, np.stack([relative.covariance for relative in relative_poses]))
    upper = np.linalg.cholesky(covariances[:, ::-1, ::-1])[:, ::-1, ::-1]  # covariance is upper @ upper.T
    noises = [gtsam.noiseModel.Gaussian.SqrtInformation(root) for root in np.linalg.inv(scale * upper)]
    measured = zip(relative_poses, noises, strict=True)
    return [
        gtsam.BetweenFactorPose3(relative.target, relative.source, gtsam.Pose3(relative.T_target_source), noise)
        for relative, noise in measured
    ]


def fix_factor(fix: PositionFix) -> gtsam.PoseTranslationPrior3D:
    """Hold an anchor where a satellite receiver saw it; height and attitude stay free.

    Parameters
    ----------
    fix : PositionFix
        The fix.

    Returns
    -------
    factor : gtsam.PoseTranslationPrior3D
        The factor.
    """
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([fix.sigma, fix.sigma, _FREE]))
    return gtsam.PoseTranslationPrior3D(fix.anchor, np.array([fix.east, fix.north, 0.0]), noise)


def unary_factors(T_world_anchor: FloatArray, known: UnaryKnowledge) -> list[gtsam.NonlinearFactor]:
    """Hold depth, roll and pitch of an anchor at what was measured; x, y and yaw stay free.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (4, 4)
        The anchor's pose with the depth, roll and pitch as measured.
    known : UnaryKnowledge
        How well they are known.

    Returns
    -------
    factors : list of gtsam.NonlinearFactor
        One for the depth, one for roll and pitch.
    """
    depth_noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([_FREE, _FREE, known.depth_sd]))
    tilt_noise = gtsam.noiseModel.Isotropic.Sigma(2, known.tilt_sd)
    up_in_body = gtsam.Unit3(T_world_anchor[2, :3])
    return [
        gtsam.PoseTranslationPrior3D(known.anchor, T_world_anchor[:3, 3], depth_noise),
        gtsam.AttitudeFactorPose3(known.anchor, gtsam.Unit3(_UP), tilt_noise, up_in_body),
    ]


def pose_values(T_world_anchor: FloatArray) -> gtsam.Values:
    """Starting values of an optimiser.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (S, 4, 4)
        Poses of the anchors.

    Returns
    -------
    values : gtsam.Values
        Pose k under key k.
    """
    values = gtsam.Values()
    for anchor, T in enumerate(T_world_anchor):
        values.insert(anchor, gtsam.Pose3(T))
    return values


def poses_of(values: gtsam.Values) -> FloatArray:
    """Poses from an optimiser's values.

    Parameters
    ----------
    values : gtsam.Values
        Pose k under key k.

    Returns
    -------
    T_world_anchor : ndarray, shape (S, 4, 4)
        Poses of the anchors.
    """
    rows = gtsam.utilities.extractPose3(values)  # rotation by rows, then translation
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = rows[:, :9].reshape(-1, 3, 3), rows[:, 9:]
    return T


def graph_of(factors: Iterable[gtsam.NonlinearFactor]) -> gtsam.NonlinearFactorGraph:
    """Gather factors in a graph.

    Parameters
    ----------
    factors : iterable of gtsam.NonlinearFactor
        The factors.

    Returns
    -------
    graph : gtsam.NonlinearFactorGraph
        The graph.
    """
    graph = gtsam.NonlinearFactorGraph()
    for factor in factors:
        graph.add(factor)
    return graph
