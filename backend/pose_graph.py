"""The pose graph: anchors of submaps, held together by odometry and loop closures, solved by GTSAM."""

from collections.abc import Mapping
from dataclasses import replace

import gtsam
import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from backend.arrays import FloatArray, IntArray
from backend.consistency import ConsistencyConfig, consistent_closures, count_votes
from backend.do_no_harm import DoNoHarmConfig, harmful_closures
from backend.factors import UnaryKnowledge, between_factor, first_pose_factor, unary_factors
from backend.g2o import g2o_text
from backend.innovations import Innovations, innovations
from backend.optimiser import half_squared_error, marginal_covariances, optimise, truncated_weights
from backend.poses import RelativePose, as_poses
from backend.solution import INLIER_WEIGHT, PoseGraphSolution, Withdrawal

__all__ = ["DisconnectedGraphError", "PoseGraph", "PoseGraphConfig", "PoseGraphSolution"]


class PoseGraphConfig(BaseModel):
    """How the graph is solved."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    inlier_probability: float = Field(
        default=0.9999,
        gt=0,
        lt=1,
        description="Share of true closures [1] whose residual stays below the truncation of GNC-TLS, which cuts hard.",
    )


class DisconnectedGraphError(ValueError):
    """Some anchors hang in the air: no chain of odometry leads to them from the first pose."""


class PoseGraph:
    """A graph of anchors under construction.

    Parameters
    ----------
    T_world_anchor_dr : array_like, shape (S, 4, 4)
        Dead-reckoned body poses of the anchors, numbered from 0 along the track.
    config : PoseGraphConfig, optional
        How it is solved.
    consistency : ConsistencyConfig, optional
        Which sets of closures are believed.
    do_no_harm : DoNoHarmConfig, optional
        When a closure is withdrawn although the optimiser kept it.
    """

    def __init__(
        self,
        T_world_anchor_dr: ArrayLike,
        config: PoseGraphConfig | None = None,
        consistency: ConsistencyConfig | None = None,
        do_no_harm: DoNoHarmConfig | None = None,
    ) -> None:
        self.T_world_anchor_dr = as_poses(T_world_anchor_dr, "T_world_anchor_dr").copy()
        if len(self.T_world_anchor_dr) == 0:
            raise ValueError("a pose graph needs at least one anchor, got none")
        self.config = config or PoseGraphConfig()
        self.consistency = consistency or ConsistencyConfig()
        self.do_no_harm = do_no_harm or DoNoHarmConfig()
        self._first_pose_sigmas: FloatArray | None = None
        self._odometry: dict[int, RelativePose] = {}
        self._unary: list[UnaryKnowledge] = []
        self._closures: list[RelativePose] = []

    @property
    def n_anchors(self) -> int:
        """Number of anchors S."""
        return len(self.T_world_anchor_dr)

    @property
    def closures(self) -> tuple[RelativePose, ...]:
        """The loop closures in the order in which they were added."""
        return tuple(self._closures)

    @property
    def innovations(self) -> Innovations:
        """How the loop closures disagree with dead reckoning."""
        self._check_connected()
        odometry = [self._odometry[anchor] for anchor in range(self.n_anchors - 1)]
        return innovations(self.T_world_anchor_dr, odometry, self._closures)

    def add_first_pose(self, sigmas: ArrayLike) -> None:
        """Hold anchor 0 at its dead-reckoned pose: the gauge of the graph.

        Parameters
        ----------
        sigmas : array_like, shape (6,)
            Standard deviations along the world's axes [rad, rad, rad, m, m, m].
        """
        self._first_pose_sigmas = _check_sigmas(sigmas)

    def add_odometry(self, target: int, source: int, T_target_source: ArrayLike, covariance: ArrayLike) -> None:
        """Hold an anchor to the one before it.

        Parameters
        ----------
        target, source : int
            Two consecutive anchors, the earlier first.
        T_target_source : array_like, shape (4, 4)
            Pose of the later seen from the earlier.
        covariance : array_like, shape (6, 6)
            Along the target's axes, rotation first [rad**2, rad m, m**2].
        """
        if source != target + 1 or target in self._odometry:
            raise ValueError(f"odometry joins an anchor once and to the next one, got {target} and {source}")
        self._odometry[target] = self._relative_pose(target, source, T_target_source, covariance)

    def add_depth_and_tilt(self, anchor: int, depth_sd: float, tilt_sd: float) -> None:
        """Hold the depth, roll and pitch of an anchor at their dead-reckoned, that is measured, values.

        Parameters
        ----------
        anchor : int
            The anchor.
        depth_sd : float
            Standard deviation of z [m].
        tilt_sd : float
            Standard deviation of roll and pitch [rad].
        """
        self._check_anchor(anchor)
        if not (0 < depth_sd < np.inf and 0 < tilt_sd < np.inf):
            raise ValueError(f"depth and tilt sigmas must be positive, got {depth_sd} m and {tilt_sd} rad")
        self._unary.append(UnaryKnowledge(anchor, depth_sd, tilt_sd))

    def add_closure(self, target: int, source: int, T_target_source: ArrayLike, sigmas: ArrayLike) -> None:
        """Add a loop closure, to be trusted or not.

        Parameters
        ----------
        target, source : int
            Two anchors.
        T_target_source : array_like, shape (4, 4)
            Body pose of the source seen from the body of the target.
        sigmas : array_like, shape (6,)
            Standard deviations along the target's axes [rad, rad, rad, m, m, m].
        """
        covariance = np.diag(_check_sigmas(sigmas) ** 2)
        self._closures.append(self._relative_pose(target, source, T_target_source, covariance))

    def solve(self, withdrawn: Mapping[int, str] | None = None) -> PoseGraphSolution:
        """Find the poses that agree best with odometry, depth, attitude and the trustworthy closures.

        Parameters
        ----------
        withdrawn : mapping of int to str, optional
            Closures to leave out, by their position, and why.

        Returns
        -------
        solution : PoseGraphSolution
            Poses, covariances and the verdict on each closure. Where no closure holds, the poses are the dead-reckoned
            ones, bit for bit.
        """
        withdrawn, compared = dict(withdrawn or {}), self.innovations
        while True:
            solution = self._solve_with(compared, withdrawn)
            harmful = harmful_closures(solution, self._closures, compared, self.do_no_harm)
            if not harmful:
                return solution
            withdrawn |= harmful

    def _solve_with(self, compared: Innovations, withdrawn: Mapping[int, str]) -> PoseGraphSolution:
        """Solve with the closures that are not withdrawn."""
        offered = np.setdiff1d(np.arange(len(self._closures)), list(withdrawn)).astype(np.int64)
        # which closures agree, and how far dead reckoning must be stretched for it
        consistent = consistent_closures(compared[offered], self.consistency)
        agreeing = offered[consistent.is_member]
        # which of them the whole graph bears out
        known = self._known_factors(consistent.odometry_scale)
        weights = np.zeros(len(self._closures))
        doubtful = [between_factor(self._closures[closure]) for closure in agreeing]
        probability = self.config.inlier_probability
        weights[agreeing] = truncated_weights(known, doubtful, self.T_world_anchor_dr, probability)
        # least squares over what holds, if enough does
        holding = agreeing[weights[agreeing] > INLIER_WEIGHT]
        if count_votes(compared[holding], self.consistency) < self.consistency.min_votes:
            agreeing = holding = holding[:0]
            weights[:] = 0.0
        solution = self._least_squares(holding, consistent.odometry_scale)
        return replace(solution, closure_weights=weights, reasons=self._reasons(agreeing, holding, withdrawn))

    def _least_squares(self, holding: IntArray, scale: float) -> PoseGraphSolution:
        """Solve with the closures that hold; without any, nothing moves."""
        closures = [self._closures[closure] for closure in holding]
        scale = scale if closures else 1.0
        factors = [*self._known_factors(scale), *(between_factor(closure) for closure in closures)]
        T_dr = self.T_world_anchor_dr
        T = optimise(factors, T_dr) if closures else T_dr.copy()
        return PoseGraphSolution(
            T_world_anchor=T,
            covariances=marginal_covariances(factors, T),
            closure_weights=np.zeros(len(self._closures)),
            reasons=("",) * len(self._closures),
            odometry_scale=scale,
            error_before=half_squared_error(factors, T_dr),
            error_after=half_squared_error(factors, T),
            g2o=g2o_text(T, [*(self._stretched(scale)), *closures]),
        )

    def _reasons(self, agreeing: IntArray, holding: IntArray, withdrawn: Mapping[int, str]) -> tuple[str, ...]:
        """Why each closure does not hold the graph."""
        other = Withdrawal.INCONSISTENT if agreeing.size else Withdrawal.ALONE
        reasons = [str(other)] * len(self._closures)
        for closure in agreeing:
            reasons[closure] = str(Withdrawal.OUTLIER)
        for closure in holding:
            reasons[closure] = ""
        return tuple(withdrawn.get(closure, reason) for closure, reason in enumerate(reasons))

    def _stretched(self, scale: float) -> list[RelativePose]:
        """The odometry with larger standard deviations."""
        odometry = (self._odometry[anchor] for anchor in range(self.n_anchors - 1))
        return [replace(step, covariance=scale**2 * step.covariance) for step in odometry]

    def _known_factors(self, scale: float) -> list[gtsam.NonlinearFactor]:
        """All factors but the closures."""
        T = self.T_world_anchor_dr
        unary = [factor for known in self._unary for factor in unary_factors(T[known.anchor], known)]
        odometry = [between_factor(step) for step in self._stretched(scale)]
        assert self._first_pose_sigmas is not None
        return [first_pose_factor(T[0], self._first_pose_sigmas), *odometry, *unary]

    def _relative_pose(self, target: int, source: int, T: ArrayLike, covariance: ArrayLike) -> RelativePose:
        """Check a measurement between two anchors."""
        self._check_anchor(target)
        self._check_anchor(source)
        if target == source:
            raise ValueError(f"a relative pose joins two different anchors, got {target} twice")
        matrix = np.array(covariance, dtype=np.float64)
        if not _is_covariance(matrix):
            raise ValueError(f"covariance of {target} and {source} must be a positive definite 6 x 6 matrix")
        return RelativePose(target, source, as_poses(np.asarray(T)[None], "T_target_source")[0].copy(), matrix)

    def _check_anchor(self, anchor: int) -> None:
        """Refuse numbers that are no anchors."""
        if not 0 <= anchor < self.n_anchors:
            raise ValueError(f"anchors are numbered 0..{self.n_anchors - 1}, got {anchor}")

    def _check_connected(self) -> None:
        """Find anchors in the air before the optimiser does."""
        if self._first_pose_sigmas is None:
            raise DisconnectedGraphError("the graph hangs in the air: add_first_pose is wanted before solve")
        missing = [anchor for anchor in range(self.n_anchors - 1) if anchor not in self._odometry]
        if missing:
            raise DisconnectedGraphError(
                f"odometry is wanted between all consecutive anchors: {missing[0]} and {missing[0] + 1} are not joined"
            )


def _is_covariance(matrix: FloatArray) -> bool:
    """Whether a matrix is 6 x 6, finite, symmetric and positive definite."""
    if matrix.shape != (6, 6) or not np.isfinite(matrix).all() or not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0):
        return False
    return bool((np.linalg.eigvalsh(matrix) > 0).all())


def _check_sigmas(sigmas: ArrayLike) -> FloatArray:
    """Refuse sigmas that are not six positive numbers."""
    values = np.array(sigmas, dtype=np.float64)
    if values.shape != (6,) or not (np.isfinite(values) & (values > 0)).all():
        raise ValueError(f"sigmas must be six positive numbers [rad rad rad m m m], got {values}")
    return values
