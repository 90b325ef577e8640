"""Pairs: which submaps may show the same place, by dead reckoning and by the likeness of their features."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Protocol, runtime_checkable

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import AnyArray, FloatArray, IntArray
from frontend.coverage import OUTLINE_STEP, Coverage, coverage_of, possible_overlap
from frontend.features import Features
from frontend.frames import invert
from frontend.place_index import PlaceIndex
from frontend.priors import Prior
from frontend.submaps import Submap
from frontend.trajectory import Trajectory

PriorCovariance = Callable[[int, int], FloatArray]
_FEW = 64  # submaps that there is room for at first
_AT_ONCE = 96  # targets asked about together: about as many as are looked at where the gate holds all


@runtime_checkable
class ManyPriorCovariances(Protocol):
    """A `PriorCovariance` that is faster asked about many pairs at once."""

    def many(self, targets: IntArray, source: int) -> FloatArray:
        """Covariances of one source seen from many targets.

        Parameters
        ----------
        targets : ndarray of int, shape (P,)
            Positions of submaps.
        source : int
            Position of a submap.

        Returns
        -------
        covariances : ndarray, shape (P, 6, 6)
            As one by one.
        """


class PairConfig(BaseModel):
    """Which submaps are compared."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    gate: float = Field(
        default=3.0, gt=0, description="Half-width of the gate around dead reckoning [standard deviations]."
    )
    min_separation: float = Field(
        default=2.0,
        gt=0,
        description="Distance along the track between two submaps [window lengths]; nearer ones are odometry.",
    )
    min_overlap: float = Field(
        default=0.2,
        gt=0,
        le=1,
        description="Overlap that must be possible inside the gate [share of the smaller submap].",
    )
    max_partners: int = Field(
        default=40,
        gt=0,
        description="Earlier submaps that one is compared with [1]; where the gate admits more, those with the most "
        "alike features: a wide gate over a long dive would hold nearly all.",
    )
    n_anywhere: int = Field(
        default=0,
        ge=0,
        description="Earlier submaps outside the gate that one is compared with as well, those most alike [1], heading "
        "unknown: for a vehicle that was lost or another dive's submaps. 0 trusts the gate.",
    )


@dataclass(frozen=True)
class Partners:
    """Earlier submaps that one is to be compared with.

    Parameters
    ----------
    in_gate : ndarray of int, shape (P,)
        Positions of those that dead reckoning allows, in order.
    anywhere : ndarray of int, shape (Q,)
        Positions of others whose features are alike, the most alike first.
    """

    in_gate: IntArray
    anywhere: IntArray


class PairFinder:
    """Finds the partners of one submap after the other; what it costs grows little with their number.

    Parameters
    ----------
    config : PairConfig, optional
        Gate, distances and numbers.
    """

    def __init__(self, config: PairConfig | None = None) -> None:
        self.config = config or PairConfig()
        self._index = PlaceIndex()
        self._submaps: list[Submap] = []
        self._coverage: list[Coverage] = []
        self._rows = np.empty((_FEW, _SINE + 1))  # grows by doubling

    def __len__(self) -> int:
        return len(self._submaps)

    def add(
        self, submap: Submap, features: Features | None, distance: FloatArray, prior_covariance: PriorCovariance
    ) -> Partners:
        """Find the partners of the next submap among those before.

        Parameters
        ----------
        submap : Submap
            The next of a dive.
        features : Features or None
            Its features; without them nothing is ranked, and the nearest inside the gate come first.
        distance : ndarray, shape (N,)
            Way along the track of all pings so far [m].
        prior_covariance : callable
            Covariance (6, 6) of ``T_target_source`` by dead reckoning for two positions.

        Returns
        -------
        partners : Partners
            Positions of earlier submaps.
        """
        coverage = coverage_of(submap)
        row = _row_of(submap, coverage, distance)
        descriptors = features.descriptors if features is not None else np.empty((0, 33))
        votes = self._index.votes(descriptors)
        partners = self._partners(submap, row, coverage, votes, prior_covariance)
        if len(self) == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[len(self)] = row
        self._index.add(descriptors)
        self._submaps.append(submap)
        self._coverage.append(coverage)
        return partners

    def _partners(
        self, source: Submap, row: tuple[float, ...], coverage: Coverage, votes: FloatArray, prior: PriorCovariance
    ) -> Partners:
        """Those inside the gate and the most alike of the rest."""
        rows = self._rows[: len(self)]
        apart = _are_apart(rows, row, self.config.min_separation)
        gap = np.hypot(rows[:, _X] - row[_X], rows[:, _Y] - row[_Y])
        alike = np.lexsort([gap, -votes])
        alike = alike[apart[alike]]
        overlapping = self._overlapping(alike, source, row, coverage, prior)
        in_gate = np.array(sorted(islice(overlapping, self.config.max_partners)), dtype=np.int64)
        others = alike[~np.isin(alike, in_gate) & (votes[alike] > 0)]
        return Partners(in_gate, others[: self.config.n_anywhere])

    def _overlapping(
        self, targets: IntArray, source: Submap, row: tuple[float, ...], coverage: Coverage, prior: PriorCovariance
    ) -> Iterator[int]:
        """Those of the targets that may overlap enough inside the gate, looked for as they are asked for."""
        for first in range(0, len(targets), _AT_ONCE):
            some = targets[first : first + _AT_ONCE]
            covariances = _covariances(prior, some, len(self))
            near = _can_meet(self._rows[some], row, covariances, self.config.gate)
            for t, covariance in zip(some[near].tolist(), covariances[near], strict=True):
                if self._possible_overlap(t, source, coverage, covariance) >= self.config.min_overlap:
                    yield t

    def _possible_overlap(self, target: int, source: Submap, coverage: Coverage, covariance: FloatArray) -> float:
        """Share of the smaller submap that overlaps at best inside the gate."""
        T_dr = predicted_transform(self._submaps[target], source)
        return possible_overlap(self._coverage[target], coverage, Prior(T_dr, covariance, self.config.gate))


