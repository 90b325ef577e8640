"""The report says how long windows are and why."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sssslam.config import load_config, resolve, resolve_pings
from sssslam.stages import notes
from tests.frontend.flat_floor import FlatFloor

KNOWN = SimpleNamespace(altimeter_scale=1.0), SimpleNamespace(words="Samples taken for intensity.")
METHOD = "reconstruction.method=woock"


@pytest.fixture
def dive():
    """One and a half circles of 120 m at a range of 30 m."""
    straight = FlatFloor(np.full(401, 2.0), n_samples=600).record(np.random.default_rng(1))
    yaw = np.linspace(0.0, 3 * np.pi, 401)
    x, y = np.cumsum(0.3 * np.cos(yaw)), np.cumsum(0.3 * np.sin(yaw))
    return replace(straight, trajectory_dr=replace(straight.trajectory_dr, x=x, y=y, yaw=yaw))


def said(dive, config):
    return next(note for note in notes(dive, *KNOWN, config) if note.startswith("Windows of"))


def test_windows_that_a_track_made_short_are_said_with_that_reason(dive):
    note = said(dive, resolve(load_config(settings=[METHOD]), dive))
    assert note.startswith("Windows of 15 m that overlap by 80%")
    assert note.endswith("from a slant range of 30 m and a track of 120 m that turns back.")


@pytest.mark.parametrize("setting", ["windows.length=20", "windows.length=45"])
def test_a_length_that_was_set_is_not_put_down_to_the_track(dive, setting):
    note = said(dive, resolve(load_config(settings=[METHOD, setting]), dive))
    assert note.endswith("from a slant range of 30 m.")


def test_the_windows_of_a_dive_that_goes_on_come_from_the_range(dive):
    note = said(dive, resolve_pings(load_config(settings=[METHOD]), dive))
    assert note.startswith("Windows of 45 m that overlap by 50%")
    assert note.endswith("from a slant range of 30 m.")


def test_how_far_apart_loop_closures_vote_is_said(dive):
    config = resolve(load_config(settings=[METHOD]), dive)
    assert "Loop closures fewer than 10 windows apart at both ends share a vote." in notes(dive, *KNOWN, config)
