"""Least squares over the poses of a graph: what was measured, as arrays, its error and its normal equations.

The residuals are those of GTSAM's factors: ``Log(T_measured**-1 T_target**-1 T_source)`` of relative poses, whitened;
positions in the world; which way is up. Residuals and derivatives are exact and poses move by ``T Exp(delta)``, so
both come to the same minimum. As arrays a step takes a fifth of the time, and another scale of the odometry or another
weight of a closure is another vector of weights, not another graph.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from backend.arrays import FloatArray, IntArray
from backend.block_cholesky import BlockPattern, analyse
from backend.term_kernels import add_border, add_relative, add_unaries, squared_residuals, squared_unaries
from backend.terms import WORLD, RelativeTerms, UnaryTerms


@dataclass(frozen=True)
class LeastSquares:
    """A sum of squares that poses minimise.

    Parameters
    ----------
    n_anchors : int
        Number of anchors S.
    relative : RelativeTerms
        Relative poses: the first pose, odometry, closures.
    unary : UnaryTerms
        What is known of anchors by themselves.
    known_pattern : BlockPattern, optional
        Of other least squares between the same anchors.
    """

    n_anchors: int
    relative: RelativeTerms
    unary: UnaryTerms
    known_pattern: BlockPattern | None = None

    @cached_property
    def pattern(self) -> BlockPattern:
        """Which blocks a factor of the normal equations has."""
        if self.known_pattern is not None:
            return self.known_pattern
        between = self.relative.ends[self.relative.ends[:, 0] != WORLD]
        return analyse(self.n_anchors, between[:, 0], between[:, 1])

    def weighted(self, weights: FloatArray) -> "LeastSquares":
        """Weigh the relative poses otherwise.

        Parameters
        ----------
        weights : ndarray, shape (R,)
            Of each square [1].

        Returns
        -------
        least_squares : LeastSquares
            The same but for that; the pattern is not looked for again.
        """
        return self.measured(replace(self.relative, weights=weights))

    def measured(self, relative: RelativeTerms) -> "LeastSquares":
        """Measure or weigh the relative poses otherwise.

        Parameters
        ----------
        relative : RelativeTerms
            Between the same anchors in the same order.

        Returns
        -------
        least_squares : LeastSquares
            The same but for that; the pattern is not looked for again.
        """
        return LeastSquares(self.n_anchors, relative, self.unary, self.pattern)

    def squared_residuals(self, T_world_anchor: FloatArray) -> FloatArray:
        """Compare relative poses with their own covariances.

        Parameters
        ----------
        T_world_anchor : ndarray, shape (S, 4, 4)
            Poses.

        Returns
        -------
        squares : ndarray, shape (R,)
            Squared Mahalanobis distances of six dimensions, without weights.
        """
        return np.asarray(squared_residuals(T_world_anchor, self._relative))

    def error(self, T_world_anchor: FloatArray) -> float:
        """Half the sum of squared normalised residuals.

        Parameters
        ----------
        T_world_anchor : ndarray, shape (S, 4, 4)
            Poses.

        Returns
        -------
        error : float
            The error [1].
        """
        between = float((self.relative.weights * self.squared_residuals(T_world_anchor)).sum())
        return 0.5 * (between + float(squared_unaries(T_world_anchor, self._unary)))

    def normal_equations(self, T_world_anchor: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Model the error about some poses.

        Parameters
        ----------
        T_world_anchor : ndarray, shape (S, 4, 4)
            The poses.

        Returns
        -------
        diagonal, below : ndarray, shape (S, 6, 6) and (B, 6, 6)
            Information of all poses, as `backend.block_cholesky.factorise` takes it.
        gradient : ndarray, shape (S, 6)
            Of the error by the motions of poses along their own axes.
        """
        n, pattern = self.n_anchors, self.pattern
        diagonal, below, gradient = np.zeros((n, 6, 6)), np.zeros((len(pattern.rows), 6, 6)), np.zeros((n, 6))
        slots = pattern.slots(self.relative.ends[:, 0], self.relative.ends[:, 1])
        add_relative(T_world_anchor, self._relative, (slots, pattern.place), (diagonal, below, gradient))
        add_unaries(T_world_anchor, self._unary, diagonal, gradient)
        placed = np.empty_like(diagonal)
        placed[pattern.place] = diagonal
        return placed, below, gradient

    def border(self, T_world_anchor: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Model the error where a few numbers move many residuals.

        Parameters
        ----------
        T_world_anchor : ndarray, shape (S, 4, 4)
            The poses.
        slopes : ndarray, shape (Q, 6, K)
            How K numbers move the whitened residuals of the first Q relative poses.

        Returns
        -------
        border : ndarray, shape (S, 6, K)
            Information that poses and numbers share.
        information : ndarray, shape (K, K)
            Of the numbers.
        gradient : ndarray, shape (K,)
            Of the error by them.
        """
        k = slopes.shape[2]
        sums = np.zeros((self.n_anchors, 6, k)), np.zeros((k, k)), np.zeros(k)
        add_border(T_world_anchor, self._relative, np.ascontiguousarray(slopes), sums)
        return sums

    @property
    def _relative(self) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """Relative poses as the kernels take them."""
        terms = self.relative
        return terms.ends, terms.T_target_source, terms.roots, terms.weights

    @property
    def _unary(self) -> tuple[IntArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray]:
        """Unary knowledge as the kernels take it."""
        terms = self.unary
        place, tilt = (terms.place_anchor, terms.position, terms.precision), (terms.tilt_anchor, terms.up)
        return (*place, *tilt, terms.tilt_precision)
