"""The pose graph as text in the g2o format, exact to the last bit and with nothing dropped but the unary factors."""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from backend.arrays import FloatArray
from backend.poses import RelativePose, tangent_covariance

_UPPER = np.triu_indices(6)
_TRANSLATION_FIRST = [3, 4, 5, 0, 1, 2]


def g2o_text(T_world_anchor: FloatArray, relative_poses: Sequence[RelativePose]) -> str:
    """Write a graph of anchors.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (S, 4, 4)
        Poses of the anchors.
    relative_poses : sequence of RelativePose
        Odometry and loop closures.

    Returns
    -------
    text : str
        ``VERTEX_SE3:QUAT`` and ``EDGE_SE3:QUAT`` lines; information is translation first, as the format wants it.
    """
    vertices = [f"VERTEX_SE3:QUAT {anchor} {_pose(T)}" for anchor, T in enumerate(T_world_anchor)]
    return "\n".join([*vertices, "FIX 0", *(_edge(relative) for relative in relative_poses)]) + "\n"


def _edge(relative: RelativePose) -> str:
    """One relative pose with the upper triangle of its information."""
    information = np.linalg.inv(tangent_covariance(relative.T_target_source, relative.covariance))
    upper = (0.5 * (information + information.T))[np.ix_(_TRANSLATION_FIRST, _TRANSLATION_FIRST)][_UPPER]
    return f"EDGE_SE3:QUAT {relative.target} {relative.source} {_pose(relative.T_target_source)} {_numbers(upper)}"


def _pose(T: FloatArray) -> str:
    """``x y z qx qy qz qw``."""
    quaternion = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True)
    return _numbers([*T[:3, 3], *quaternion])


def _numbers(values: Iterable[float]) -> str:
    """Numbers that read back to the same bits; no negative zero."""
    return " ".join(repr(float(value) + 0.0) for value in values)
