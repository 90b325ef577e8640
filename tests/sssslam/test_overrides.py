from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.acceptance import Rejection
from frontend.frames import planar_pose
from frontend.loop_closures import LoopClosure
from sssslam.overrides import REJECTED, Overrides, override, override_notes, read_overrides
from sssslam.products.loop_closures import format_loop_closures

SIGMAS = np.array([0.01, 0.01, 0.005, 0.2, 0.3, 0.4])


def closure(target, source, reason="", *, x=4.0):
    T = planar_pose(x, -2.0, 0.3) if np.isfinite(x) else np.full((4, 4), np.nan)
    return LoopClosure(target, source, T, SIGMAS, 30, 12, 0.6, 0.5, not reason, str(reason))


CLOSURES = [
    closure(0, 5),
    closure(0, 6, Rejection.AMBIGUOUS),
    closure(1, 6, Rejection.NO_ALIGNMENT, x=np.nan),
    closure(2, 7),
]


@pytest.fixture
def table(tmp_path):
    def write(text, encoding="utf-8"):
        path = tmp_path / "decisions.csv"
        path.write_text(text, encoding=encoding)
        return path

    return write


def test_decisions_are_read_in_either_order_of_the_pair(table):
    overrides = read_overrides(table("target,source,decision\n0,6,accept\n7,2, Reject \n"))
    assert overrides.is_accepted == {(0, 6): True, (2, 7): False}


def test_an_edited_copy_of_the_table_of_a_run_is_read(table):
    header, *rows = format_loop_closures(CLOSURES, {k: float(k) for k in range(8)}).splitlines()
    rows[1] += ",accept"  # the other rows are left as short as they were
    rows[3] += ","
    overrides = read_overrides(table("\n".join([header + ",decision", *rows, "", ""])))
    assert overrides.is_accepted == {(0, 6): True}


def test_the_mark_of_a_spreadsheet_does_no_harm(table):
    overrides = read_overrides(table("target,source,decision\r\n0,6,accept\r\n", "utf-8-sig"))
    assert overrides.is_accepted == {(0, 6): True}


def test_columns_may_come_in_any_order(table):
    assert read_overrides(table("decision,why,source,target\nreject,a wreck,5,0\n")).is_accepted == {(0, 5): False}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty; a table target,source,decision is wanted"),
        ("target,source\n0,5\n", "once each is wanted, check decision"),
        ("target;source;decision\n0;5;accept\n", "a header with target,source,decision once each"),
        ("target,source,decision,decision\n", "once each is wanted, check decision"),
        ("target,source,decision\n0,5,yes\n", "row 2: decision is accept, reject or empty, got 'yes'"),
        ("target,source,decision\n\n0,b,accept\n", "row 3: target and source are submap numbers, got 'b'"),
        ("target,source,decision\n-1,5,accept\n", "submap numbers, got '-1'"),
        ("target,source,decision\n0,5.5,reject\n", "submap numbers, got '5.5'"),
        ("decision,target,source\naccept\n", "submap numbers, got ''"),
        ("target,source,decision\n5,5,accept\n", "two different submaps, got 5 twice"),
        ("target,source,decision\n0,5,accept\n5,0,reject\n", "row 3: one decision a pair is wanted, submaps 0 and 5"),
    ],
)
def test_what_is_no_decision_is_said_with_its_place(table, text, message):
    with pytest.raises(ValueError, match=r"decisions\.csv") as error:
        read_overrides(table(text))
    assert message in str(error.value)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00t", b"\x89PNG\r\n\x1a\n\x00"])
def test_a_file_that_is_no_text_is_said(tmp_path, content):
    path = tmp_path / "decisions.csv"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="a table target,source,decision is wanted, cannot read it"):
        read_overrides(path)


def test_a_file_that_is_not_there_is_said():
    with pytest.raises(ValueError, match=r"nowhere\.csv: there is no such file; a table target,source,decision is"):
        read_overrides(Path("nowhere.csv"))


def test_a_forced_accept_keeps_the_measurement_of_the_front_end():
    accepted = override(CLOSURES, Overrides({(0, 6): True}))[1]
    assert (accepted.accepted, accepted.reason) == (True, "")
    assert np.array_equal(accepted.T_target_source, CLOSURES[1].T_target_source)
    assert np.array_equal(accepted.sigmas, CLOSURES[1].sigmas)


def test_a_forced_reject_says_who_rejected():
    rejected = override(CLOSURES, Overrides({(0, 5): False, (1, 6): False}))
    assert [(c.accepted, c.reason) for c in rejected] == [
        (False, "rejected by the user"),
        (False, str(Rejection.AMBIGUOUS)),
        (False, "rejected by the user"),
        (True, ""),
    ]


def test_a_pair_that_was_not_compared_is_refused():
    with pytest.raises(ValueError, match=r"my\.csv: submaps 3 and 9 were not compared in this run"):
        override(CLOSURES, Overrides({(3, 9): False}, "my.csv"))


def test_a_pair_without_a_measurement_cannot_be_accepted():
    with pytest.raises(ValueError, match=r"submaps 1 and 6 cannot be accepted: no alignment was measured \(no align"):
        override(CLOSURES, Overrides({(1, 6): True}))


def test_a_measurement_that_nothing_fixes_cannot_be_accepted():
    loose = replace(closure(0, 1, Rejection.LOOSE), sigmas=np.full(6, np.inf))
    with pytest.raises(ValueError, match="no alignment was measured"):
        override([loose], Overrides({(0, 1): True}))


@given(st.dictionaries(st.sampled_from([(0, 5), (0, 6), (2, 7)]), st.booleans()))
def test_only_the_pairs_that_are_named_change(is_accepted):
    after = override(CLOSURES, Overrides(is_accepted))
    for old, new in zip(CLOSURES, after, strict=True):
        pair = (old.target, old.source)
        assert new is old if pair not in is_accepted else new.accepted == is_accepted[pair]


def test_notes_say_what_the_user_decided_and_against_whom():
    overrides = Overrides({(0, 6): True, (2, 7): True, (0, 5): False})
    final = override(CLOSURES, overrides)
    assert override_notes(CLOSURES, final, overrides) == (
        "Loop closures by the user accepted: 0-6 (against: another alignment is nearly as good), 2-7.",
        "Loop closures by the user rejected: 0-5.",
    )


def test_notes_say_what_had_to_be_withdrawn_all_the_same():
    overrides = Overrides({(2, 7): True})
    final = [*CLOSURES[:3], closure(2, 7, "the graph has no solution")]
    assert override_notes(CLOSURES, final, overrides) == (
        "Loop closures by the user accepted but withdrawn: 2-7 (against: the graph has no solution).",
    )


def test_without_decisions_nothing_is_said():
    assert override_notes(CLOSURES, CLOSURES, Overrides()) == ()
    assert not any(c.reason == REJECTED for c in override(CLOSURES, Overrides()))
