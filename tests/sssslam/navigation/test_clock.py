"""The clock: an offset put in on purpose comes out, within its uncertainty; series that do not tell are refused."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sssslam.navigation.clock import estimate_clock_offset
from sssslam.navigation.log import NavigationLog
from sssslam.navigation.series import Series, make_series
from tests.sssslam.navigation.conftest import START, vehicle


def _log(offset: float, noise: float, *names: str) -> NavigationLog:
    """A log whose clock is slow: `offset` has to be added to its times."""
    time = np.arange(-20.0, 150.0, 0.25)
    rng = np.random.default_rng(2)
    said = vehicle(time)
    series = {n: Series(START + time - offset, said[n] + rng.normal(0, noise, len(time))) for n in names}
    return NavigationLog("log.csv", series)


@pytest.mark.parametrize("offset", [-13.37, 0.0, 4.2])
@pytest.mark.parametrize(("name", "noise"), [("altitude", 0.1), ("yaw", 0.02), ("roll", 0.005), ("depth", 0.05)])
def test_an_offset_is_found_within_its_uncertainty(dive, offset, name, noise):
    clock, notes = estimate_clock_offset(dive(), _log(offset, noise, name))
    # Four standard deviations, and a twentieth of the log's step for what linear interpolation adds.
    assert abs(clock.offset - offset) < 4 * clock.sigma + 0.01
    assert clock.sigma < 0.5
    assert notes[0].startswith("clock offset")


def test_the_bottom_alone_tells_the_offset_where_the_recording_has_no_navigation(dive):
    recording = dive(altitude=np.full(600, np.nan))
    clock, _ = estimate_clock_offset(recording, _log(6.0, 0.05, "altitude"))
    assert "first bottom return" in clock.how
    assert clock.offset == pytest.approx(6.0, abs=0.5)


def test_the_standard_deviation_is_that_of_many_trials(dive):
    recording, rng = dive(), np.random.default_rng(8)
    time = np.arange(-20.0, 150.0, 0.2)
    found = []
    for _ in range(12):
        yaw = vehicle(time)["yaw"] + rng.normal(0, 0.05, len(time))
        log = NavigationLog("log.csv", {"yaw": Series(START + time - 3.0, yaw)})
        found.append(estimate_clock_offset(recording, log)[0])
    spread = np.std([clock.offset for clock in found], ddof=1)
    claimed = np.mean([clock.sigma for clock in found])
    # 12 trials know a standard deviation to 20 %; the smoothing of the noise is worth a factor too.
    assert 0.5 < claimed / spread < 2.5


@pytest.mark.parametrize("kind", ["noise", "constant", "periodic"])
def test_series_that_do_not_tell_are_refused_in_one_line(dive, kind):
    time = np.arange(-100.0, 250.0, 0.25)
    values = {
        "noise": np.random.default_rng(1).normal(size=len(time)),
        "constant": np.full(len(time), 0.1),
        "periodic": np.sin(2 * np.pi * time / 6.0),
    }[kind]
    recording = dive()
    if kind == "periodic":
        roll = np.sin(2 * np.pi * (recording.ping_time - START) / 6.0)
        recording = replace(recording, trajectory_dr=replace(recording.trajectory_dr, roll=roll))
    with pytest.raises(ValueError, match=r"log.csv: the clock offset cannot be told from roll") as error:
        estimate_clock_offset(recording, NavigationLog("log.csv", {"roll": Series(START + time, values)}))
    assert "\n" not in str(error.value)


def test_a_log_of_a_million_rows_in_a_second_takes_no_longer_than_its_length_asks_for(dive):
    recording, time = dive(), START + np.linspace(50.0, 51.0, 1_000_000)
    log = NavigationLog("log.csv", {"roll": Series(time, np.sin(time - START))})
    with pytest.raises(ValueError, match="cannot be told from roll"):
        estimate_clock_offset(recording, log)


@pytest.mark.skipif("SSSSLAM_DATA" not in os.environ, reason="SSSSLAM_DATA is not set: no real recordings")
@pytest.mark.parametrize("name", ["scotsman-iver2.xtf", "starfish-iver2-barbados.logdoc"])
def test_the_echoes_of_a_real_dive_tell_the_clock_of_its_altimeter(name):
    from sssslam.readers import read

    recording = read(Path(os.environ["SSSSLAM_DATA"]) / "recordings" / name)
    logs = [
        NavigationLog("log.csv", {"altitude": make_series(recording.ping_time - offset, recording.altitude)})
        for offset in (0.0, 3.7)
    ]
    plain, shifted = (estimate_clock_offset(recording, log)[0] for log in logs)
    assert shifted.offset - plain.offset == pytest.approx(3.7, abs=4 * plain.sigma)
    # An altimeter averages and is polled: it is late by less than a second, and never early.
    assert -1.0 < plain.offset < 4 * plain.sigma
