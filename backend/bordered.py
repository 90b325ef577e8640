"""Least squares with a border: poses, and beside them the few constant errors of the sensors that move all odometry.

All poses depend on a few numbers, so the normal equations have a border of as many columns. The factor of the poses
alone serves for both: the numbers are solved for first, on what it leaves of their information (Schur's complement).
"""

from dataclasses import dataclass, replace

import numpy as np

from backend.arrays import FloatArray, IntArray
from backend.block_cholesky import BlockFactor, factorise
from backend.constant_errors import tangents
from backend.least_squares import LeastSquares
from backend.pose_kernels import moved
from backend.problem import Problem
from backend.stacks import RelativeStack
from backend.terms import RelativeTerms, first_term, joined, relative_terms


@dataclass(frozen=True)
class Bordered:
    """Least squares over poses and the constant errors of the sensors.

    Parameters
    ----------
    least_squares : LeastSquares
        Its first S relative poses are the first pose and the odometry, without what is constant of their errors.
    tangents : ndarray, shape (S, 6, K)
        How one standard deviation of each constant error moves these.
    scale : float
        Dead reckoning is this much worse than said, its constant errors too.
    """

    least_squares: LeastSquares
    tangents: FloatArray
    scale: float

    def at(self, size: FloatArray) -> LeastSquares:
        """Fix the constant errors.

        Parameters
        ----------
        size : ndarray, shape (K,)
            In standard deviations.

        Returns
        -------
        least_squares : LeastSquares
            Of the poses alone; all that was measured is corrected.
        """
        terms, n = self.least_squares.relative, len(self.tangents)
        T = terms.T_target_source.copy()
        T[:n] = moved(T[:n], -self.tangents @ size)
        return self.least_squares.measured(replace(terms, T_target_source=T))

    def error(self, T: FloatArray, size: FloatArray) -> float:
        """Half the sum of squares, of the constant errors too.

        Parameters
        ----------
        T : ndarray, shape (S, 4, 4)
            Poses.
        size : ndarray, shape (K,)
            Constant errors, in standard deviations.

        Returns
        -------
        error : float
            The error [1].
        """
        return self.at(size).error(T) + 0.5 * float(size @ size) / self.scale**2

    def equations(self, T: FloatArray, size: FloatArray) -> "Equations":
        """Model the error about poses and constant errors.

        Parameters
        ----------
        T : ndarray, shape (S, 4, 4)
            Poses.
        size : ndarray, shape (K,)
            Constant errors, in standard deviations.

        Returns
        -------
        equations : Equations
            The normal equations, factorised.

        Raises
        ------
        numpy.linalg.LinAlgError
            If poses are not determined.
        """
        here, terms, n = self.at(size), self.least_squares.relative, len(self.tangents)
        slopes = terms.roots[:n] @ self.tangents
        diagonal, below, gradient = here.normal_equations(T)
        border, information, slope = here.border(T, slopes)
        factor = factorise(here.pattern, diagonal, below)
        columns = np.ascontiguousarray(np.moveaxis(border, 2, 0))
        response = np.stack([factor.solve(column) for column in columns], axis=2)
        prior = np.eye(len(size)) / self.scale**2
        left = information + prior - np.einsum("sik,sil->kl", border, response)
        return Equations(factor, response, left, gradient, slope + size / self.scale**2)

    def log_whitening(self) -> float:
        """Logarithm of the determinant of what whitens the first pose and the odometry, and of the prior's.

        Returns
        -------
        log_determinant : float
            Without the scale of the odometry, which is in every model of it.
        """
        n, _, n_errors = self.tangents.shape
        return log_whitening(self.least_squares.relative, n) - n_errors * float(np.log(self.scale))


@dataclass(frozen=True)
class Equations:
    """Normal equations of poses with a border of constant errors.

    Parameters
    ----------
    factor : BlockFactor
        Of the information of the poses.
    response : ndarray, shape (S, 6, K)
        How poses follow the constant errors, but for the sign.
    left : ndarray, shape (K, K)
        Information about the constant errors when poses are free.
    gradient : ndarray, shape (S, 6)
        Of the error by the poses.
    slope : ndarray, shape (K,)
        Of the error by the constant errors.
    """

    factor: BlockFactor
    response: FloatArray
    left: FloatArray
    gradient: FloatArray
    slope: FloatArray

    @property
    def step(self) -> tuple[FloatArray, FloatArray, float]:
        """Motions of the poses (S, 6), change of the constant errors (K,), and the error that this gains."""
        change = -np.linalg.solve(self.left, self.slope - np.einsum("sik,si->k", self.response, self.gradient))
        delta = -self.factor.solve(self.gradient) - self.response @ change
        return delta, change, -0.5 * float((self.gradient * delta).sum() + self.slope @ change)

    @property
    def covariances(self) -> FloatArray:
        """Shape (S, 6, 6): of each pose, the constant errors as uncertain as they are left."""
        return self._with(np.asarray(np.linalg.inv(self.left), dtype=np.float64))

    def unsolved_covariances(self, scale: float) -> FloatArray:
        """Covariances where the constant errors were not solved for.

        Parameters
        ----------
        scale : float
            They are this many standard deviations large.

        Returns
        -------
        covariances : ndarray, shape (S, 6, 6)
            Of each pose.
        """
        return self._with(scale**2 * np.eye(len(self.left)))

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of all information."""
        return self.factor.log_determinant + float(np.linalg.slogdet(self.left)[1])

    def _with(self, uncertain: FloatArray) -> FloatArray:
        spread = self.response @ uncertain @ np.swapaxes(self.response, 1, 2)
        return np.asarray(self.factor.inverse_diagonal() + 0.5 * (spread + np.swapaxes(spread, 1, 2)))


def bordered(problem: Problem, holding: IntArray, scale: float) -> Bordered:
    """Take the constant errors out of the odometry's.

    Parameters
    ----------
    problem : Problem
        The graph, with constant errors.
    holding : ndarray of int, shape (K,)
        Positions of the closures.
    scale : float
        Standard deviations of the odometry are taken this much larger.

    Returns
    -------
    bordered : Bordered
        Least squares over both.
    """
    constants = problem.constants
    assert constants is not None
    moves, rest = constants.first_pose(problem.first_pose_sigmas)
    first, stack = first_term(problem.T_world_anchor_dr[0], rest), problem.odometry_stack
    odometry = relative_terms(RelativeStack(stack.target, stack.source, stack.T_target_source, constants.rest))
    known = joined([first, odometry.weighted(scale**-2)])
    moved_by = tangents(known.T_target_source, np.concatenate([moves[None], constants.moves[1:]]))
    terms = joined([known, problem.closure_terms[holding]])
    return Bordered(LeastSquares(len(problem.T_world_anchor_dr), terms, problem.unary_terms), moved_by, scale)


def log_whitening(terms: RelativeTerms, n: int) -> float:
    """Logarithm of the determinant of what whitens relative poses.

    Parameters
    ----------
    terms : RelativeTerms
        Squares of relative poses.
    n : int
        The first so many of them.

    Returns
    -------
    log_determinant : float
        Whatever their weights.
    """
    return float(np.log(np.diagonal(terms.roots[:n], axis1=1, axis2=2)).sum())
