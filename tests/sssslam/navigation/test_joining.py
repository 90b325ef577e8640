"""Joining: a log on its own times gives the pings the navigation it holds, and says how much it covers."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.recording import Truth
from sssslam.navigation.joining import join_navigation
from sssslam.navigation.log import NavigationLog
from sssslam.navigation.series import Series
from tests.sssslam.navigation.conftest import START, positions, vehicle


def _log(time: np.ndarray, *names: str, place: str = "local") -> NavigationLog:
    """What the vehicle did, at times of the log [s since START]."""
    said = {name: values for name, values in vehicle(time).items() if name in names}
    if place == "local":
        said |= dict(zip(("x", "y"), positions(time), strict=True))
    return NavigationLog("log.csv", {name: Series(START + time, values) for name, values in said.items()})


def _lost(recording):
    """The dive with navigation that is wrong throughout."""
    track = recording.trajectory_dr
    zero = np.zeros(len(track))
    return replace(recording, trajectory_dr=replace(track, x=zero, y=zero, yaw=zero, roll=zero, pitch=zero, z=zero))


def test_a_log_at_one_hertz_gives_the_pings_their_track_back(dive):
    recording = dive()
    log = _log(np.arange(-2.0, 125.0), "yaw", "roll", "pitch", "depth", "speed", "altitude")
    joined = join_navigation(_lost(recording), log)
    true = recording.trajectory_dr
    assert joined.n_pings == recording.n_pings
    # A course of 1.5 m/s that turns by 0.03 rad/s bends 1 cm in a second; roll of period 19 s is off by 0.2 mrad.
    np.testing.assert_allclose(joined.trajectory_dr.positions, true.positions, atol=0.02)
    for name in ("roll", "pitch", "yaw"):
        np.testing.assert_allclose(getattr(joined.trajectory_dr, name), getattr(true, name), atol=1e-3)
    np.testing.assert_allclose(joined.depth, -joined.trajectory_dr.z)
    assert any("1 Hz, clock offset +0.000 s, 100.0% of 600 pings covered" in note for note in joined.notes)


def test_a_clock_offset_is_added_to_the_times_of_the_log(dive):
    recording = dive()
    late = _log(np.arange(-2.0, 125.0, 0.5), "yaw")
    joined = join_navigation(_lost(recording), late.shifted(-7.0), clock_offset=7.0)
    np.testing.assert_allclose(joined.trajectory_dr.x, recording.trajectory_dr.x, atol=0.02)


def test_pings_outside_the_log_are_dropped_and_counted(dive):
    recording = dive(n_dropped=3)
    joined = join_navigation(recording, _log(np.arange(30.0, 60.5, 0.5)))
    # Two intervals beyond both ends count as covered.
    assert joined.ping_time[0] - START == pytest.approx(29.0)
    assert joined.ping_time[-1] - START == pytest.approx(61.0)
    assert joined.n_dropped == 3 + 600 - joined.n_pings
    assert any(f"{600 - joined.n_pings} pings outside its time are dropped" in note for note in joined.notes)


def test_a_log_of_another_day_is_refused_with_both_spans(dive):
    with pytest.raises(ValueError, match="covers no ping") as error:
        join_navigation(dive(), _log(np.arange(60.0)).shifted(86400.0))
    assert "log.csv: covers no ping; it runs from 2023-11-15 22:13:20 to 2023-11-15 22:14:19" in str(error.value)
    assert "the pings from 2023-11-14 22:13:20 to 2023-11-14 22:15:19" in str(error.value)


def test_a_log_whose_time_is_absurd_is_refused_in_words(dive):
    with pytest.raises(ValueError, match=r"covers no ping; it runs from 1\.0017e\+12 s"):
        join_navigation(dive(), _log(np.arange(60.0)).shifted(1e12))


def test_degrees_are_brought_into_the_frame_of_the_recording(dive):
    recording, time = dive(), START + np.arange(-2.0, 125.0)
    latitude, longitude = recording.georeference.to_geographic(*positions(time - START))
    log = NavigationLog("gps.txt", {"latitude": Series(time, latitude), "longitude": Series(time, longitude)})
    joined = join_navigation(replace(recording, truth=Truth(recording.trajectory_dr)), log)
    assert joined.georeference == recording.georeference
    assert joined.truth is not None
    np.testing.assert_allclose(joined.trajectory_dr.x, recording.trajectory_dr.x, atol=0.02)
    np.testing.assert_array_equal(joined.trajectory_dr.yaw, recording.trajectory_dr.yaw)
    assert any("m from those recorded, in the middle of all pings" in note for note in joined.notes)
    placeless = join_navigation(replace(recording, georeference=None, truth=Truth(recording.trajectory_dr)), log)
    # The first ping is the origin: 45 north, 5 east, to a micro-degree.
    assert placeless.georeference.latitude == pytest.approx(45.0, abs=1e-6)
    assert placeless.truth is None


def test_grid_metres_start_at_the_first_ping_and_have_no_place_on_earth(dive):
    time = np.arange(-2.0, 125.0)
    x, y = positions(time)
    series = {"easting": Series(START + time, x + 500_000.0), "northing": Series(START + time, y + 4_900_000.0)}
    joined = join_navigation(dive(), NavigationLog("grid.csv", series))
    assert joined.georeference is None
    assert (joined.trajectory_dr.x[0], joined.trajectory_dr.y[0]) == (0.0, 0.0)
    assert any("the origin is easting 500000.000, northing 4900000.000" in note for note in joined.notes)


def test_local_metres_keep_the_place_of_a_track_they_lie_near_and_no_other(dive):
    near = _log(np.arange(-2.0, 125.0))
    assert join_navigation(dive(), near).georeference is not None
    far = NavigationLog("far.tum", near.series | {"x": Series(near.series["x"].time, near.series["x"].values + 5000.0)})
    joined = join_navigation(dive(), far)
    assert joined.georeference is None
    assert any("their place is unknown" in note for note in joined.notes)


def test_what_a_log_lacks_stays_as_recorded(dive):
    recording = dive()
    joined = join_navigation(recording, _log(np.arange(-2.0, 125.0), "roll", place="none"))
    np.testing.assert_array_equal(joined.trajectory_dr.x, recording.trajectory_dr.x)
    np.testing.assert_array_equal(joined.altitude, recording.altitude)
    np.testing.assert_allclose(joined.trajectory_dr.roll, recording.trajectory_dr.roll, atol=2e-3)


def test_a_pause_between_fixes_is_said(dive):
    time = np.concatenate([np.arange(-2.0, 40.0), np.arange(70.0, 125.0)])
    joined = join_navigation(dive(), _log(time))
    assert any("positions pause for up to 31.0 s" in note for note in joined.notes)
