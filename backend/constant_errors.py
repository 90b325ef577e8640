"""Constant errors: what of the drift is the same on every step of a dive, and can be told from its loop closures.

A velocity scaled or turned and a heading that deviates with itself err alike on every step. Taken as independent from
step to step, they cost what closures know of them, and no sum of steps says how uncertain the track is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backend.arrays import FloatArray
from backend.poses import RelativePose

# Of a first pose's variance: the least that is its own, however much is constant errors; and the most that these may
# be, but for rounding, before it must be known from elsewhere.
_LEAST_SHARE, _MOST_SHARE = 1e-4, 1.01


@dataclass(frozen=True)
class ConstantErrors:
    """What constant errors do to the measurements of a graph, and what is left of those without them.

    Parameters
    ----------
    moves : ndarray, shape (S, 6, K)
        By how much one standard deviation of each of K errors makes a measurement wrong: first of the first pose along
        the world's axes, then of each step along the axes of the anchor that it begins at; rotation first [rad, m].
    rest : ndarray, shape (S - 1, 6, 6)
        Covariance of each step without them, along the same axes [rad**2, rad m, m**2].
    """

    moves: FloatArray
    rest: FloatArray

    @property
    def n_errors(self) -> int:
        """Number of constant errors K."""
        return self.moves.shape[2]

    def of_steps(self) -> "ConstantErrors":
        """The same errors, as if they did nothing to the first pose.

        Returns
        -------
        constants : ConstantErrors
            To solve for. The heading at the start deviates as later ones do, but a constant bias of it, of which
            closures say nothing, is as large: told from the deviations alone, the whole track would be turned by more
            than it was wrong, and too surely.
        """
        moves = self.moves.copy()
        moves[0] = 0.0
        return replace(self, moves=moves)

    def first_pose(self, sigmas: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Take what constant errors do off the uncertainty of the first pose.

        Parameters
        ----------
        sigmas : ndarray, shape (6,)
            All of it, along the world's axes [rad, rad, rad, m, m, m].

        Returns
        -------
        moves : ndarray, shape (6, K)
            What constant errors do to it: nothing where it is better known than they allow.
        rest : ndarray, shape (6,)
            Standard deviations without them.
        """
        variance, theirs = sigmas**2, (self.moves[0] ** 2).sum(axis=1)
        moves = np.where((theirs > _MOST_SHARE * variance)[:, None], 0.0, self.moves[0])
        return moves, np.sqrt(np.maximum(variance - (moves**2).sum(axis=1), _LEAST_SHARE * variance))


def tangents(T_target_source: FloatArray, moves: FloatArray) -> FloatArray:
    """Turn moves of measured poses into GTSAM's tangent.

    Parameters
    ----------
    T_target_source : ndarray, shape (S, 4, 4)
        As measured.
    moves : ndarray, shape (S, 6, K)
        Along the target's axes, rotation first.

    Returns
    -------
    tangents : ndarray, shape (S, 6, K)
        Along the source's axes.
    """
    back = np.swapaxes(T_target_source[:, :3, :3], 1, 2)
    return np.concatenate([back @ moves[:, :3], back @ moves[:, 3:]], axis=1)


def corrected_steps(
    steps: Sequence[RelativePose], T_steps: FloatArray, constants: ConstantErrors
) -> list[RelativePose]:
    """Odometry as it was after constant errors are taken off.

    Parameters
    ----------
    steps : sequence of RelativePose, length S - 1
        As measured.
    T_steps : ndarray, shape (S - 1, 4, 4)
        What they were but for the constant errors.
    constants : ConstantErrors
        Says how uncertain that is.

    Returns
    -------
    corrected : list of RelativePose, length S - 1
        The same steps.
    """
    return [
        RelativePose(step.target, step.source, T, covariance)
        for step, T, covariance in zip(steps, T_steps, constants.rest, strict=True)
    ]
