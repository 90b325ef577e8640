"""Tests of the words on top of the report."""

from typing import Any

import pytest

from sssslam.products.verdict import format_duration, format_metric, verdict


def manifest(accepted: int = 5, candidates: int = 9, shift: float = 4.0, **metrics: float | None) -> dict[str, Any]:
    counts = {"pings": 1200, "pings_dropped": 0, "submaps": 9, "candidates": candidates, "loop_closures": accepted}
    rows = [{"name": name, "value": value, "unit": "m", "how": ""} for name, value in metrics.items()]
    track = {"distance": 812.0, "shift_rms": shift / 2, "shift_max": shift}
    return {"counts": counts, "track": track, "metrics": rows, "input": {"duration": 600.0}}


def test_a_good_run_is_told_in_four_sentences() -> None:
    said = verdict(manifest(ate=1.0, ate_dr=5.0, closures_false=0.0))
    assert said == [
        "The vehicle ran 812\u00a0m in 10 min; 1\u202f200 pings made 9 submaps.",
        "5 of 9 candidates were accepted as loop closures; none of them is false.",
        "They moved the track by 2.00\u00a0m (root mean square), at most 4.00\u00a0m.",
        "Against the reference the error of the track (ATE) fell from 5.00\u00a0m to 1.00\u00a0m, 80% less.",
    ]


def test_a_run_that_made_it_worse_says_so() -> None:
    said = verdict(manifest(ate=5.0, ate_dr=1.0, closures_false=2.0))
    assert said[1].endswith("2 of them are false.")
    assert "ROSE from 1.00\u00a0m to 5.00\u00a0m, 400% more: do not use it" in said[3]


def test_a_straight_track_has_nothing_to_correct() -> None:
    said = verdict(manifest(accepted=0, candidates=0, shift=0.0))
    assert said[1] == "No two submaps were compared: the track passes no place again, or was not known to."
    assert said[2] == "Without a loop closure there is nothing to correct: the track is the one that was given."
    assert said[3] == "There is no reference to judge the corrected track by."


def test_rejected_candidates_and_a_moved_track_are_told() -> None:
    said = verdict(manifest(accepted=0, candidates=3, shift=0.5))
    assert said[1] == "None of 3 candidates was accepted as a loop closure."
    assert said[2] == "The track was moved by at most 0.500\u00a0m all the same."


@pytest.mark.parametrize(
    ("accepted", "n_fixes", "movers"), [(0, 1, "1 fix at the surface"), (5, 7, "They and 7 fixes at the surface")]
)
def test_fixes_that_moved_the_track_are_told(accepted: int, n_fixes: int, movers: str) -> None:
    run = manifest(accepted=accepted)
    said = verdict({**run, "counts": {**run["counts"], "fixes": n_fixes}})
    assert said[2] == f"{movers} moved the track by 2.00\u00a0m (root mean square), at most 4.00\u00a0m."


def test_one_is_singular_and_dropped_pings_are_told() -> None:
    said = verdict(
        {**manifest(accepted=1), "counts": {**manifest(accepted=1)["counts"], "pings_dropped": 4, "submaps": 1}}
    )
    assert "(4 more dropped) made 1 submap." in said[0]
    assert said[1] == "1 of 9 candidates was accepted as loop closures."


def test_an_unchanged_error_is_told() -> None:
    assert "stayed the same, 1.00" in verdict(manifest(ate=1.0, ate_dr=1.001))[3]
    assert "no reference" in verdict(manifest(ate=None, ate_dr=1.0))[3]


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.02, "rad", "1.15°"),
        (1234.5, "m", "1\u202f234\u00a0m"),
        (12.34, "m", "12.3\u00a0m"),
        (0.0, "m", "0\u00a0m"),
        (3.0, "loop closures", "3\u00a0loop closures"),
        (0.981, "", "0.981"),
        (None, "m", "unknown"),
    ],
)
def test_numbers_have_three_figures_and_degrees(value: float | None, unit: str, text: str) -> None:
    assert format_metric(value, unit) == text


def test_durations_are_told_in_their_own_size() -> None:
    assert [format_duration(s) for s in (59.6, 600.0, 9000.0)] == ["60 s", "10 min", "2.5 h"]
