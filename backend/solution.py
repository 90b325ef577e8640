"""What the pose graph's optimiser found, and why a loop closure does not hold the graph."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from backend.arrays import BoolArray, FloatArray
from backend.poses import sandwich

INLIER_WEIGHT = 0.5  # weight above which a closure is an inlier; graduated non-convexity ends near zero or one


class Withdrawal(StrEnum):
    """Why a loop closure does not hold the graph."""

    ALONE = "no independent closure agrees with it"
    INCONSISTENT = "it disagrees with the closures that agree"
    OUTLIER = "it does not fit the pose graph"
    RESIDUAL = "its residual is too large against its covariance"
    MAPS_DISAGREE = "the maps disagree where the graph lays them"
    BEYOND_DRIFT = "the correction is larger than dead reckoning can be wrong"


@dataclass(frozen=True)
class PoseGraphSolution:
    """What the optimiser found.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (S, 4, 4)
        Body poses of the anchors.
    covariances : ndarray, shape (S, 6, 6)
        Marginal covariances along each body's own axes, rotation first [rad**2, rad m, m**2].
    closure_weights : ndarray, shape (C,)
        Weight of each loop closure at the end, 0 to 1.
    reasons : tuple of str, length C
        Why a closure does not hold the graph; empty where it does.
    odometry_scale : float
        How much larger than said the odometry's standard deviations were taken.
    error_before, error_after : float
        Half the sum of squared normalised residuals, of the closures that hold and all else, at the dead-reckoned and
        at the estimated poses.
    g2o : str
        The graph as a g2o file.
    fix_reasons : tuple of str, length F
        Why a fix was not taken; empty where it was.
    """

    T_world_anchor: FloatArray
    covariances: FloatArray
    closure_weights: FloatArray
    reasons: tuple[str, ...]
    odometry_scale: float
    error_before: float
    error_after: float
    g2o: str
    fix_reasons: tuple[str, ...] = ()

    @property
    def is_inlier(self) -> BoolArray:
        """Shape (C,): whether each loop closure holds the graph."""
        return self.closure_weights > INLIER_WEIGHT

    @property
    def sigmas(self) -> FloatArray:
        """Shape (S, 4): standard deviations of x, y, z [m] and yaw [rad] along the world's axes."""
        turn = np.zeros((len(self.T_world_anchor), 6, 6))
        turn[:, :3, :3] = turn[:, 3:, 3:] = self.T_world_anchor[:, :3, :3]
        variances = np.diagonal(sandwich(turn, self.covariances), axis1=1, axis2=2)
        return np.sqrt(variances[:, [3, 4, 5, 2]])

    def write_g2o(self, path: str | Path) -> None:
        """Write the graph in the g2o format.

        Parameters
        ----------
        path : str or Path
            The file.
        """
        Path(path).write_text(self.g2o, encoding="ascii")
