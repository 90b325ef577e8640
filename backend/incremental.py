"""The graph as it grows: iSAM2 takes in each anchor and each believed closure, and nothing is solved twice."""

from collections.abc import Sequence
from dataclasses import replace

import gtsam
import numpy as np
from scipy.special import chdtri

from backend.arrays import FloatArray, IntArray
from backend.beliefs import Offer, believe_consistent
from backend.consistency import ConsistentSet, consistent_closures
from backend.evidence import surpluses
from backend.factors import between_factors, graph_of, poses_of
from backend.innovations import Innovations
from backend.optimiser import residual_distances
from backend.problem import Belief, Problem

_RELINEARISE = np.repeat([0.02, 20.0], 3)  # change of a pose [rad, m] beyond which its factors are linearised again:
# they are linear in where poses lie, and a turn of 0.02 rad bends a step of ten metres by 2 mm
_STEPS_BETWEEN = 10  # anchors between two looks at whose turn it is; between them nobody turns far
_FINAL_STEPS = 2  # at the end of the track, each with everything linearised again
_MAX_JUDGES = 100  # believed closures that judge a new one; more make no difference to it
_GROWTH = 1.5  # by this factor doubtful closures must have grown in number before all are judged together again

_MISFIT = float(chdtri(6, 1e-4))  # squared residual of a relative pose that hardly a true closure has


class IncrementalSolver:
    """Least squares over a graph that grows.

    QR, not Cholesky: tight odometry over a long dive is too much for the latter.
    """

    def __init__(self) -> None:
        params, thresholds = gtsam.ISAM2Params(), gtsam.ISAM2ThresholdMap()
        thresholds.insert((chr(0), _RELINEARISE))  # of keys that are plain numbers
        params.setRelinearizeThreshold(thresholds)
        params.relinearizeSkip = _STEPS_BETWEEN
        params.setFactorization("QR")
        self._isam = gtsam.ISAM2(params)
        self._n_anchors = 0

    @property
    def n_anchors(self) -> int:
        """Number of anchors taken in."""
        return self._n_anchors

    def update(self, factors: Sequence[gtsam.NonlinearFactor], T_new: FloatArray) -> None:
        """Take in factors and anchors.

        Parameters
        ----------
        factors : sequence of gtsam.NonlinearFactor
            All that is new, of old anchors and of these.
        T_new : ndarray, shape (K, 4, 4)
            Where the new anchors start; they are numbered on from the last.
        """
        values = gtsam.Values()
        for k, T in enumerate(T_new):
            values.insert(self._n_anchors + k, gtsam.Pose3(T))
        self._isam.update(graph_of(factors), values)
        self._n_anchors += len(T_new)

    def pose(self, anchor: int) -> FloatArray:
        """Estimate of one anchor.

        Parameters
        ----------
        anchor : int
            Its number.

        Returns
        -------
        T_world_anchor : ndarray, shape (4, 4)
            Its body pose.
        """
        if not 0 <= anchor < self._n_anchors:
            raise ValueError(f"anchors so far are numbered 0..{self._n_anchors - 1}, got {anchor}")
        return np.asarray(self._isam.calculateEstimatePose3(anchor).matrix())

    def poses(self) -> FloatArray:
        """Estimate of all anchors.

        Returns
        -------
        T_world_anchor : ndarray, shape (S, 4, 4)
            Body poses.
        """
        return poses_of(self._isam.calculateEstimate())


