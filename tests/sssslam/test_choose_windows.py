"""A dive's windows: those that cannot be reconstructed are skipped and said; it is fatal only where none is left."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from frontend.bottom import Bottom
from sssslam.config import Config, load_config, resolve
from sssslam.stages import Skipped, choose_windows
from tests.frontend.flat_floor import FlatFloor


@pytest.fixture(scope="module")
def recording():
    """A straight leg of 400 pings without an altimeter."""
    made = FlatFloor(np.full(400, 12.0)).record(np.random.default_rng(1))
    return replace(made, altitude=np.full(400, np.nan))


def bottom(recording, is_found):
    n = recording.n_pings
    return Bottom(np.full((n, 2), 12.0), np.full(n, 12.0), float("nan"), np.repeat(is_found[:, None], 2, axis=1))


@pytest.fixture
def config(recording):
    length = recording.trajectory_dr.distance[-1] / 8.0
    return resolve(load_config(settings=[f"windows.length={length}", "windows.overlap=0"]), recording)


def test_what_is_skipped_is_one_line_in_the_log_and_a_count(recording, config, caplog):
    found = np.arange(400) >= 150  # three eighths are lost
    with caplog.at_level(logging.WARNING, "sssslam"):
        windows, skipped = choose_windows(recording, bottom(recording, found), config)
    assert len(windows) == 5
    assert windows[0].number == 0
    assert skipped.counts == {"windows_skipped": 3}
    assert skipped.notes == ("Skipped 3 of 8 windows: 3 for bottom lost over most of it.",)
    assert caplog.messages == list(skipped.notes)


def test_nothing_is_said_where_nothing_is_skipped(recording, config, caplog):
    windows, skipped = choose_windows(recording, bottom(recording, np.ones(400, dtype=bool)), config)
    assert len(windows) == 8
    assert (skipped.counts, skipped.notes, caplog.messages) == ({"windows_skipped": 0}, (), [])


def test_a_dive_of_which_nothing_is_left_is_one_error_with_the_reasons(recording, config):
    lost = bottom(recording, np.zeros(400, dtype=bool))
    with pytest.raises(
        ValueError, match=r"none of 8 windows can be reconstructed \(8 for bottom lost over most of it\)"
    ):
        choose_windows(recording, lost, config)


def test_the_method_of_cutting_is_the_configured_one(recording):
    lines = resolve(
        load_config(settings=["windows.method=lines", "windows.n_lines=50", "windows.overlap=0"]), recording
    )
    windows, _ = choose_windows(recording, bottom(recording, np.ones(400, dtype=bool)), lines)
    assert {w.n_pings for w in windows} == {50 - 2 * lines.windows.n_edge_pings}


def test_all_keys_of_the_section_are_known_once_it_is_resolved(recording):
    windows = resolve(Config(), recording).windows
    assert all(value is not None for _, value in windows)


def test_reasons_are_listed_in_one_sentence():
    skipped = Skipped(9, {"a pure turn": 1, "no navigation over most of it": 3})
    assert skipped.notes == ("Skipped 4 of 9 windows: 1 for a pure turn; 3 for no navigation over most of it.",)
