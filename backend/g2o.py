"""The pose graph as text in the g2o format, exact to the last bit and with nothing dropped but the unary factors."""

from collections.abc import Sequence

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
    vertices = [f"VERTEX_SE3:QUAT {anchor} {_numbers(pose)}" for anchor, pose in enumerate(_poses(T_world_anchor))]
    return "\n".join([*vertices, "FIX 0", *_edges(relative_poses)]) + "\n"


def _edges(relative_poses: Sequence[RelativePose]) -> list[str]:
    """Relative poses with the upper triangles of their information."""
    if not relative_poses:
        return []
    T = np.stack([relative.T_target_source for relative in relative_poses])
    covariance = tangent_covariance(T, np.stack([relative.covariance for relative in relative_poses]))
    information = np.linalg.inv(covariance)
    information = 0.5 * (information + information.swapaxes(1, 2))
    upper = information[:, _TRANSLATION_FIRST][:, :, _TRANSLATION_FIRST][:, *_UPPER]
    ends = (f"EDGE_SE3:QUAT {relative.target} {relative.source}" for relative in relative_poses)
    return [f"{end} {_numbers(row)}" for end, row in zip(ends, np.hstack([_poses(T), upper]), strict=True)]


def _poses(T: FloatArray) -> FloatArray:
    """Rows of x, y, z, qx, qy, qz, qw."""
    return np.hstack([T[:, :3, 3], Rotation.from_matrix(T[:, :3, :3]).as_quat(canonical=True)])


def _numbers(values: FloatArray) -> str:
    """Numbers that read back to the same bits; no negative zero."""
    return " ".join(map(repr, (values + 0.0).tolist()))
