"""Maximum-weight cliques where the members of one group share a vote."""

from collections.abc import Iterator

import numpy as np

from backend.arrays import BoolArray, FloatArray, IntArray

_N_SEEDS = 8  # greedy cliques before the exact search; more did not find larger ones


class CliqueSearch:
    """Search for the clique with most votes in a consistency graph.

    The first member of a group is worth one vote, each further one only ``repeat_vote``. Greedy cliques come first,
    then branch and bound in the manner of Tomita, on sets of vertices held as the bits of integers.

    Parameters
    ----------
    is_consistent : ndarray of bool, shape (C, C)
        Which vertices are joined; symmetric.
    group : ndarray of int, shape (C,)
        The group of each vertex.
    repeat_vote : float
        Worth of a further member of a group, 0 to 1.
    max_steps : int
        Vertices looked at before the best clique so far is taken; from then on the search is no longer exact.
    """

    def __init__(self, is_consistent: BoolArray, group: IntArray, repeat_vote: float, max_steps: int) -> None:
        self._adjacent = is_consistent & ~np.eye(len(group), dtype=bool)
        self._group = group
        self._repeat_vote = repeat_vote
        self._steps_left = max_steps
        self._best: list[int] = []
        self._best_votes = 0.0
        self._neighbours = [_bits(row) for row in self._adjacent]
        self._peers = [_bits(group == own) for own in group]

    def run(self) -> BoolArray:
        """Find the clique.

        Returns
        -------
        is_member : ndarray of bool, shape (C,)
            Its vertices.
        """
        for seed in self._seeds():
            members = self._grow(seed)
            self._keep(members, self.votes(members))
        self._expand([], 0.0, (1 << len(self._group)) - 1, 0)
        is_member = np.zeros(len(self._group), dtype=bool)
        is_member[self._best] = True
        return is_member

    def votes(self, members: list[int]) -> float:
        """Votes of a set of vertices.

        Parameters
        ----------
        members : list of int, length K
            The vertices.

        Returns
        -------
        votes : float
            Groups present, and a little for each repetition.
        """
        n_groups = len(set(self._group[members].tolist()))
        return n_groups + self._repeat_vote * (len(members) - n_groups)

    def _seeds(self) -> Iterator[int]:
        """Where greedy cliques start: at the best-connected vertices, each far from the ones before."""
        degree = self._adjacent.sum(axis=1).astype(np.float64)
        for _ in range(min(_N_SEEDS, len(degree))):
            seed = int(np.argmax(degree))
            yield seed
            degree[self._adjacent[seed]] *= 0.5
            degree[seed] = -1.0

    def _grow(self, seed: int) -> list[int]:
        """Add the most useful vertex until none is left, and all those at once that are joined to every other."""
        members, candidates = [seed], self._adjacent[seed].copy()
        while candidates.any():
            n_joined = self._adjacent[:, candidates].sum(axis=1)
            rank = np.where(candidates, self._worth(members) + n_joined / (len(candidates) + 1.0), -1.0)
            everybody = np.flatnonzero(candidates & (n_joined == candidates.sum() - 1))
            chosen = everybody if everybody.size else np.array([np.argmax(rank)])
            members.extend(chosen.tolist())
            candidates = candidates & self._adjacent[chosen].all(axis=0)
        return members

    def _worth(self, members: list[int]) -> FloatArray:
        """Votes that each vertex would add to a clique."""
        return np.where(np.isin(self._group, self._group[members]), self._repeat_vote, 1.0)

    def _keep(self, members: list[int], votes: float) -> None:
        """Remember the clique if it is the best so far."""
        if votes > self._best_votes + 1e-9:
            self._best, self._best_votes = sorted(members), votes

    def _expand(self, members: list[int], votes: float, candidates: int, voted: int) -> None:
        """Branch over the candidates, best bound first, and cut what cannot beat the best clique."""
        self._keep(members, votes)
        self._steps_left -= candidates.bit_count()
        for vertex, bound in reversed(self._ordered(candidates, voted)):
            if votes + bound <= self._best_votes + 1e-9 or self._steps_left <= 0:
                return
            worth = self._repeat_vote if voted >> vertex & 1 else 1.0
            now_voted = voted | self._peers[vertex]
            self._expand([*members, vertex], votes + worth, candidates & self._neighbours[vertex], now_voted)
            candidates &= ~(1 << vertex)

    def _ordered(self, candidates: int, voted: int) -> list[tuple[int, float]]:
        """The candidates, each with a bound on the votes that it and those before it can add.

        Two bounds: no two vertices of a colour are joined, so a clique takes at most one; and a group votes once.
        """
        ordered, by_colour, by_group, seen = [], 0.0, 0.0, voted
        while candidates:
            available, ceiling = candidates, 0.0
            while available:
                vertex = (available & -available).bit_length() - 1
                candidates ^= 1 << vertex
                available &= ~(self._neighbours[vertex] | 1 << vertex)
                ceiling = max(ceiling, self._repeat_vote if voted >> vertex & 1 else 1.0)
                by_group += self._repeat_vote if seen >> vertex & 1 else 1.0
                seen |= self._peers[vertex]
                ordered.append((vertex, min(by_colour + ceiling, by_group)))
            by_colour += ceiling
        return ordered


def _bits(flags: BoolArray) -> int:
    """A set of vertices as the bits of an integer."""
    return int.from_bytes(np.packbits(flags, bitorder="little").tobytes(), "little")
