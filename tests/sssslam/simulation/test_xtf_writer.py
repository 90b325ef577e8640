"""What is written is read back by our own reader, and by pyxtf."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyxtf

from frontend.frames import heading_from_yaw
from frontend.recording import Recording
from sssslam.readers import read
from sssslam.simulation import Scene, simulate, simulate_chunks, write_xtf

SMALL: dict[str, Any] = {
    "terrain": {"size": (100.0, 100.0), "spacing": 1.0},
    "survey": {"pattern": "legs", "legs": [(-8.0, 0.0, 8.0, 1.0)]},
    "sonar": {"range_max": 30.0, "sample_spacing": 0.25, "ping_rate": 4.0, "ray_step": 0.25},
    "drift": {"grade": "tactical"},
}
PLACE = {"position": (-20.0, 179.9999)}
LINEAR = {"recorder": {"format": "linear", "bits": 16}}
LOGARITHMIC = {"recorder": {"format": "log", "bits": 8}}


@pytest.mark.parametrize("values", [{}, PLACE, LINEAR, {**LOGARITHMIC, **PLACE}])
def test_our_reader_gets_back_what_was_simulated(tmp_path: Path, values: dict[str, Any]) -> None:
    scene = Scene.model_validate({**SMALL, **values})
    written = simulate(scene)
    write_xtf(simulate_chunks(scene, 10), tmp_path / "dive.xtf", scene.recorder.sample_type)
    back = read(tmp_path / "dive.xtf")
    np.testing.assert_array_equal(back.port, written.port)
    np.testing.assert_array_equal(back.starboard, written.starboard)
    # Times have hundredths, the rest is in single precision; the reader's origin is the first ping.
    np.testing.assert_allclose(back.ping_time, written.ping_time, atol=0.0051)
    for name in ("x", "y"):
        there, here = getattr(back.trajectory_dr, name), getattr(written.trajectory_dr, name)
        np.testing.assert_allclose(there - there[0], here - here[0], atol=1e-3)
    np.testing.assert_allclose(back.trajectory_dr.z, written.trajectory_dr.z, atol=1e-4)
    for name in ("roll", "pitch", "yaw"):
        np.testing.assert_allclose(getattr(back.trajectory_dr, name), getattr(written.trajectory_dr, name), atol=1e-6)
    for name in ("altitude", "depth", "speed", "sound_speed", "sample_spacing"):
        np.testing.assert_allclose(getattr(back, name), getattr(written, name), rtol=1e-5)
    assert back.sonar.lever_arm_port == pytest.approx(written.sonar.lever_arm_port)
    assert back.sonar.frequency == pytest.approx(400e3)
    assert back.sonar.vertical_beamwidth == pytest.approx(np.radians(50.0))


def test_pyxtf_reads_the_file(tmp_path: Path) -> None:
    scene = Scene.model_validate({**SMALL, **LINEAR, **PLACE})
    written = simulate(scene)
    write_xtf([written], tmp_path / "dive.xtf", "<u2")
    header, packets = pyxtf.xtf_read(str(tmp_path / "dive.xtf"))
    pings = packets[pyxtf.XTFHeaderType.sonar]
    assert header.channel_count() == 2
    assert len(pings) == written.n_pings
    ping = pings[5]
    # Port far end first, starboard near end first.
    np.testing.assert_array_equal(ping.data[0][::-1], written.port[5])
    np.testing.assert_array_equal(ping.data[1], written.starboard[5])
    assert (ping.Year, ping.Month, ping.Day, ping.Hour) == (2024, 1, 1, 0)
    assert ping.Second + ping.HSeconds / 100 == pytest.approx(1.25)
    track = written.trajectory_dr
    assert ping.SensorHeading == pytest.approx(np.degrees(heading_from_yaw(track.yaw))[5], abs=1e-4)
    # XTF's pitch is nose up.
    assert ping.SensorPitch == pytest.approx(-np.degrees(track.pitch[5]), abs=1e-5)
    assert ping.SoundVelocity == pytest.approx(750.0)
    assert (tmp_path / "dive.xtf").stat().st_size % 64 == 0


def _recording() -> Recording:
    return simulate(Scene.model_validate(SMALL))


def test_unknown_samples_are_zero_in_whole_numbers(tmp_path: Path) -> None:
    recording = simulate(Scene.model_validate({**SMALL, **LINEAR}))
    recording.port[3, 7] = np.nan
    write_xtf([recording], tmp_path / "dive.xtf", "<u2")
    assert read(tmp_path / "dive.xtf").port[3, 7] == 0.0


def test_samples_that_do_not_fit_are_refused_and_leave_no_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"samples from 0 to [\d.e+]+ given, 0 to 255 wanted for u1"):
        write_xtf([_recording()], tmp_path / "dive.xtf", "u1")
    assert list(tmp_path.iterdir()) == []


def test_no_recording_is_refused_and_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no recording given, at least one wanted"):
        write_xtf([], tmp_path / "dive.xtf")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"dive\.xtf: cannot be written \(No such file or directory\)"):
        write_xtf([_recording()], tmp_path / "none" / "dive.xtf")
