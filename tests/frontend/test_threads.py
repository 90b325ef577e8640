import os
import threading
import time

import numpy as np
import pytest

from frontend.features import describe
from frontend.loop_closures import compare_pairs
from frontend.threads import in_order
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor


def test_results_come_in_the_order_of_the_items_whichever_is_done_first():
    def slow_first(k):
        time.sleep(0.02 if k % 5 == 0 else 0.0)
        return k * k

    assert list(in_order(slow_first, range(40))) == [k * k for k in range(40)]


def test_no_items_give_no_results():
    assert list(in_order(abs, [])) == []


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one processor only: nothing runs at once")
def test_two_items_are_worked_on_at_once():
    meeting = threading.Barrier(2, timeout=10.0)  # breaks where one waits alone
    assert sorted(in_order(lambda _: meeting.wait(), range(2))) == [0, 1]


def test_items_are_taken_by_the_caller_and_little_ahead_of_the_results():
    takers, taken = set(), []

    def items():
        for k in range(1000):
            takers.add(threading.get_ident())
            taken.append(k)
            yield k

    results = in_order(abs, items())
    next(results)
    assert takers == {threading.get_ident()}
    assert len(taken) <= 4 * (os.cpu_count() or 1) + 1
    results.close()


def test_an_error_comes_at_its_items_turn_and_nothing_begins_after():
    begun = []

    def fails_at_three(k):
        begun.append(k)
        time.sleep(0.005)
        return 1 // (k - 3)

    results = in_order(fails_at_three, range(1000))
    assert [next(results) for _ in range(3)] == [-1, -1, -1]
    with pytest.raises(ZeroDivisionError):
        next(results)
    assert len(begun) < 20 + 5 * (os.cpu_count() or 1)


def test_where_the_caller_stops_no_further_item_begins():
    begun = []

    def slow(k):
        begun.append(k)
        time.sleep(0.01)

    results = in_order(slow, range(1000))
    next(results)
    results.close()
    n = len(begun)
    time.sleep(0.05)
    assert len(begun) == n <= 2 + 2 * (os.cpu_count() or 1)


def test_pairs_compared_in_one_thread_or_in_five_are_the_same_to_the_byte(monkeypatch):
    rng = np.random.default_rng(2)
    seafloor = rough_seafloor(rng)
    submaps = [cut_submap(seafloor, (150.0, 150.0, 0.1 + 0.5 * k), rng, k) for k in range(4)]
    features = [describe(submap) for submap in submaps]
    pairs = [(target, source) for source in range(4) for target in range(source)]

    def rows(n_threads):
        monkeypatch.setattr("os.cpu_count", lambda: n_threads)
        found = compare_pairs(pairs, submaps, features, lambda *_: np.diag([1e-4, 1e-4, 1e-3, 30.0, 30.0, 1e-2]))
        return [(c.target, c.source, c.T_target_source.tobytes(), c.sigmas.tobytes(), c.correlation) for c in found]

    assert rows(1) == rows(5)
    assert [row[:2] for row in rows(5)] == pairs
