from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from backend.cliques import CliqueSearch

REPEAT = 0.1
EXACT = 10**9


def search(is_consistent, group, max_steps=EXACT):
    return CliqueSearch(np.asarray(is_consistent, dtype=bool), np.asarray(group), REPEAT, max_steps)


def votes(group, members):
    n_groups = len({group[member] for member in members})
    return n_groups + REPEAT * (len(members) - n_groups)


def is_clique(is_consistent, members):
    return all(is_consistent[a][b] for a, b in combinations(members, 2))


def best_of_all_subsets(is_consistent, group):
    """The judge: every subset is tried."""
    n = len(group)
    subsets = ([v for v in range(n) if code >> v & 1] for code in range(1 << n))
    return max(votes(group, subset) for subset in subsets if is_clique(is_consistent, subset))


@st.composite
def graphs(draw):
    n = draw(st.integers(1, 9))
    edges = draw(st.lists(st.booleans(), min_size=n * n, max_size=n * n))
    upper = np.triu(np.reshape(edges, (n, n)), 1)
    return upper | upper.T, draw(st.lists(st.integers(0, 3), min_size=n, max_size=n))


@given(graphs())
def test_the_clique_found_has_the_most_votes_of_all(graph):
    is_consistent, group = graph
    members = np.flatnonzero(search(is_consistent, group).run())
    assert is_clique(is_consistent, members)
    assert votes(group, members) == pytest.approx(best_of_all_subsets(is_consistent, group))


@given(graphs())
def test_without_steps_left_a_clique_is_still_found(graph):
    is_consistent, group = graph
    members = np.flatnonzero(search(is_consistent, group, max_steps=0).run())
    assert members.size
    assert is_clique(is_consistent, members)


def test_three_places_outvote_five_closures_of_one_place():
    is_consistent = np.zeros((8, 8), dtype=bool)
    is_consistent[:3, :3] = is_consistent[3:, 3:] = True
    group = [0, 1, 2, 7, 7, 7, 7, 7]
    assert np.flatnonzero(search(is_consistent, group).run()).tolist() == [0, 1, 2]


def test_of_cliques_with_as_many_places_the_one_with_more_closures_wins():
    is_consistent = np.zeros((5, 5), dtype=bool)
    is_consistent[:2, :2] = is_consistent[2:, 2:] = True
    assert np.flatnonzero(search(is_consistent, [0, 1, 2, 3, 3]).run()).tolist() == [2, 3, 4]


def test_a_large_planted_clique_is_found_without_an_exact_search():
    rng = np.random.default_rng(0)
    is_consistent = rng.random((200, 200)) < 0.2
    planted = rng.permutation(200)[:40]
    is_consistent[np.ix_(planted, planted)] = True
    is_consistent &= is_consistent.T
    is_consistent[np.ix_(planted, planted)] = True
    found = search(is_consistent, np.arange(200), max_steps=1000).run()
    assert set(planted) <= set(np.flatnonzero(found))


def test_two_searches_find_the_same_clique():
    rng = np.random.default_rng(1)
    is_consistent = rng.random((60, 60)) < 0.5
    is_consistent |= is_consistent.T
    first, second = (search(is_consistent, np.arange(60) // 3, max_steps=2000).run() for _ in range(2))
    assert np.array_equal(first, second)
