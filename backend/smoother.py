"""Rauch-Tung-Striebel smoothing of a closed-loop error-state filter, and what its gains say of two times together."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from backend.arrays import BoolArray, FloatArray, IntArray
from backend.inertial_state import N_STATES, State

_CHUNK = 4096  # pairs whose gains are held at a time


class Step(NamedTuple):
    """What the filter leaves behind of one epoch.

    Parameters
    ----------
    filtered : State
        The state at the epoch's begin, after the updates up to there.
    predicted : State
        The state at its end, before the updates there.
    gain : ndarray, shape (22, 22)
        How much of a correction at the end holds at the begin.
    remainder : ndarray, shape (22, 22)
        Covariance at the begin when the end is known.
    """

    filtered: State
    predicted: State
    gain: FloatArray
    remainder: FloatArray


def make_step(filtered: tuple[State, FloatArray], predicted: tuple[State, FloatArray], transition: FloatArray) -> Step:
    """Compute the smoother's gain of an epoch.

    Parameters
    ----------
    filtered, predicted : tuple of State and ndarray, shape (22, 22)
        State and covariance at the begin after, and at the end before the updates.
    transition : ndarray, shape (22, 22)
        From begin to end.

    Returns
    -------
    step : Step
        What smoothing needs.

    Notes
    -----
    ``gain = P F^T Q^-1`` with the predicted covariance ``Q``, in units in which the diagonal of ``Q`` is one: variances
    from a gyro's bias to a position's span twenty powers of ten.
    """
    (state, P), (later, Q) = filtered, predicted
    scale = 1.0 / np.sqrt(np.diag(Q))
    unit = Q * scale[:, None] * scale
    gain = np.linalg.solve(unit, (transition @ P) * scale[:, None]).T * scale
    remainder = P - gain @ Q @ gain.T
    return Step(state, later, gain, 0.5 * (remainder + remainder.T))


@dataclass(frozen=True)
class Smoothed:
    """A smoothed track: states at the edges of the epochs, and the joint covariance of any two.

    Parameters
    ----------
    time : ndarray, shape (E + 1,)
        The edges [s].
    attitude : ndarray, shape (E + 1, 3, 3)
        Rotation from the body to the world.
    vector : ndarray, shape (E + 1, 22)
        The rest of the states.
    columns : ndarray, shape (E + 1, 22, 4)
        Covariance of all errors with those of yaw, x, y and z.
    sensitivity : ndarray, shape (E + 1, 4, 22)
        How yaw, x, y and z depend on all errors.
    last_variances : ndarray, shape (22,)
        Variances at the end; those of the constants hold all along.
    blocks : tuple of ndarray
        Products of 1, 2, 4 ... gains in succession, shape (E // 1, 22, 22), (E // 2, 22, 22) and so on.
    """

    time: FloatArray
    attitude: FloatArray
    vector: FloatArray
    columns: FloatArray
    sensitivity: FloatArray
    last_variances: FloatArray
    blocks: tuple[FloatArray, ...]

    @property
    def covariances(self) -> FloatArray:
        """Shape (E + 1, 4, 4): covariance of yaw, x, y and z at every edge."""
        return self.sensitivity @ self.columns

    def cross_covariances(self, first: IntArray, second: IntArray) -> FloatArray:
        """Covariance between the errors at two edges.

        Parameters
        ----------
        first, second : ndarray of int, shape (P,)
            Edges, the first not later than the second.

        Returns
        -------
        covariance : ndarray, shape (P, 4, 4)
            Of yaw, x, y and z at the first with those at the second.
        """
        chunks = [slice(k, k + _CHUNK) for k in range(0, len(first), _CHUNK)]
        rows = [self._carried(first[chunk], second[chunk]) @ self.columns[second[chunk]] for chunk in chunks]
        return np.concatenate(rows) if rows else np.zeros((0, 4, 4))

    def _carried(self, first: IntArray, second: IntArray) -> FloatArray:
        """How yaw, x, y and z at the first edge follow a correction at the second, shape (P, 4, 22)."""
        carried, at = self.sensitivity[first], first.copy()
        levels = range(len(self.blocks))
        # blocks that grow until they are aligned with the longest, then blocks that shrink
        for level in levels:
            self._advance(carried, at, level, ((at >> level) % 2 == 1) & (at + (1 << level) <= second))
        for level in reversed(levels):
            self._advance(carried, at, level, at + (1 << level) <= second)
            self._advance(carried, at, level, at + (1 << level) <= second)
        return carried

    def _advance(self, carried: FloatArray, at: IntArray, level: int, chosen: BoolArray) -> None:
        """Multiply some by the block that begins where they are."""
        if chosen.any():
            carried[chosen] = carried[chosen] @ self.blocks[level][at[chosen] >> level]
            at[chosen] += 1 << level


def smooth(time: FloatArray, steps: Sequence[Step], last: tuple[State, FloatArray]) -> Smoothed:
    """Run the smoother backwards over what the filter left.

    Parameters
    ----------
    time : ndarray, shape (E + 1,)
        Edges of the epochs [s].
    steps : sequence of Step
        One an epoch.
    last : tuple of State and ndarray, shape (22, 22)
        State and covariance at the end.

    Returns
    -------
    smoothed : Smoothed
        The track with its covariance.

    References
    ----------
    .. [1] Rauch, Tung, Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal 3(8), 1965.
       :doi:`10.2514/3.3166`
    """
    state, P = last
    states, columns = [state], [P @ state.track_sensitivity.T]
    for step in reversed(steps):
        state = step.filtered.plus(step.gain @ state.minus(step.predicted))
        P = step.remainder + step.gain @ P @ step.gain.T
        states.append(state)
        columns.append(P @ state.track_sensitivity.T)
    states.reverse()
    attitude, vector = (np.stack(part) for part in zip(*states, strict=True))
    sensitivity = np.stack([state.track_sensitivity for state in states])
    gains = np.array([step.gain for step in steps]).reshape(-1, N_STATES, N_STATES)
    return Smoothed(
        time, attitude, vector, np.stack(columns[::-1]), sensitivity, np.diag(last[1]), _block_products(gains)
    )


def _block_products(gains: FloatArray) -> tuple[FloatArray, ...]:
    """Products of neighbours, of neighbouring products, and so on, as long as there are two."""
    blocks = [gains]
    while len(blocks[-1]) > 1:
        below = blocks[-1][: len(blocks[-1]) // 2 * 2]
        blocks.append(below[::2] @ below[1::2])
    return tuple(blocks)
