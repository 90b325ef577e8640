"""Atlas: uncertainty from frame to frame, projected along the surest path through a graph of local frames.

The frames are the anchors; odometry and believed closures are the edges. What is known of one frame seen from another
is what adds up along the path on which it is least uncertain, found by Dijkstra's algorithm, as Bosse et al. do ("An
Atlas framework for scalable mapping", ICRA 2003). It is no less than what a full solution leaves, and costs none.
"""

import heapq
from collections.abc import Iterable

import numpy as np
from scipy.special import chdtri

from backend.arrays import FloatArray
from backend.beliefs import Offer, believed_set, start_poses
from backend.consistency import credible_set
from backend.poses import RelativePose, adjoint, invert, logarithm, sandwich, tangent_covariance
from backend.problem import Belief

_PLANAR = np.array([2, 3, 4])  # yaw, x, y in a 6-vector


class Atlas:
    """A graph of local frames.

    Parameters
    ----------
    n_frames : int
        Number of frames.
    edges : iterable of RelativePose
        What joins them.
    """

    def __init__(self, n_frames: int, edges: Iterable[RelativePose] = ()) -> None:
        self._neighbours: list[list[tuple[int, FloatArray, FloatArray]]] = [[] for _ in range(n_frames)]
        for edge in edges:
            self.add(edge)

    def add(self, edge: RelativePose) -> None:
        """Join two frames, in both directions.

        Parameters
        ----------
        edge : RelativePose
            The measurement between them.
        """
        T, covariance = edge.T_target_source, tangent_covariance(edge.T_target_source, edge.covariance)
        self._neighbours[edge.target].append((edge.source, T, covariance))
        self._neighbours[edge.source].append((edge.target, invert(T), sandwich(adjoint(T), covariance)))

    def project(self, target: int, source: int) -> tuple[FloatArray, FloatArray]:
        """Pose of a frame seen from another, along the path that leaves least doubt of where it is.

        Parameters
        ----------
        target, source : int
            Two frames.

        Returns
        -------
        T_target_source : ndarray, shape (4, 4)
            The relative pose.
        covariance : ndarray, shape (6, 6)
            In the tangent, along the source's axes, rotation first [rad**2, rad m, m**2].

        Raises
        ------
        ValueError
            If no path joins the two.
        """
        queue = [(0.0, 0, target, np.eye(4), np.zeros((6, 6)))]
        settled, n_pushed = set(), 0
        while queue:
            _, _, frame, T, covariance = heapq.heappop(queue)
            if frame == source:
                return T, covariance
            if frame in settled:
                continue
            settled.add(frame)
            for neighbour, T_step, step in self._neighbours[frame]:
                if neighbour not in settled:
                    n_pushed += 1  # keeps the order of equals, and arrays from being compared
                    further = sandwich(adjoint(invert(T_step)), covariance) + step
                    heapq.heappush(queue, (_doubt(further), n_pushed, neighbour, T @ T_step, further))
        raise ValueError(f"frames {target} and {source} are not joined by any path")

    def squared_distance(self, closure: RelativePose) -> float:
        """How far a closure lies from what the atlas projects.

        Parameters
        ----------
        closure : RelativePose
            The measurement.

        Returns
        -------
        distance : float
            Squared Mahalanobis distance in yaw, x and y.
        """
        T, covariance = self.project(closure.target, closure.source)
        own = tangent_covariance(closure.T_target_source, closure.covariance)
        error = logarithm((invert(T) @ closure.T_target_source)[None])[0, _PLANAR]
        total = (covariance + own)[np.ix_(_PLANAR, _PLANAR)]
        return float(error @ np.linalg.solve(total, error))


def _doubt(covariance: FloatArray) -> float:
    """What Dijkstra's algorithm adds up: the variance of the position, which never shrinks along a path."""
    return float(np.trace(covariance[3:, 3:]))


def believe_inside_gates(offer: Offer) -> Belief:
    """Believe one closure after the other, as they come along the track, if it lies inside the gate of the atlas.

    Parameters
    ----------
    offer : Offer
        The graph and the closures to choose from.

    Returns
    -------
    belief : Belief
        Those inside, if they are credible; dead reckoning is taken to be as good as its model.
    """
    problem, config, believed = offer.problem, offer.consistency, []
    atlas = Atlas(len(problem.T_world_anchor_dr), problem.odometry)
    gate = float(chdtri(len(_PLANAR), 1.0 - config.pair_probability))
    for position in sorted(offer.closures.tolist(), key=lambda one: _arrival(problem.closures[one])):
        closure = problem.closures[position]
        if atlas.squared_distance(closure) < gate:
            atlas.add(closure)
            believed.append(position)
    T, inside = start_poses(problem), np.flatnonzero(np.isin(offer.closures, believed))
    return believed_set(offer, credible_set(problem.compared(T, offer.closures), inside, 1.0, config), T)


def _arrival(closure: RelativePose) -> tuple[int, int]:
    """When a closure can be known: at the later of its ends."""
    return max(closure.target, closure.source), min(closure.target, closure.source)
