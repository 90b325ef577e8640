"""The problem that a pose graph poses: anchors, what joins them, and what is known of each by itself."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import gtsam
import numpy as np

from backend.arrays import FloatArray, IntArray
from backend.constant_errors import ConstantErrors
from backend.factors import PositionFix, UnaryKnowledge, between_factors, first_pose_factor, fix_factor, unary_factors
from backend.innovations import Innovations, innovations
from backend.least_squares import LeastSquares
from backend.poses import RelativePose
from backend.stacks import RelativeStack, stacked
from backend.terms import RelativeTerms, UnaryTerms, first_term, joined, relative_terms, unary_terms


@dataclass(frozen=True)
class Problem:
    """A graph of anchors, checked and complete.

    Parameters
    ----------
    T_world_anchor_dr : ndarray, shape (S, 4, 4)
        Dead-reckoned body poses of the anchors.
    first_pose_sigmas : ndarray, shape (6,)
        Of anchor 0 along the world's axes [rad, rad, rad, m, m, m].
    odometry : sequence of RelativePose, length S - 1
        From each anchor to the next, in order.
    unary : sequence of UnaryKnowledge
        Measured depths and tilts.
    fixes : sequence of PositionFix
        Positions that a satellite receiver gave.
    closures : sequence of RelativePose, length C
        Loop closures, to be trusted or not.
    chance : ndarray, shape (C,)
        Expected number of false closures as good as each [1].
    constants : ConstantErrors or None
        What of the first pose's and the odometry's errors is constant over the dive; None where nobody knows.
    """

    T_world_anchor_dr: FloatArray
    first_pose_sigmas: FloatArray
    odometry: Sequence[RelativePose]
    unary: Sequence[UnaryKnowledge]
    fixes: Sequence[PositionFix]
    closures: Sequence[RelativePose]
    chance: FloatArray
    constants: ConstantErrors | None = None
    _made: dict[float, list[gtsam.NonlinearFactor]] = field(default_factory=dict, init=False, repr=False, compare=False)

    def known_factors(self, scale: float) -> list[gtsam.NonlinearFactor]:
        """Make all factors but those of the closures.

        Parameters
        ----------
        scale : float
            Standard deviations of the odometry are taken this much larger.

        Returns
        -------
        factors : list of gtsam.NonlinearFactor
            First pose, odometry, depth and tilt, fixes; made once for each scale.
        """
        if scale not in self._made:
            first, *others = self._unscaled
            self._made[scale] = [first, *between_factors(self.odometry, scale), *others]
        return self._made[scale]

    @cached_property
    def _unscaled(self) -> list[gtsam.NonlinearFactor]:
        """First pose, depth and tilt, fixes: the same at every scale."""
        T = self.T_world_anchor_dr
        unary = [factor for known in self.unary for factor in unary_factors(T[known.anchor], known)]
        return [first_pose_factor(T[0], self.first_pose_sigmas), *unary, *(fix_factor(fix) for fix in self.fixes)]

    def least_squares(self, scale: float, closures: IntArray) -> LeastSquares:
        """Sum the squares of all that is known and of some closures.

        Parameters
        ----------
        scale : float
            Standard deviations of the odometry are taken this much larger.
        closures : ndarray of int, shape (K,)
            Positions of the closures; their terms come last, in this order.

        Returns
        -------
        least_squares : LeastSquares
            The same squares as those of `known_factors` and the closures' factors.
        """
        parts = [self._first_term, self._odometry_terms.weighted(scale**-2), self.closure_terms[closures]]
        return LeastSquares(len(self.T_world_anchor_dr), joined(parts), self.unary_terms)

    def stretched(self, scale: float) -> list[RelativePose]:
        """Odometry with larger standard deviations.

        Parameters
        ----------
        scale : float
            By this factor.

        Returns
        -------
        odometry : list of RelativePose, length S - 1
            The same steps.
        """
        return [replace(step, covariance=scale**2 * step.covariance) for step in self.odometry]

    @cached_property
    def odometry_stack(self) -> RelativeStack:
        """Odometry as arrays, in order."""
        return stacked(self.odometry)

    @cached_property
    def _closure_stack(self) -> RelativeStack:
        """Closures as arrays."""
        return stacked(self.closures)

    @cached_property
    def _first_term(self) -> RelativeTerms:
        """The first pose."""
        return first_term(self.T_world_anchor_dr[0], self.first_pose_sigmas)

    @cached_property
    def _odometry_terms(self) -> RelativeTerms:
        """Odometry as squares."""
        return relative_terms(self.odometry_stack)

    @cached_property
    def closure_terms(self) -> RelativeTerms:
        """Squares of all closures, by their positions."""
        return relative_terms(self._closure_stack)

    @cached_property
    def unary_terms(self) -> UnaryTerms:
        """Squares of depths, tilts and fixes."""
        return unary_terms(self.T_world_anchor_dr, self.unary, self.fixes)

    def compared(self, T_world_anchor: FloatArray, closures: IntArray | slice = slice(None)) -> Innovations:
        """Compare closures with dead reckoning.

        Parameters
        ----------
        T_world_anchor : ndarray, shape (S, 4, 4)
            Poses to take it about; of fewer anchors than all, where the others have not come yet.
        closures : ndarray of int, shape (K,), or slice
            Positions of the closures, all between these anchors.

        Returns
        -------
        innovations : Innovations
            One row a closure.
        """
        odometry = self.odometry_stack[: len(T_world_anchor) - 1]
        return innovations(T_world_anchor, odometry, self._closure_stack[closures], self.chance[closures])

    def chosen(self, closures: IntArray) -> list[RelativePose]:
        """Pick closures.

        Parameters
        ----------
        closures : ndarray of int, shape (K,)
            Their positions.

        Returns
        -------
        chosen : list of RelativePose, length K
            In that order.
        """
        return [self.closures[int(closure)] for closure in closures]


@dataclass(frozen=True)
class Belief:
    """Which closures are believed, before the graph has borne them out.

    Parameters
    ----------
    believed : ndarray of int, shape (K,)
        Positions of the closures, ascending.
    odometry_scale : float
        How much worse than modelled dead reckoning is, by their account.
    T_world_anchor : ndarray, shape (S, 4, 4)
        Poses near the solution.
    """

    believed: IntArray
    odometry_scale: float
    T_world_anchor: FloatArray


@dataclass(frozen=True)
class Estimate:
    """A solution on the way: poses and the closures that hold them.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (S, 4, 4)
        Body poses of the anchors.
    holding : ndarray of int, shape (K,)
        Positions of the closures.
    odometry_scale : float
        How much larger than said the odometry's standard deviations were taken.
    """

    T_world_anchor: FloatArray
    holding: IntArray
    odometry_scale: float

    @property
    def n_holding(self) -> int:
        """Number of closures that hold."""
        return int(np.size(self.holding))
