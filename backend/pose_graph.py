"""The pose graph: anchors of submaps, held together by odometry and loop closures, solved by GTSAM."""

from collections.abc import Mapping
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from backend.arrays import FloatArray
from backend.atlas import believe_inside_gates
from backend.beliefs import Chooser, believe_consistent
from backend.consistency import ConsistencyConfig
from backend.constant_errors import ConstantErrors
from backend.do_no_harm import DoNoHarmConfig, MapAgreement
from backend.factors import PositionFix, UnaryKnowledge
from backend.incremental import believe_incrementally
from backend.innovations import Innovations
from backend.particles import ParticleConfig, believe_best_particle
from backend.poses import RelativePose, as_poses
from backend.problem import Problem
from backend.solution import PoseGraphSolution
from backend.solving import Rules, solve_problem

__all__ = ["DisconnectedGraphError", "PoseGraph", "PoseGraphConfig", "PoseGraphSolution"]


class PoseGraphConfig(BaseModel):
    """How the graph is solved."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    method: Literal["consistent", "incremental", "particles", "atlas"] = Field(
        default="consistent",
        description="How closures are chosen: the set that agrees best; the same as anchors come; a particle filter; "
        "or one after the other inside gates of an atlas.",
    )
    particles: ParticleConfig = ParticleConfig()
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
        self._constants: ConstantErrors | None = None
        self._unary: list[UnaryKnowledge] = []
        self._fixes: list[PositionFix] = []
        self._closures: list[RelativePose] = []
        self._chance: list[float] = []

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
        return self.problem().compared(self.T_world_anchor_dr)

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

    def add_constant_errors(self, constants: ConstantErrors) -> None:
        """Say what of the errors of the first pose and of the odometry is constant: it is solved for in the end.

        Parameters
        ----------
        constants : ConstantErrors
            Part of the covariances that first pose and odometry are given.
        """
        n, shapes = self.n_anchors, (constants.moves.shape[:2], constants.rest.shape)
        if shapes != ((n, 6), (n - 1, 6, 6)):
            raise ValueError(f"constant errors of {n} anchors are wanted, got shapes {shapes[0]} and {shapes[1]}")
        if not (np.isfinite(constants.moves).all() and all(map(_is_covariance, constants.rest))):
            raise ValueError("constant errors must be finite and leave each step a positive definite covariance")
        self._constants = constants

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

    def add_fix(self, anchor: int, east: float, north: float, sigma: float) -> None:
        """Hold an anchor where a satellite receiver saw it, unless that is wildly wrong.

        Parameters
        ----------
        anchor : int
            The anchor.
        east, north : float
            Position in the world [m].
        sigma : float
            Standard deviation of each [m].
        """
        self._check_anchor(anchor)
        if not (np.isfinite([east, north]).all() and 0 < sigma < np.inf):
            raise ValueError(f"a fix is a finite position with a positive sigma, got {east}, {north} and {sigma} m")
        self._fixes.append(PositionFix(anchor, float(east), float(north), float(sigma)))

    def add_closure(
        self, target: int, source: int, T_target_source: ArrayLike, sigmas: ArrayLike, chance: float = 1.0
    ) -> None:
        """Add a loop closure, to be trusted or not.

        Parameters
        ----------
        target, source : int
            Two anchors.
        T_target_source : array_like, shape (4, 4)
            Body pose of the source seen from the body of the target.
        sigmas : array_like, shape (6,)
            Standard deviations along the target's axes [rad, rad, rad, m, m, m].
        chance : float
            Expected number of false closures as good as this one in the whole dive [1]; 1 where nobody knows.
        """
        if not chance >= 0:
            raise ValueError(f"the chance of a closure is a number that is not negative, got {chance}")
        covariance = np.diag(_check_sigmas(sigmas) ** 2)
        self._closures.append(self._relative_pose(target, source, T_target_source, covariance))
        self._chance.append(float(chance))

    def problem(self) -> Problem:
        """Gather what was added, once it hangs together.

        Returns
        -------
        problem : Problem
            The graph.

        Raises
        ------
        DisconnectedGraphError
            If there is no first pose or a step of the odometry is missing.
        """
        self._check_connected()
        assert self._first_pose_sigmas is not None
        odometry = [self._odometry[anchor] for anchor in range(self.n_anchors - 1)]
        known = (tuple(self._unary), tuple(self._fixes), tuple(self._closures))
        chance = np.array(self._chance)
        return Problem(self.T_world_anchor_dr, self._first_pose_sigmas, odometry, *known, chance, self._constants)

    def solve(
        self,
        withdrawn: Mapping[int, str] | None = None,
        agreement: MapAgreement | None = None,
        rng: np.random.Generator | None = None,
    ) -> PoseGraphSolution:
        """Find the poses that agree best with odometry, depth, attitude, fixes and the trustworthy closures.

        Parameters
        ----------
        withdrawn : mapping of int to str, optional
            Closures to leave out, by their position, and why.
        agreement : callable, optional
            How well the maps of two anchors agree at a relative pose of their bodies, in standard deviations above
            chance; NaN where they do not overlap.
        rng : numpy.random.Generator, optional
            Source of what the method draws, if it draws; seed 0 if none is given.

        Returns
        -------
        solution : PoseGraphSolution
            Poses, covariances and the verdict on each closure and each fix. Where no closure holds, the poses are the
            dead-reckoned ones, bit for bit, unless there are fixes.
        """
        rules = Rules(
            self._chooser(),
            self.config.inlier_probability,
            self.consistency,
            self.do_no_harm,
            agreement,
            rng or np.random.default_rng(0),
        )
        return solve_problem(self.problem(), rules, withdrawn or {})

    def _chooser(self) -> Chooser:
        """The way to choose closures."""
        choosers: dict[str, Chooser] = {
            "consistent": believe_consistent,
            "incremental": believe_incrementally,
            "particles": partial(believe_best_particle, config=self.config.particles),
            "atlas": believe_inside_gates,
        }
        return choosers[self.config.method]

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
