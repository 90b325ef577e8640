"""The choice of navigation: file, clock and dead reckoning in their order, wrong choices in one line."""

from pathlib import Path

import numpy as np
import pytest

from sssslam.navigation.choice import NavigationChoice, Source, navigate
from tests.sssslam.navigation.conftest import START, positions, vehicle


def _table(offset: float = 0.0) -> str:
    time = np.arange(-5.0, 130.0, 0.5)
    said, (x, y) = vehicle(time), positions(time)
    rows = zip(START + time - offset, x, y, np.degrees(said["yaw"]), said["altitude"], strict=True)
    return "time,x,y,yaw [deg],altitude\n" + "".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in rows)


def test_without_a_choice_a_recording_stays_as_it_is(dive):
    recording = dive()
    assert navigate(recording, NavigationChoice()) is recording


def test_a_file_on_a_wrong_clock_is_joined_after_its_offset_was_estimated(dive, write):
    recording = dive()
    navigated = navigate(recording, NavigationChoice(write(_table(9.0)), "estimate"))
    # A tenth of a second of the clock is 0.15 m at 1.5 m/s.
    np.testing.assert_allclose(navigated.trajectory_dr.x, recording.trajectory_dr.x, atol=0.15)
    assert any("navigation.csv: clock offset +9.0" in note or "clock offset +8.9" in note for note in navigated.notes)
    stated = navigate(recording, NavigationChoice(write(_table(9.0)), "9"))
    np.testing.assert_allclose(stated.trajectory_dr.x, recording.trajectory_dr.x, atol=0.02)


def test_dead_reckoning_comes_after_the_file_whose_positions_are_the_reference(dive, write):
    recording = dive(speed=np.full(600, 1.0))
    choice = NavigationChoice(write(_table()), source=Source.DEAD_RECKONED)
    navigated = navigate(recording, choice)
    np.testing.assert_allclose(navigated.truth.trajectory.x, recording.trajectory_dr.x, atol=0.02)
    assert navigated.trajectory_dr.distance[-1] == pytest.approx(recording.trajectory_dr.distance[-1] / 1.5, rel=1e-3)


@pytest.mark.parametrize("offset", ["soon", "nan", "1e300"])
def test_an_offset_that_is_none_is_refused(dive, write, offset):
    with pytest.raises(ValueError, match=r"--clock-offset is .*; seconds or 'estimate' is wanted"):
        navigate(dive(), NavigationChoice(write(_table()), offset))


def test_an_offset_without_a_file_is_refused(dive):
    with pytest.raises(ValueError, match=r"--clock-offset 3 was given without --nav"):
        navigate(dive(), NavigationChoice(None, "3"))


def test_a_file_that_is_not_there_is_refused(dive):
    with pytest.raises(ValueError, match=r"nowhere.csv: there is no such file"):
        navigate(dive(), NavigationChoice(Path("nowhere.csv")))
