"""A dive that loses the bottom, and one whose windows are cut at its turns, from the recording to the products."""

from dataclasses import replace

import numpy as np
import pytest

import sssslam
from sssslam.products.run import read_run
from sssslam.simulation import Scene

SCENE = Scene.model_validate(
    {
        "seed": 4,
        "terrain": {"size": [260.0, 160.0], "depth": 60.0, "layers": [{"kind": "sediment", "rms": 0.05}]},
        "survey": {"pattern": "legs", "legs": [[-60.0, -10.0, 60.0, -10.0], [60.0, 15.0, -60.0, 15.0]]},
        "sonar": {"range_max": 50.0},
    }
)
QUICK = ["reconstruction.joint.spacing=2.0", "reconstruction.joint.n_levels=1", "radiometry.n_rounds=0"]


@pytest.fixture(scope="module")
def recording():
    return sssslam.simulate(SCENE)


def without_bottom(recording, n):
    """The same dive with nothing but noise and no altitude in its first n pings."""
    noise = np.random.default_rng(3).exponential(1e-6, (2, n, recording.n_samples)).astype(np.float32)
    port, starboard, altitude = recording.port.copy(), recording.starboard.copy(), recording.altitude.copy()
    port[:n], starboard[:n], altitude[:n] = *noise, np.nan
    return replace(recording, port=port, starboard=starboard, altitude=altitude)


def test_windows_without_a_bottom_are_skipped_and_the_run_goes_on(recording, tmp_path):
    blind = without_bottom(recording, recording.n_pings // 2)
    result = sssslam.slam(blind, sssslam.load_config(settings=QUICK))
    result.write(tmp_path)
    run = read_run(tmp_path)
    n_skipped = run.manifest["counts"]["windows_skipped"]
    assert n_skipped >= 1
    assert [submap.number for submap in run.submaps] == list(range(len(result.submaps)))
    assert len(run.trajectory) == recording.n_pings  # the track is whole
    said = next(note for note in run.manifest["notes"] if note.startswith("Skipped"))
    n_windows = n_skipped + len(result.submaps)
    assert said == f"Skipped {n_skipped} of {n_windows} windows: {n_skipped} for bottom lost over most of it."
    assert said in (tmp_path / "report.html").read_text()


def test_pings_as_they_come_skip_the_same_windows(recording):
    config = sssslam.load_config(settings=[*QUICK, "windows.length=25"])
    blind = without_bottom(recording, recording.n_pings // 3)
    live = sssslam.Slam(config)
    for first in range(0, recording.n_pings, 200):
        live.add(blind[first : first + 200])
    assert live.skipped.counts["windows_skipped"] >= 1
    assert [submap.number for submap in live.submaps] == list(range(len(live.submaps)))
    starts = [submap.first_ping for submap in live.submaps]
    assert starts == sorted(set(starts))
    assert starts[0] > 0


def test_adaptive_windows_part_the_legs_from_the_turn(recording):
    config = sssslam.load_config(settings=[*QUICK, "windows.method=adaptive"])
    result = sssslam.slam(recording, config)
    yaw = np.unwrap(recording.trajectory_dr.yaw)
    spreads = [float(np.ptp(yaw[s.first_ping : s.end_ping])) for s in result.submaps]
    # two legs on which only waves and the reach of the cut turn the vehicle, and a half circle between them
    assert sum(spread < 2 * config.windows.min_turn for spread in spreads) >= 2
    assert max(spreads) > 2.0
    assert any("cut at turns" in note for note in result.notes)