class IncrementalGraph:
    """A graph that is told of its anchors one by one, and judges closures as they come.

    Parameters
    ----------
    offer : Offer
        The whole graph; what lies ahead is not looked at before its anchor is reached.
    """

    def __init__(self, offer: Offer) -> None:
        self._offer = offer
        self._problem = offer.problem
        self.scale = 1.0
        self.believed: IntArray = np.zeros(0, dtype=np.int64)
        self._arrived: IntArray = np.zeros(0, dtype=np.int64)
        self._n_doubtful = 1.0
        self._factors = _by_last_anchor(offer.problem, self.scale)
        self.solver = IncrementalSolver()

    def advance(self, arriving: IntArray) -> None:
        """Take in the next anchor, with the closures that end at it.

        Parameters
        ----------
        arriving : ndarray of int, shape (K,)
            Positions of these closures.
        """
        anchor = self.solver.n_anchors
        T_start = self._problem.T_world_anchor_dr[0]
        if anchor > 0:
            T_start = self.solver.pose(anchor - 1) @ self._problem.odometry[anchor - 1].T_target_source
        self.solver.update(self._factors[anchor], T_start[None])
        if arriving.size:
            self._arrived = np.sort(np.concatenate([self._arrived, arriving]))
            self._judge()

    def settle(self) -> None:
        """Choose among all closures as if the whole track had come at once, and solve for them."""
        if self.solver.n_anchors < len(self._problem.T_world_anchor_dr):
            n, whole = self.solver.n_anchors, len(self._problem.T_world_anchor_dr)
            raise ValueError(f"only {n} of {whole} anchors have come; the whole track is wanted before settle")
        believed, scale = self.believed, self.scale
        if self._arrived.size:
            belief = believe_consistent(replace(self._offer, closures=self._arrived))
            believed, scale = belief.believed, belief.odometry_scale
        for _ in range(_FINAL_STEPS):
            self._begin_again(believed, scale)

    def _judge(self) -> None:
        """Believe what the believed closures speak for; judge all anew when many are in doubt."""
        doubtful = np.setdiff1d(self._arrived, self.believed)
        if self.believed.size:
            few = np.linspace(0, self.believed.size - 1, min(_MAX_JUDGES, self.believed.size)).astype(np.int64)
            compared = self._compared(np.concatenate([self.believed[few], doubtful]))
            judges, judged = compared[: few.size], compared[few.size :]
            surplus, _ = surpluses(judged, judges, self.scale, self._offer.consistency.false_cost)
            self._believe(doubtful[surplus > 0.0])
            doubtful = doubtful[surplus <= 0.0]
        if doubtful.size >= self._n_doubtful:
            self._n_doubtful = _GROWTH * doubtful.size + 1.0
            self._judge_together()

    def _judge_together(self) -> None:
        """Find the set that agrees best, without what does not fit the graph."""
        self._adopt(consistent_closures(self._compared(self._arrived), self._offer.consistency))
        fits = residual_distances(self.solver.poses(), self._problem.chosen(self.believed)) <= _MISFIT
        if not fits.all():
            self._begin_again(self.believed[fits], self.scale)

    def _adopt(self, consistent: ConsistentSet) -> None:
        """Believe a set of those so far; begin the solution again where it leaves some out or stretches otherwise."""
        members = self._arrived[consistent.is_member]
        if consistent.odometry_scale == self.scale and np.isin(self.believed, members).all():
            self._believe(np.setdiff1d(members, self.believed))
        else:
            self._begin_again(members, consistent.odometry_scale)

    def _compared(self, closures: IntArray) -> Innovations:
        """Closures against the dead reckoning so far, about the present poses."""
        return self._problem.compared(self.solver.poses(), closures)

    def _believe(self, closures: IntArray) -> None:
        """Let closures hold the graph from now on."""
        if closures.size:
            self.solver.update(between_factors(self._problem.chosen(closures)), np.zeros((0, 4, 4)))
            self.believed = np.sort(np.concatenate([self.believed, closures]))

    def _begin_again(self, members: IntArray, scale: float) -> None:
        """Solve all so far with other closures, or with odometry of another scale."""
        T, n = self.solver.poses(), self.solver.n_anchors
        self.scale, self.believed = scale, members
        self._factors = _by_last_anchor(self._problem, scale)
        self.solver = IncrementalSolver()
        known = [factor for anchor in range(n) for factor in self._factors[anchor]]
        self.solver.update([*known, *between_factors(self._problem.chosen(members))], T)


def believe_incrementally(offer: Offer) -> Belief:
    """Go along the track and believe closures as they come.

    Parameters
    ----------
    offer : Offer
        The graph and the closures to choose from.

    Returns
    -------
    belief : Belief
        The closures believed at the end.
    """
    graph = IncrementalGraph(offer)
    last = np.array([max(c.target, c.source) for c in offer.problem.chosen(offer.closures)], dtype=np.int64)
    for anchor in range(len(offer.problem.T_world_anchor_dr)):
        graph.advance(offer.closures[last == anchor])
    graph.settle()
    return Belief(graph.believed, graph.scale, graph.solver.poses())


def _by_last_anchor(problem: Problem, scale: float) -> list[list[gtsam.NonlinearFactor]]:
    """All factors but the closures', by the anchor at which they can be known."""
    factors: list[list[gtsam.NonlinearFactor]] = [[] for _ in problem.T_world_anchor_dr]
    for factor in problem.known_factors(scale):
        factors[max(factor.keys())].append(factor)
    return factors
