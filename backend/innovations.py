"""What loop closures say about the drift: how each disagrees with dead reckoning, and how that hangs together.

With ``E = T_world_target T_target_source T_world_source**-1`` a closure tells the planar motion (yaw, x, y) of the
world that would make dead reckoning right: the identity if it was. Dead reckoning errs by sums of independent steps,
so two closures share exactly the steps that both of their loops contain.

All this is linear, and holds about the poses at which it is taken: dead reckoning at first, a solution of the graph
later, for a long dive turns and shifts by more than a linear model bears. About other poses than dead reckoning's the
odometry disagrees with the poses too, and what its steps explain of a closure is taken off.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from backend.arrays import BoolArray, FloatArray, IntArray
from backend.poses import cross_matrix, invert, sandwich
from backend.stacks import RelativeStack

# fields that hold a row for each closure
_OF_EACH = ("yaw", "shift", "noise", "first", "last", "explained", "reach", "chance", "ahead")


@dataclass(frozen=True)
class Innovations:
    """Disagreement of closures with dead reckoning, as planar motions about the middle of the survey.

    Parameters
    ----------
    yaw : ndarray, shape (C,)
        Turn [rad].
    shift : ndarray, shape (C, 2)
        Shift of the world's middle [m].
    noise : ndarray, shape (C, 3, 3)
        Covariance of the closure itself: yaw, x, y.
    first, last : ndarray of int, shape (C,)
        The anchors that the loop joins, the earlier and the later.
    drift : ndarray, shape (S, 3, 3)
        Covariance of dead reckoning from anchor 0 to each anchor.
    explained : ndarray, shape (C, 3)
        Yaw, x, y that the odometry of each loop says; zero about dead-reckoned poses.
    reach : ndarray, shape (C,)
        Standard deviation of dead reckoning between the two ends, along its worst horizontal direction [m].
    chance : ndarray, shape (C,)
        Expected number of false closures as good as each [1].
    ahead : ndarray, shape (C, 2)
        Where the earlier anchor heads: east and north of a unit vector.
    """

    yaw: FloatArray
    shift: FloatArray
    noise: FloatArray
    first: IntArray
    last: IntArray
    drift: FloatArray
    explained: FloatArray
    reach: FloatArray
    chance: FloatArray
    ahead: FloatArray

    def __len__(self) -> int:
        return len(self.yaw)

    def __getitem__(self, chosen: IntArray | BoolArray | slice) -> "Innovations":
        return replace(self, **{name: getattr(self, name)[chosen] for name in _OF_EACH})

    def joined(self, others: "Innovations") -> "Innovations":
        """These closures and then others of the same dive.

        Parameters
        ----------
        others : Innovations
            Compared with the same dead reckoning.

        Returns
        -------
        joined : Innovations
            All of both.
        """
        both = {name: np.concatenate([getattr(self, name), getattr(others, name)]) for name in _OF_EACH}
        return replace(self, **both)

    @property
    def own_drift(self) -> FloatArray:
        """Shape (C, 3, 3): covariance of dead reckoning between the two ends of each."""
        return np.asarray(self.drift[self.last] - self.drift[self.first])

    @property
    def squared_distances(self) -> FloatArray:
        """Shape (C,): square of each residual over its covariance by itself, dead reckoning as modelled."""
        whitened = np.linalg.solve(self.own_drift + self.noise, self.residuals[..., None])[..., 0]
        return np.asarray(np.einsum("ai,ai->a", self.residuals, whitened))

    @property
    def residuals(self) -> FloatArray:
        """Shape (C, 3): the motions as tangent vectors (yaw, x, y), less what odometry explains."""
        return _planar_logarithm(self.yaw, self.shift) - self.explained

    def shared_drift(self, other: "Innovations") -> FloatArray:
        """Covariance of the dead reckoning in two sets of loops.

        Parameters
        ----------
        other : Innovations
            The second set, of D closures.

        Returns
        -------
        covariance : ndarray, shape (C, D, 3, 3)
            Of each closure here with each one there.
        """
        begin = np.maximum(self.first[:, None], other.first)
        end = np.maximum(np.minimum(self.last[:, None], other.last), begin)
        return np.asarray(self.drift[end] - self.drift[begin])

    def joint_covariance(self, scale: float) -> FloatArray:
        """Covariance of all residuals together.

        Parameters
        ----------
        scale : float
            Dead reckoning is this much worse than said.

        Returns
        -------
        covariance : ndarray, shape (3 C, 3 C)
            Closure by closure: yaw, x, y.
        """
        blocks = scale**2 * self.shared_drift(self)
        each = np.arange(len(self))
        blocks[each, each] += self.noise
        return blocks.transpose(0, 2, 1, 3).reshape(3 * len(self), 3 * len(self))

    def pair_distances(self, scale: float) -> FloatArray:
        """How far every two closures disagree.

        Parameters
        ----------
        scale : float
            Dead reckoning is this much worse than said.

        Returns
        -------
        distances : ndarray, shape (C, C)
            Squared Mahalanobis distances; chi-square of 3 degrees of freedom for two true closures.
        """
        drift = self.shared_drift(self)
        own = np.diagonal(drift).transpose(2, 0, 1)
        apart = own[:, None] + own[None, :] - 2.0 * drift
        covariance = self.noise[:, None] + self.noise[None, :] + scale**2 * apart
        difference = _planar_difference(self.yaw, self.shift) - (self.explained[:, None] - self.explained)
        solved = np.linalg.solve(covariance, difference[..., None])[..., 0]
        return np.asarray(np.einsum("abi,abi->ab", difference, solved))


def innovations(
    T_world_anchor: FloatArray,
    odometry: RelativeStack,
    closures: RelativeStack,
    chance: ArrayLike = 1.0,
) -> Innovations:
    """Compare closures with dead reckoning.

    Parameters
    ----------
    T_world_anchor : ndarray, shape (S, 4, 4)
        Poses of the anchors to take it about: dead-reckoned ones, or a solution.
    odometry : RelativeStack, length S - 1
        From each anchor to the next, in order.
    closures : RelativeStack, length C
        The loop closures.
    chance : array_like, shape (C,)
        Expected number of false closures as good as each [1]; 1 where nobody knows.

    Returns
    -------
    innovations : Innovations
        One row a closure.
    """
    T = T_world_anchor.copy()
    T[:, :3, 3] -= T[:, :3, 3].mean(axis=0)
    drift = _cumulated(_world_covariances(T, odometry))
    walked = _cumulated(_planar_logarithm(*_world_motions(T, odometry)))
    yaw, shift = _world_motions(T, closures)
    first, last = np.minimum(closures.target, closures.source), np.maximum(closures.target, closures.source)
    noise, explained = _world_covariances(T, closures), walked[last] - walked[first]
    reach = _reach(drift[last] - drift[first], T[last, :2, 3])
    expected = np.broadcast_to(np.asarray(chance, dtype=np.float64), (len(closures),))
    ahead = T[first, :2, 0] / np.linalg.norm(T[first, :2, 0], axis=1, keepdims=True)
    return Innovations(yaw, shift, noise, first, last, drift, explained, reach, expected, ahead)


def _cumulated(steps: FloatArray) -> FloatArray:
    """Sums over the steps up to each anchor."""
    return np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])


def _world_motions(T_world_anchor: FloatArray, relative: RelativeStack) -> tuple[FloatArray, FloatArray]:
    """Yaw and shift of the world that would make the poses agree with relative poses, as the later end sees it."""
    target, source = T_world_anchor[relative.target], T_world_anchor[relative.source]
    measured = target @ relative.T_target_source
    is_forward = (relative.target < relative.source)[:, None, None]
    there, back = np.where(is_forward, measured, source), np.where(is_forward, source, measured)
    error = there @ invert(back)
    return np.arctan2(error[:, 1, 0] - error[:, 0, 1], error[:, 0, 0] + error[:, 1, 1]), error[:, :2, 3]


def _reach(drift: FloatArray, position: FloatArray) -> FloatArray:
    """Standard deviation along the worst horizontal direction of world motions, where they move a position."""
    at_position = np.concatenate([np.stack([-position[:, 1], position[:, 0]], axis=1)[..., None], _eyes(len(drift))], 2)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(sandwich(at_position, drift))[:, -1], 0.0))


def _eyes(n: int) -> FloatArray:
    """A stack of 2 x 2 identities."""
    return np.tile(np.eye(2), (n, 1, 1))


def _world_covariances(T_world_anchor: FloatArray, relative: RelativeStack) -> FloatArray:
    """Covariances of relative poses as planar twists about the world's origin."""
    T = T_world_anchor[relative.target]
    R, position = T[:, :3, :3], T[:, :3, 3]
    source = position + (R @ relative.T_target_source[:, :3, 3:])[..., 0]  # an error turns about the target
    planar = np.zeros((len(T), 3, 6))  # from target axes to yaw, x, y: rows of Ad(T) times the turn's lever arm
    planar[:, 0, :3] = R[:, 2]
    planar[:, 1:, 3:] = R[:, :2]
    planar[:, 1:, :3] = cross_matrix(source)[:, :2] @ R
    return sandwich(planar, relative.covariance)


def _planar_logarithm(yaw: FloatArray, shift: FloatArray) -> FloatArray:
    """Tangent vectors (yaw, x, y) of planar motions."""
    half = 0.5 * yaw
    safe = np.where(np.abs(half) < 1e-6, 1.0, half)  # below, half cot(half) is one to rounding
    along = np.where(np.abs(half) < 1e-6, 1.0, safe / np.tan(safe))
    x, y = shift[..., 0], shift[..., 1]
    return np.stack([yaw, along * x + half * y, along * y - half * x], axis=-1)


def _planar_difference(yaw: FloatArray, shift: FloatArray) -> FloatArray:
    """Tangent vectors of the motions from each closure's (columns) to each other's (rows)."""
    turn = (yaw[:, None] - yaw[None, :] + np.pi) % (2.0 * np.pi) - np.pi
    apart = shift[:, None] - shift[None, :]
    cos, sin = np.cos(yaw)[None, :], np.sin(yaw)[None, :]
    turned = [cos * apart[..., 0] + sin * apart[..., 1], cos * apart[..., 1] - sin * apart[..., 0]]
    return _planar_logarithm(turn, np.stack(turned, axis=-1))
