"""Dead reckoning: heading and speed give the track back; what was recorded is the reference."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sssslam.navigation.dead_reckoned import integrate, rebuild_dead_reckoned


def test_a_true_heading_and_speed_give_the_track_back(dive):
    recording = dive()
    rebuilt = rebuild_dead_reckoned(recording)
    # A chord of 0.3 m on a turn of 0.03 rad/s is exact in length to 1e-6: millimetres after 180 m.
    np.testing.assert_allclose(rebuilt.trajectory_dr.positions, recording.trajectory_dr.positions, atol=0.02)
    assert rebuilt.truth.trajectory is recording.trajectory_dr
    np.testing.assert_array_equal(rebuilt.trajectory_dr.yaw, recording.trajectory_dr.yaw)


def test_positions_have_no_say_but_the_first(dive):
    recording = dive()
    k = np.arange(recording.n_pings)
    moved = replace(recording, trajectory_dr=replace(recording.trajectory_dr, x=recording.trajectory_dr.x + 0.01 * k))
    rebuilt = [rebuild_dead_reckoned(r).trajectory_dr for r in (recording, moved)]
    np.testing.assert_array_equal(rebuilt[0].positions, rebuilt[1].positions)


def test_fixes_of_a_receiver_judge_the_track_and_do_not_hold_it(dive):
    series = {"time": np.zeros(1), "position_x": np.zeros(1), "position_y": np.zeros(1)}
    recording = replace(dive(), sensors={"gnss": series, "depth": {"time": np.zeros(1), "depth": np.zeros(1)}})
    assert set(rebuild_dead_reckoned(recording).sensors) == {"depth", "speed_log"}
    assert set(recording.sensors) == {"gnss", "depth"}


def test_the_speed_that_made_the_track_stands_among_the_sensors_and_a_speed_log_stays(dive):
    recording = dive()
    log = rebuild_dead_reckoned(recording).sensors["speed_log"]
    np.testing.assert_array_equal(log["time"], recording.ping_time)
    np.testing.assert_array_equal(log["speed"], recording.speed)
    own = {"time": np.zeros(1), "speed": np.ones(1)}
    assert rebuild_dead_reckoned(replace(recording, sensors={"speed_log": own})).sensors["speed_log"] is own


def test_a_heading_bias_moves_the_end_by_its_sine(dive):
    recording, bias = dive(), np.radians(2.0)
    track = recording.trajectory_dr
    rebuilt = rebuild_dead_reckoned(replace(recording, trajectory_dr=replace(track, yaw=track.yaw + bias)))
    end = np.hypot(track.x[-1], track.y[-1])
    off = np.hypot(rebuilt.trajectory_dr.x[-1] - track.x[-1], rebuilt.trajectory_dr.y[-1] - track.y[-1])
    # A turn by e about the start moves a point at distance d by 2 d sin(e/2).
    assert off == pytest.approx(2 * end * np.sin(bias / 2), rel=1e-3)


def test_missing_speed_is_interpolated_and_said_and_none_at_all_is_refused(dive):
    speed = np.full(600, 1.5)
    speed[100:200] = np.nan
    rebuilt = rebuild_dead_reckoned(dive(speed=speed))
    np.testing.assert_allclose(rebuilt.trajectory_dr.x, dive().trajectory_dr.x, atol=0.02)
    assert any("speed is missing in 100 of 600 pings" in note for note in rebuilt.notes)
    with pytest.raises(ValueError, match=r"dive.xtf has no speed; dead reckoning wants heading and speed"):
        rebuild_dead_reckoned(dive(speed=np.full(600, np.nan)))


def test_a_dive_without_positions_is_rebuilt_and_has_no_reference(dive):
    recording = dive()
    still = replace(recording.trajectory_dr, x=np.zeros(600), y=np.zeros(600))
    rebuilt = rebuild_dead_reckoned(replace(recording, trajectory_dr=still))
    np.testing.assert_allclose(rebuilt.trajectory_dr.x, recording.trajectory_dr.x, atol=0.02)
    assert rebuilt.truth is None
    assert rebuilt.notes[-1] == "positions are rebuilt from heading and speed: 179.7 m"


def test_a_heading_made_of_positions_is_pointed_out(dive):
    recording = dive()
    track = recording.trajectory_dr
    # With a compass 3 degrees off nobody could think so.
    compass = replace(recording, trajectory_dr=replace(track, yaw=track.yaw + np.radians(3)))
    assert any("this dead reckoning is not independent" in note for note in rebuild_dead_reckoned(recording).notes)
    assert not any("not independent" in note for note in rebuild_dead_reckoned(compass).notes)


@given(st.floats(-np.pi, np.pi), st.floats(0.1, 5.0), st.floats(-0.2, 0.2))
def test_a_circle_closes_and_turning_the_heading_turns_the_track(start, speed, rate):
    time = np.arange(0.0, 50.0, 0.5)
    x, y = integrate(time, start + rate * time, np.full(100, speed))
    x0, y0 = integrate(time, rate * time, np.full(100, speed))
    c, s = np.cos(start), np.sin(start)
    np.testing.assert_allclose([x, y], [c * x0 - s * y0, s * x0 + c * y0], atol=1e-9)
    # Every step is a chord of equal length, whatever the turn.
    np.testing.assert_allclose(np.hypot(np.diff(x), np.diff(y)), 0.5 * speed)
