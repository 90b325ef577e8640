"""Health: each fault, made on purpose, is found; a sound recording has none."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from frontend.georeference import Georeference
from frontend.recording import Quantity, Recording, SonarGeometry
from frontend.trajectory import Trajectory
from frontend.transfer import estimate_transfer
from sssslam.health import Health, examine
from sssslam.health.figure import draw_health
from sssslam.health.track import count_crossings
from sssslam.readers.ping_times import repair_times


def _recording(n: int = 200, m: int = 300) -> Recording:
    """A sound dive: 2 m/s east at 5 Hz, 5 m above a flat floor, 45 m range, gamma speckle, a rolling vehicle."""
    rng = np.random.default_rng(11)
    time = 0.2 * np.arange(n)
    wave = np.radians(2.0) * np.sin(time)
    trajectory = Trajectory(1.7e9 + time, 2.0 * time, 0 * time, -20 + wave, wave, 0.5 * wave, 0.3 * wave)
    slant_range = (np.arange(m) + 0.5) * 0.15
    level = np.where(slant_range < 5.0, 2.0, 400.0 / np.maximum(slant_range, 5.0))
    port, starboard = (rng.gamma(2.0, 0.5, (n, m)) * level for _ in range(2))
    return Recording(
        port=port.astype(np.float32),
        starboard=starboard.astype(np.float32),
        sample_spacing=np.full(n, 0.15),
        sound_speed=np.full(n, 1490.0),
        trajectory_dr=trajectory,
        altitude=5.0 + 0.05 * np.sin(time),
        depth=20.0 - wave,
        speed=np.full(n, 2.0),
        sonar=SonarGeometry(frequency=4.5e5),
        georeference=Georeference(60.0, 5.0),
    )


def _said(health: Health) -> str:
    return " | ".join(f"{finding.what} -> {finding.advice}" for finding in health.findings)


def _moved(recording: Recording, **changes) -> Recording:
    return replace(recording, trajectory_dr=replace(recording.trajectory_dr, **changes))


def test_a_sound_recording_has_rows_and_no_finding():
    health = examine(_recording())
    assert _said(health) == ""
    rows = dict(health.rows)
    assert rows["pings"] == "200 of 300 samples a side"
    assert rows["slant range"] == "45 m"
    assert rows["sample spacing"] == "150 mm"
    assert rows["frequency"] == "450 kHz"
    assert rows["start"] == "2023-11-14 22:13:20 UTC"
    assert rows["duration"] == "39.8 s"
    assert rows["ping rate"] == "5 Hz"
    assert rows["ping spacing"] == "0.4 m"
    assert rows["distance"] == "79.6 m"
    assert rows["course"] == "straight; no place is passed twice"
    assert rows["origin"] == "60.000000, 5.000000 deg"
    assert rows["altitude"] == "4.95 to 5.05 m"
    assert rows["sound speed"] == "1490 m/s"
    assert rows["heading"].startswith("90 deg at the start")


def _with_gap(r):
    return _moved(r, time=r.ping_time + np.where(np.arange(200) < 100, 0.0, 30.0))


def _with_jump(r):
    return _moved(r, y=np.where(np.arange(200) < 100, 0.0, 50.0))


def _with_bursts(r):
    stamps = np.repeat(r.ping_time[::4], 4)
    return replace(r, notes=tuple(repair_times(stamps, 0.2)[1]))


def _with_clock_set_back(r):
    stamps = r.ping_time - np.where(np.arange(200) < 100, 0.0, 3600.0)
    return replace(r, notes=tuple(repair_times(stamps, 0.2)[1]))


def _called(r, quantity):
    return replace(r, sonar=replace(r.sonar, quantity=quantity))


def _frozen(values):
    return np.where(np.arange(200) < 50, values, values[50])


FAULTS = {
    "ping times repeat or come in bursts": _with_bursts,
    "the clock was set back": _with_clock_set_back,
    "position does not change for 30 s from 10 s on": lambda r: _moved(
        r, x=_frozen(r.trajectory_dr.x), y=_frozen(r.trajectory_dr.y)
    ),
    "depth does not change for 30 s": lambda r: replace(r, depth=_frozen(r.depth)),
    "port has 4 grey levels only": lambda r: replace(r, port=np.clip(np.rint(r.port / 20), 0, 3)),
    "of the starboard samples are 0": lambda r: replace(r, starboard=np.where(r.starboard < 30, 0, r.starboard)),
    "the bottom is seen in": lambda r: replace(r, port=r.port[:, ::-1], starboard=r.starboard[:, ::-1]),
    "the samples are called intensity and look like a logarithm of it": lambda r: replace(
        _called(r, Quantity.INTENSITY), starboard=np.log(r.starboard + 1e-9)
    ),
    "the samples are called logarithmic and look linear": lambda r: _called(r, Quantity.LOG),
    "time has gaps (1x), the longest 30.2 s": _with_gap,
    "the position jumps (1x), by up to 50.0 m": _with_jump,
    "the position jumps (1x), by up to 51.2 m": lambda r: _moved(
        r, y=np.interp(np.arange(200), [0, 100, 103, 200], [0, 0, 51.18, 51.18])
    ),
    "the clock says 1970-01-01": lambda r: _moved(r, time=r.ping_time - 1.7e9),
    "sound needs 60 ms": lambda r: _moved(r, time=1.7e9 + 0.03 * np.arange(200)),
    "the vehicle moves 0.0 m in all": lambda r: _moved(r, x=np.zeros(200)),
    "recorded speed is 4.00 m/s, the track's 2.00 m/s": lambda r: replace(r, speed=np.full(200, 4.0)),
    "heading is 20 deg left of the course": lambda r: _moved(r, yaw=r.trajectory_dr.yaw + np.radians(20)),
    "heading is 20 deg right of the course": lambda r: _moved(r, yaw=r.trajectory_dr.yaw - np.radians(20)),
    "heading is opposite to the course": lambda r: _moved(r, yaw=r.trajectory_dr.yaw + np.pi),
    "roll is 0 in every ping": lambda r: _moved(r, roll=np.zeros(200)),
    "the nose points 20 deg down": lambda r: _moved(r, pitch=r.trajectory_dr.pitch + np.radians(20)),
    "altitude is 1% of the range": lambda r: replace(
        r, altitude=np.full(200, 0.5), port=np.ones_like(r.port), starboard=np.ones_like(r.port)
    ),
    "no first bottom return is seen": lambda r: replace(
        r, altitude=np.full(200, np.nan), port=np.ones_like(r.port), starboard=np.ones_like(r.port)
    ),
    "times the recorded altitude": lambda r: replace(r, altitude=r.altitude / 1.2),
    "yaw does not change for 30 s from 10 s on": lambda r: _moved(r, yaw=_frozen(r.trajectory_dr.yaw)),
    "altitude does not change for 30 s": lambda r: replace(r, altitude=_frozen(r.altitude)),
    "sound speed is not that of water": lambda r: replace(r, sound_speed=np.full(200, 745.0)),
    "port holds no echoes": lambda r: replace(r, port=np.full_like(r.port, np.nan)),
    "starboard holds no echoes": lambda r: replace(r, starboard=np.zeros_like(r.port)),
    "of the port samples are at the greatest value, 20": lambda r: replace(r, port=np.minimum(r.port, np.float32(20))),
    "starboard is 10.0 times darker": lambda r: replace(r, starboard=r.port / 10),
    "port is 10.0 times darker": lambda r: replace(r, port=r.starboard / 10),
    "neither side holds echoes": lambda r: replace(r, port=np.zeros_like(r.port), starboard=np.zeros_like(r.port)),
    "of the port samples are at the greatest value, 32767 ->": lambda r: replace(
        r, port=np.minimum(1000 * r.port, 32767)
    ),
    "pitch is not recorded: 0 is assumed -> level flight is assumed": lambda r: replace(
        _moved(r, pitch=np.zeros(200)), notes=("pitch is not recorded: 0 is assumed",)
    ),
    "33% of the pings could not be used": lambda r: replace(r, n_dropped=100),
    "there is one ping only": lambda r: r[:1],
}


@pytest.mark.parametrize("words", FAULTS)
def test_a_fault_is_found(words):
    assert words in _said(examine(FAULTS[words](_recording())))


def test_a_vehicle_at_the_surface_has_no_frozen_depth_sensor():
    sound = _recording()
    assert "depth" not in _said(examine(replace(sound, depth=_frozen(0.01 * sound.depth))))


def test_one_dark_side_is_not_two():
    sound = _recording()
    said = _said(examine(replace(sound, port=np.zeros_like(sound.port), starboard=np.zeros_like(sound.port))))
    assert "only one side" not in said


def test_a_recording_is_not_changed_by_its_examination():
    recording = _recording()
    before = recording.port.copy(), recording.altitude.copy(), recording.trajectory_dr.yaw.copy()
    examine(recording)
    for one, other in zip(before, (recording.port, recording.altitude, recording.trajectory_dr.yaw), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_track_that_comes_back_is_turning_and_passed_again():
    recording, k = _recording(1200), np.arange(1200)
    there_and_back = np.where(k < 600, 0.4 * k, 0.4 * (1199 - k))
    yaw = np.where(k < 600, 0.0, np.pi)
    course = dict(examine(_moved(recording, x=there_and_back, y=np.where(k < 600, 0.0, 10.0), yaw=yaw)).rows)["course"]
    # d m before the turn a place u m farther on the other leg is 2 d + 10 + u m on and hypot(10, u) m across: at best,
    # with u = 3.5 m, three times as much from d = 9.1 m of 240 m on.
    assert course == "turning, 180 deg between extreme headings; 96% of the track is passed again"


def test_a_track_that_crosses_itself_is_counted_and_jitter_is_not():
    recording = _recording(400)
    # A figure of eight passes through its middle twice: one crossing. It starts behind its middle and ends behind it.
    turn = np.linspace(0.3, 2 * np.pi + 0.2, 400)
    eight = _moved(recording, x=40 * np.sin(turn), y=40 * np.sin(2 * turn) / 2)
    assert count_crossings(eight) == 1
    course = dict(examine(eight).rows)["course"]
    assert "it crosses itself 1x" in course
    assert "of the track is passed again" in course  # a crossing is a place passed twice
    jitter = np.random.default_rng(0).normal(0, 0.5, 400)
    assert count_crossings(_moved(recording, y=jitter, x=recording.trajectory_dr.x + np.roll(jitter, 7))) == 0


def test_compression_is_what_a_run_would_take_the_samples_for():
    linear = _recording()
    decibels = {side: 20 * np.log10(np.maximum(getattr(linear, side), 1e-3)) for side in ("port", "starboard")}
    for recording in (linear, replace(linear, **decibels)):
        said = dict(examine(recording).rows)["compression"]
        guess = estimate_transfer(recording)
        assert said.endswith(f": like {guess.quantity}, probability {guess.confidence:.0%}")
    assert guess.quantity is Quantity.LOG


def test_samples_too_alike_have_no_compression():
    recording = _recording()
    flat = np.full_like(recording.port, 7.0)
    assert "compression" not in dict(examine(replace(recording, port=flat, starboard=flat)).rows)


def test_the_waterfall_is_drawn_with_and_without_a_bottom(tmp_path):
    recording = _recording()
    flat = replace(recording, altitude=np.full(200, np.nan), port=np.ones_like(recording.port))
    flat = replace(flat, starboard=flat.port)
    pictures = [tmp_path / "deep" / "a.png", tmp_path / "b.png", tmp_path / "c.png"]
    for path, what in zip(pictures, (recording, recording, flat), strict=True):
        draw_health(what, path)
    assert pictures[0].read_bytes() == pictures[1].read_bytes()
    assert pictures[2].read_bytes()[:4] == b"\x89PNG"


def test_unknown_things_are_called_so():
    recording = _recording()
    unknown = np.full(200, np.nan)
    bare = replace(recording, georeference=None, sonar=SonarGeometry(), altitude=unknown, depth=unknown, speed=unknown)
    rows = dict(examine(bare).rows)
    assert rows["origin"] == "unknown, local metres"
    assert rows["frequency"] == "unknown"
    assert rows["altitude"] == rows["depth"] == "not recorded"
    partly = np.where(np.arange(200) < 50, np.nan, recording.altitude)
    assert "missing in 25%" in dict(examine(replace(recording, altitude=partly)).rows)["altitude"]


def test_the_scotsman_dive_shows_its_known_faults():
    folder = os.environ.get("SSSSLAM_DATA")
    if not folder:
        pytest.skip("SSSSLAM_DATA is not set: no real recordings")
    from sssslam.readers import read

    health = examine(read(Path(folder) / "recordings" / "scotsman-iver2.xtf"))
    said = _said(health)
    # Its description: pitch to -23 degrees, first return 1.09 to 1.12 times the altitude, a straight track.
    assert "the nose points 20 deg down" in said
    assert "the first bottom return is 1.1" in said
    assert dict(health.rows)["course"] == "straight; no place is passed twice"
    assert "like amplitude" in dict(health.rows)["compression"]


def test_the_starfish_dive_shows_its_known_faults():
    folder = os.environ.get("SSSSLAM_DATA")
    if not folder:
        pytest.skip("SSSSLAM_DATA is not set: no real recordings")
    from sssslam.readers import read

    health = examine(read(Path(folder) / "recordings" / "starfish-iver2-barbados.logdoc"))
    said = _said(health)
    # Its description: bursts of stamps, no roll or pitch, a track that crosses itself twice.
    assert "ping times repeat or come in bursts" in said
    assert "roll is not recorded" in said
    assert "depth does not change" not in said
    course = dict(health.rows)["course"]
    assert "it crosses itself 2x" in course
    assert "no place is passed twice" not in course
