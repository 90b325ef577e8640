"""Comparison: submaps with their surroundings made ready for comparing, each once for all its partners."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import invert, planar_parameters, transform
from frontend.overlap import Layers, stack_layers
from frontend.pairs import PriorCovariance
from frontend.relief import Relief, ReliefConfig, extract_relief
from frontend.search import SearchConfig
from frontend.submaps import Submap
from frontend.surroundings import lay_beside, meeting_ping, neighbours
from frontend.turning import TurnedRelief
from frontend.verification import Verification

_MOST_PLACES = 96  # held at a time, some 15 MB each; a submap has some 40 partners


@dataclass(frozen=True)
class Place:
    """What comparing a submap needs.

    Parameters
    ----------
    number : int
        Of the submap.
    layers : Layers
        Its rasters with those of its surroundings.
    turned : TurnedRelief
        The same for the search.
    members : range
        Positions of the submaps that are part of it.
    anchors : ndarray, shape (len(members), 2)
        Where dead reckoning has their anchors in the submap's frame [m].
    """

    number: int
    layers: Layers
    turned: TurnedRelief
    members: range
    anchors: FloatArray

    def member_at(self, point: FloatArray) -> int:
        """Position of the member whose anchor is nearest to a point.

        Parameters
        ----------
        point : ndarray, shape (2,)
            In the submap's frame [m].

        Returns
        -------
        position : int
            The submap whose pings have seen the floor there, or nearly so.
        """
        return self.members[int(np.argmin(np.hypot(*(self.anchors - point).T)))]

    def ahead_of_anchor(self, point: FloatArray) -> float:
        """How far a point lies ahead of the nearest member's anchor.

        Parameters
        ----------
        point : ndarray, shape (2,)
            In the submap's frame [m].

        Returns
        -------
        distance : float
            Along the submap's heading [m]; the rest of the way is drift between anchors.
        """
        return float(point[0] - self.anchors[self.member_at(point) - self.members.start, 0])


class Places:
    """The places of a dive, each made when asked for; the last ones asked for are kept.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps of a dive, in order.
    relief : ReliefConfig
        Which part of the heights is compared.
    search : SearchConfig
        Cells and turns of the search.
    """

    def __init__(self, submaps: Sequence[Submap], relief: ReliefConfig, search: SearchConfig) -> None:
        self._submaps, self._band, self._search = submaps, relief, search
        self._reliefs: dict[int, Relief] = {}
        self._made: dict[tuple[int, range], Place] = {}

    def sides(self, target: int, source: int) -> tuple[Place, Place]:
        """Both sides of a pair, without a common ping.

        Parameters
        ----------
        target, source : int
            Positions of two submaps, the target the earlier.

        Returns
        -------
        target, source : Place
            Each with those of its neighbours that end before, or begin after, the middle between the two.
        """
        middle = meeting_ping(self._submaps[target], self._submaps[source])
        return self._place(target, (0, middle)), self._place(source, (middle, self._submaps[-1].end_ping))

    def _place(self, k: int, pings: tuple[int, int]) -> Place:
        """A submap with its neighbours inside a range of pings."""
        members = neighbours(self._submaps, k, pings)
        place = self._made.pop((k, members), None) or self._make(k, members)
        self._made[k, members] = place  # the last asked for last
        if len(self._made) > _MOST_PLACES:
            del self._made[next(iter(self._made))]
        return place

    def _make(self, k: int, members: range) -> Place:
        """A submap with these neighbours."""
        own = self._submaps[k]
        relief = lay_beside(self._submaps, {m: self._relief(m) for m in members}, k, members)
        heading = planar_parameters(own.T_world_submap_dr)[2]
        turned = TurnedRelief(relief, heading, self._search.yaw_step, self._search.search_spacing)
        T = invert(own.T_world_submap_dr)
        anchors = np.stack([(T @ self._submaps[m].T_world_submap_dr)[:2, 3] for m in members])
        return Place(own.number, stack_layers(relief), turned, members, anchors)

    def _relief(self, k: int) -> Relief:
        """The relief of a submap alone."""
        if k not in self._reliefs:
            self._reliefs[k] = extract_relief(self._submaps[k], self._band)
        return self._reliefs[k]


def with_drift(
    verification: Verification,
    sides: tuple[Place, Place],
    positions: tuple[int, int],
    covariance: PriorCovariance,
    misalignment: float = 0.0,
) -> Verification:
    """Add to an alignment's sigmas what dead reckoning may be wrong between the anchors and the floor compared.

    Parameters
    ----------
    verification : Verification
        An alignment.
    sides : tuple of Place
        Target and source.
    positions : tuple of int
        Their positions among the submaps.
    covariance : callable
        Covariance (6, 6) of the pose of one submap seen from an earlier one by dead reckoning, rotation first.
    misalignment : float
        Standard deviation of the turn of the velocity against the heading [rad], the same for all submaps.

    Returns
    -------
    verification : Verification
        The same alignment, less sure where the overlap lies on the neighbours' floor or far ahead of an anchor.

    Notes
    -----
    Beams stand athwart the heading and pings along the velocity, so a misalignment m shears a window: a place x ahead
    of the anchor lies m x too far to port. The alignment is then in error by ``m ([0, x_t] - R_target_source
    [0, x_s])``, nothing where two passes in one direction see a place at the same distance ahead.
    """
    R, variance = verification.T_target_source[:2, :2], verification.sigmas**2
    points = _middles(verification)
    ahead = [side.ahead_of_anchor(there) for side, there in zip(sides, points, strict=True)]
    sheared = misalignment * (np.array([0.0, ahead[0]]) - R @ np.array([0.0, ahead[1]]))
    variance[3:5] += sheared**2
    for side, position, there in zip(sides, positions, points, strict=True):
        member = side.member_at(there)
        if member != position:
            C = covariance(min(position, member), max(position, member))
            shift = (C[3, 3] + C[4, 4]) / 2  # along and across differ, and turn with the pair
            variance = variance + np.array([0.0, 0.0, C[2, 2], shift, shift, 0.0])
    return replace(verification, sigmas=np.sqrt(variance))


def is_of_neighbours(verification: Verification, sides: tuple[Place, Place], positions: tuple[int, int]) -> bool:
    """Whether neighbours of both submaps have seen the floor compared.

    Parameters
    ----------
    verification : Verification
        An alignment.
    sides : tuple of Place
        Target and source.
    positions : tuple of int
        Their positions among the submaps.

    Returns
    -------
    is_of_neighbours : bool
        True where a pair of theirs says the same and knows it better.
    """
    seen = zip(sides, positions, _middles(verification), strict=True)
    return all(side.member_at(there) != position for side, position, there in seen)


def _middles(verification: Verification) -> tuple[FloatArray, FloatArray]:
    """Middle of the overlap in the target's and in the source's frame [m]."""
    point = np.array([*verification.middle, 0.0])
    return transform(verification.T_target_source, point)[:2], point[:2]