def pairs_to_compare(
    submaps: Sequence[Submap],
    trajectory_dr: Trajectory,
    prior_covariance: PriorCovariance,
    config: PairConfig | None = None,
    features: Sequence[Features] | None = None,
) -> list[tuple[int, int]]:
    """Pairs of submaps that are no neighbours and may overlap inside the gate.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps of a dive, in order.
    trajectory_dr : Trajectory
        Dead-reckoned body poses of all pings of the recording.
    prior_covariance : callable
        Covariance (6, 6) of ``T_target_source`` by dead reckoning for two positions in ``submaps``.
    config : PairConfig, optional
        Gate and distances.
    features : sequence of Features, optional
        Their features, which rank the partners where the gate holds too many.

    Returns
    -------
    pairs : list of (int, int)
        Positions in ``submaps``, target before source.
    """
    known = features if features is not None else [None] * len(submaps)
    return all_pairs(submaps, known, trajectory_dr, prior_covariance, config)[0]


def all_pairs(
    submaps: Sequence[Submap],
    features: Sequence[Features | None],
    trajectory_dr: Trajectory,
    prior_covariance: PriorCovariance,
    config: PairConfig | None = None,
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Pairs of submaps worth comparing, by dead reckoning and by appearance.

    Parameters
    ----------
    submaps, features : sequence
        The submaps of a dive, in order, and their features; None where those are not known.
    trajectory_dr, prior_covariance, config
        As for `pairs_to_compare`.

    Returns
    -------
    in_gate, anywhere : list of (int, int)
        Positions in ``submaps``, target before source: the pairs of `pairs_to_compare`, and others whose features are
        alike.
    """
    finder, distance = PairFinder(config), trajectory_dr.distance
    partners = [finder.add(s, f, distance, prior_covariance) for s, f in zip(submaps, features, strict=True)]
    in_gate = [(int(target), source) for source, found in enumerate(partners) for target in found.in_gate]
    return in_gate, [(int(target), source) for source, found in enumerate(partners) for target in found.anywhere]


def predicted_transform(target: Submap, source: Submap) -> FloatArray:
    """Transform between two submaps by dead reckoning.

    Parameters
    ----------
    target, source : Submap
        The two submaps.

    Returns
    -------
    T_target_source : ndarray, shape (4, 4)
        Takes points of the source's level frame to the target's.
    """
    return np.asarray(invert(target.T_world_submap_dr) @ source.T_world_submap_dr)


# of a row: centre, radius [m], pings, way to, way along [m], and where the submap's x axis points
_X, _Y, _REACH, _FIRST, _END, _ANCHOR, _LENGTH, _COSINE, _SINE = range(9)
_SLACK = 0.02  # [m^2], twice what a prior adds to variances itself


def _row_of(submap: Submap, coverage: Coverage, distance: FloatArray) -> tuple[float, ...]:
    """What decides at a glance whether a submap can be a partner."""
    T, cells = submap.T_world_submap_dr, coverage.cells
    middle = cells.mean(axis=0) if len(cells) else np.zeros(2)
    x, y = T[:2, :2] @ middle + T[:2, 3]
    reach = float(np.hypot(*(cells - middle).T).max(initial=0.0)) + OUTLINE_STEP
    length = distance[submap.end_ping - 1] - distance[submap.first_ping]
    along = (distance[submap.anchor_ping], length)
    return x, y, reach, submap.first_ping, submap.end_ping, *along, T[0, 0], T[1, 0]


def _are_apart(targets: FloatArray, source: tuple[float, ...], n_windows: float) -> AnyArray:
    """Which submaps share no ping with a later one and lie far enough from it along the track, shape (P,)."""
    length = np.maximum(targets[:, _LENGTH], source[_LENGTH])
    way = source[_ANCHOR] - targets[:, _ANCHOR]
    return np.asarray((targets[:, _END] <= source[_FIRST]) & (way > n_windows * length))


def _covariances(prior_covariance: PriorCovariance, targets: IntArray, source: int) -> FloatArray:
    """Covariances of a source seen from targets, shape (P, 6, 6)."""
    if isinstance(prior_covariance, ManyPriorCovariances):
        return prior_covariance.many(targets, source)
    return np.array([prior_covariance(int(target), source) for target in targets]).reshape(-1, 6, 6)


def _can_meet(targets: FloatArray, source: tuple[float, ...], covariances: FloatArray, gate: float) -> AnyArray:
    """Which targets' circles the source's meets, drawn straight to them as far as a gate allows, shape (P,)."""
    away = targets[:, [_X, _Y]] - np.array([source[_X], source[_Y]])
    cosine, sine = targets[:, _COSINE], targets[:, _SINE]
    x, y = cosine * away[:, 0] + sine * away[:, 1], cosine * away[:, 1] - sine * away[:, 0]
    # covariances are of a level frame, a little widened: more can meet than those that really do
    xx, yy, xy = covariances[:, 3, 3] + _SLACK, covariances[:, 4, 4] + _SLACK, covariances[:, 3, 4]
    squared_distance = (yy * x**2 - 2 * xy * x * y + xx * y**2) / (xx * yy - xy**2)
    reach = np.sqrt(Prior(np.eye(4), np.eye(6), gate).limit / np.maximum(squared_distance, 1e-12))
    gap = np.hypot(x, y) * (1 - np.minimum(reach, 1.0)) - targets[:, _REACH] - source[_REACH]
    return np.asarray(gap <= 0)
