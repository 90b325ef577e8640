"""Tests of the table of candidates."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from frontend.frames import planar_pose
from frontend.loop_closures import LoopClosure
from sssslam.products.loop_closures import format_loop_closures, read_loop_closures
from sssslam.products.result import Result

HEADER = (
    "target,source,t_target,t_source,x,y,yaw,sigma_x,sigma_y,sigma_yaw,"
    "n_matches,n_inliers,correlation,overlap,accepted,reason\n"
)
TIMES = {3: 100.0, 12: 250.5}
CLOSURE = LoopClosure(
    target=3,
    source=12,
    T_target_source=planar_pose(1.0, -2.0, 0.5, 0.25),
    sigmas=np.array([0.01, 0.02, 0.03, 0.1, 0.2, 0.4]),
    n_matches=40,
    n_inliers=9,
    correlation=0.8125,
    overlap=0.5,
    accepted=True,
    reason="",
)
UNKNOWN = replace(
    CLOSURE,
    T_target_source=np.full((4, 4), np.nan),
    sigmas=np.full(6, np.nan),
    correlation=np.nan,
    overlap=np.nan,
    accepted=False,
    reason="too few inliers, 2 of 8",
)


def test_a_row_has_shift_turn_and_their_sigmas_in_the_order_of_the_contract() -> None:
    numbers = "1.000000,-2.000000,0.500000,0.100000,0.200000,0.030000,40,9,0.812500,0.500000"
    assert format_loop_closures([CLOSURE], TIMES) == f"{HEADER}3,12,100.000000,250.500000,{numbers},true,\n"


def test_unknown_numbers_are_empty_and_a_reason_holds_no_comma() -> None:
    row = format_loop_closures([UNKNOWN], TIMES).splitlines()[1]
    assert row == "3,12,100.000000,250.500000,,,,,,,40,9,,,false,too few inliers; 2 of 8"


def test_the_header_is_there_without_rows() -> None:
    assert format_loop_closures([], {}) == HEADER


def test_rows_are_ordered_by_target_and_source() -> None:
    times = {number: float(number) for number in range(30)}
    pairs = [(5, 20), (3, 25), (3, 12)]
    closures = [replace(CLOSURE, target=target, source=source) for target, source in pairs]
    rows = format_loop_closures(closures, times).splitlines()[1:]
    assert [row.split(",")[:2] for row in rows] == [["3", "12"], ["3", "25"], ["5", "20"]]


def test_numbers_of_numpy_are_written_as_plain_ones() -> None:
    closure = replace(CLOSURE, accepted=np.bool_(True), n_inliers=np.int64(9))  # type: ignore[arg-type]
    assert format_loop_closures([closure], TIMES) == format_loop_closures([CLOSURE], TIMES)


def test_reading_gives_back_what_was_written(result: Result, tmp_path: Path) -> None:
    times = {submap.number: submap.anchor_time for submap in result.submaps}
    (tmp_path / "c.csv").write_text(format_loop_closures(result.loop_closures, times))
    closures, anchor_time = read_loop_closures(tmp_path / "c.csv")
    assert len(closures) == len(result.loop_closures)
    for ours, read in zip(result.loop_closures, closures, strict=True):
        assert (ours.target, ours.source, ours.accepted) == (read.target, read.source, read.accepted)
        np.testing.assert_allclose(read.T_target_source[:2, 3], ours.T_target_source[:2, 3], atol=5e-7)
        np.testing.assert_allclose(read.sigmas[[2, 3, 4]], ours.sigmas[[2, 3, 4]], atol=5e-7)
    assert all(abs(anchor_time[number] - times[number]) < 1e-6 for number in anchor_time)


def test_a_closure_of_an_unknown_submap_is_refused() -> None:
    with pytest.raises(ValueError, match="must join submaps of the run, got 12 of 1 submaps"):
        format_loop_closures([CLOSURE], {3: 100.0})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "the header must be target,source"),
        ("a,b\n", "the header must be target,source"),
        (HEADER + "1,2\n", "line 2: not a row of loop closures"),
        (HEADER + "1,2,0,1,0,0,zero,1,1,1,3,2,0,0,true,\n", "line 2: not a row of loop closures .*zero"),
        (HEADER + "1,2,0,1,0,0,0,1,1,1,3,2,0,0,yes,\n", "accepted must be true or false, got 'yes'"),
    ],
)
def test_a_broken_table_is_refused_with_its_place(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "c.csv").write_text(content)
    with pytest.raises(ValueError, match=message):
        read_loop_closures(tmp_path / "c.csv")


def test_a_missing_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a table of loop closures is wanted"):
        read_loop_closures(tmp_path / "none.csv")
