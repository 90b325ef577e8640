"""Pings as they come: fixes hold the track from their ping on, and at the end it is the track of the whole dive."""

from dataclasses import replace

import numpy as np
import pytest

import sssslam
from backend.dead_reckoning import DeadReckoning
from sssslam.config import Config, load_config
from sssslam.fix_log import FixLog
from sssslam.simulation import Scene

# mud, where nothing is recognised: the fixes alone can help
SCENE = Scene.model_validate(
    {
        "seed": 4,
        "terrain": {"size": [240.0, 160.0], "depth": 60.0, "layers": [{"kind": "sediment", "rms": 0.05}]},
        "survey": {"pattern": "legs", "legs": [[-50.0, -10.0, 50.0, -10.0], [50.0, 15.0, -50.0, 15.0]]},
        "drift": {"grade": "mems"},
        "sonar": {"range_max": 50.0},
    }
)
# windows of a fixed length: a dive that goes on does not know yet that it will be short
SETTINGS = [
    "reconstruction.joint.spacing=2.0",
    "reconstruction.joint.n_levels=1",
    "radiometry.n_rounds=0",
    "windows.length=25.0",
]
CHUNK = 150


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config(None, SETTINGS)


@pytest.fixture(scope="module")
def silent():
    """The dive without a receiver."""
    return sssslam.simulate(SCENE)


def with_fixes(recording, time, off=(0.0, 0.0)):
    """The dive with a receiver that sees the vehicle at some times, a metre of noise and so much off."""
    truth, noise = recording.truth.trajectory, np.random.default_rng(2).standard_normal((2, len(time)))
    x, y = (np.interp(time, truth.time, axis) + n for axis, n in zip((truth.x, truth.y), noise, strict=True))
    gnss = {"time": time, "position_x": x + off[0], "position_y": y + off[1]}
    return replace(recording, sensors={**recording.sensors, "gnss": gnss})


@pytest.fixture(scope="module")
def last_seconds(silent):
    """The last ten seconds of the dive and half a second after."""
    return silent.ping_time[-1] + 0.5 - np.arange(10.0)[::-1]


@pytest.fixture(scope="module")
def surfaced(silent, last_seconds):
    return with_fixes(silent, last_seconds)


def fed(recording, config, chunk=CHUNK):
    """A Slam that was given the dive, and its track after every chunk."""
    live, tracks = sssslam.Slam(config), []
    for first in range(0, recording.n_pings, chunk):
        live.add(recording[first : first + chunk])
        tracks.append(live.trajectory)
    return live, tracks


@pytest.fixture(scope="module")
def live(surfaced, config):
    """After the last ping and `finish`, with the tracks before."""
    live, tracks = fed(surfaced, config)
    live.finish()
    return live, tracks


def error_at_the_end(trajectory, recording):
    truth = recording.truth.trajectory
    return float(np.hypot(trajectory.x[-1] - truth.x[-1], trajectory.y[-1] - truth.y[-1]))


def test_a_finished_dive_with_fixes_has_the_very_track_of_the_batch(live, surfaced, config):
    batch = sssslam.slam(surfaced, config)
    assert batch.counts["fixes"] == live[0].fixes.counts["fixes"] == 10
    assert [s.anchor_ping for s in live[0].submaps] == [s.anchor_ping for s in batch.submaps]
    # no closure holds, so the echoes, calibrated from the first windows alone, have no say
    np.testing.assert_array_equal(live[0].trajectory.poses, batch.trajectory.poses)


def test_before_the_vehicle_surfaces_the_track_is_dead_reckoned_though_the_fixes_are_in_every_chunk(live, surfaced):
    n_before = int(np.searchsorted(surfaced.ping_time, surfaced.sensors["gnss"]["time"][0] - 1.0))
    whole = n_before // CHUNK
    assert whole > 1
    for track in live[1][:whole]:
        np.testing.assert_array_equal(track.poses, surfaced.trajectory_dr.poses[: len(track)])


def test_fixes_hold_the_track_at_once_and_not_only_when_the_dive_is_finished(live, surfaced):
    drifted = error_at_the_end(surfaced.trajectory_dr, surfaced)
    # the middle of ten fixes of a metre each, moved to the last anchor by dead reckoning
    assert error_at_the_end(live[1][-1], surfaced) < 3.0 < drifted
    assert error_at_the_end(live[0].trajectory, surfaced) < 3.0
    assert live[0].fixes.notes == ("Fixes at the surface: 10 of 10 hold the track, at 1 of its anchors.",)


def test_fixes_that_are_wildly_wrong_bend_nothing_and_are_said(silent, config, last_seconds):
    live, tracks = fed(with_fixes(silent, last_seconds, (900.0, -700.0)), config, 450)
    np.testing.assert_array_equal(tracks[-1].poses, silent.trajectory_dr.poses)
    assert live.fixes.counts["fixes_rejected"] == 10
    assert "they lie farther off than dead reckoning can be wrong" in live.fixes.notes[0]


def test_a_dive_too_short_for_four_windows_is_taken_in_when_it_is_finished(silent, config):
    live = sssslam.Slam(config)
    live.add(silent[:200])
    assert not live.submaps
    live.finish()
    assert live.submaps
    live.finish()  # says nothing new
    with pytest.raises(ValueError, match=r"the dive was finished; a new Slam is wanted"):
        live.add(silent[200:300])


def test_without_pings_there_is_nothing_to_finish(config):
    with pytest.raises(ValueError, match="no ping has come yet"):
        sssslam.Slam(config).finish()


def test_each_fix_is_noted_once_and_waits_for_its_ping(surfaced, config):
    log, track = FixLog(), surfaced.trajectory_dr
    for first in range(0, surfaced.n_pings, CHUNK):
        log.take(surfaced[first : first + CHUNK])  # each with the sensors of the whole dive
    time = surfaced.sensors["gnss"]["time"]
    assert [log.n_near(track.time[track.time <= end]) for end in (time[0] - 5.0, time[-1])] == [0, 10]
    reckoning = DeadReckoning(track.time, track.poses, config.dead_reckoning)
    seen = log.at_anchors(np.array([0, len(track) - 1]), reckoning, config.do_no_harm)
    assert [(fix.anchor, fix.n_fixes) for fix in seen.taken] == [(1, 10)]


def test_fixes_that_come_with_their_own_pings_are_all_noted(surfaced):
    log, (time, x, y) = FixLog(), (surfaced.sensors["gnss"][name] for name in ("time", "position_x", "position_y"))
    for few in (slice(0, 4), slice(4, 10), slice(2, 7)):  # the last come late, and are known
        gnss = {"time": time[few], "position_x": x[few], "position_y": y[few]}
        log.take(replace(surfaced, sensors={"gnss": gnss}))
    log.take(replace(surfaced, sensors={}))
    assert log.n_near(surfaced.ping_time) == 10
