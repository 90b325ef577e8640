"""Stages are timed, items pass through."""

import pytest

from sssslam.watch import Watch


def test_a_stage_is_timed_and_times_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([10.0, 12.5, 20.0, 21.0])
    monkeypatch.setattr("sssslam.watch.time.perf_counter", lambda: next(clock))
    watch = Watch()
    with watch.stage("bottom"):
        pass
    with watch.stage("bottom"):
        pass
    assert watch.seconds == {"bottom": 3.5}


def test_items_pass_through_in_order_and_their_work_is_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([1.0, 8.0])
    monkeypatch.setattr("sssslam.watch.time.perf_counter", lambda: next(clock))
    watch = Watch()
    assert [2 * item for item in watch.track("windows", [1, 2, 3])] == [2, 4, 6]
    assert watch.seconds == {"windows": 7.0}


def test_a_stage_that_fails_keeps_no_time_and_the_error_passes() -> None:
    watch = Watch()
    with pytest.raises(KeyError), watch.stage("features"):
        raise KeyError
    assert watch.seconds == {}


def test_stages_stand_in_the_order_they_ended() -> None:
    watch = Watch()
    for name in ("one", "two"):
        with watch.stage(name):
            pass
    assert list(watch.seconds) == ["one", "two"]
    assert all(seconds >= 0 for seconds in watch.seconds.values())
