"""Relative poses as stacks of arrays, for what is computed of thousands of them again and again."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backend.arrays import FloatArray, IntArray
from backend.poses import RelativePose


@dataclass(frozen=True)
class RelativeStack:
    """Many relative poses.

    Parameters
    ----------
    target, source : ndarray of int, shape (C,)
        Numbers of the anchors that each joins.
    T_target_source : ndarray, shape (C, 4, 4)
        Takes points of the source's body frame to the target's.
    covariance : ndarray, shape (C, 6, 6)
        Along the target's axes, rotation first [rad**2, rad m, m**2].
    """

    target: IntArray
    source: IntArray
    T_target_source: FloatArray
    covariance: FloatArray

    def __len__(self) -> int:
        return len(self.target)

    def __getitem__(self, chosen: IntArray | slice) -> "RelativeStack":
        return RelativeStack(
            self.target[chosen], self.source[chosen], self.T_target_source[chosen], self.covariance[chosen]
        )


def stacked(relative_poses: Sequence[RelativePose]) -> RelativeStack:
    """Stack relative poses.

    Parameters
    ----------
    relative_poses : sequence of RelativePose, length C
        The measurements.

    Returns
    -------
    stack : RelativeStack
        In the same order.
    """
    return RelativeStack(
        np.array([relative.target for relative in relative_poses], dtype=np.int64),
        np.array([relative.source for relative in relative_poses], dtype=np.int64),
        np.array([relative.T_target_source for relative in relative_poses], dtype=np.float64).reshape(-1, 4, 4),
        np.array([relative.covariance for relative in relative_poses], dtype=np.float64).reshape(-1, 6, 6),
    )
