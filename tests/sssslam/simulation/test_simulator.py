import os
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from frontend.recording import Quantity, Recording
from sssslam.readers.netcdf import read_netcdf, write_netcdf
from sssslam.readers.netcdf_writing import write_netcdf_chunks
from sssslam.simulation import Scene, load_scene, simulate, simulate_chunks, with_seed
from sssslam.simulation.simulator import EPOCH, ping_times

SMALL: dict[str, Any] = {
    "seed": 3,
    "terrain": {"size": (120.0, 110.0), "spacing": 0.5},
    "survey": {"pattern": "legs", "legs": [(-20.0, 0.0, 20.0, 4.0)]},
    "sonar": {"range_max": 40.0, "sample_spacing": 0.1, "ping_rate": 4.0, "ray_step": 0.1},
    "drift": {"grade": "mems"},
}


def _scene(**values: Any) -> Scene:
    return Scene.model_validate({**SMALL, **values})


def _same(one: Recording, other: Recording) -> bool:
    """Whether two recordings have the same bytes throughout."""
    rows = ("port", "starboard", "sample_spacing", "altitude", "depth", "speed")
    tracks = ("time", "x", "y", "z", "roll", "pitch", "yaw")
    pairs = [(getattr(one, name), getattr(other, name)) for name in rows]
    pairs += [(getattr(one.trajectory_dr, name), getattr(other.trajectory_dr, name)) for name in tracks]
    pairs += [(one.sensors[s][name], other.sensors[s][name]) for s in one.sensors for name in one.sensors[s]]
    return all(a.tobytes() == b.tobytes() for a, b in pairs)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """A short dive."""
    return simulate(_scene())


def test_a_recording_has_what_the_contract_asks_for(recording: Recording) -> None:
    assert recording.port.shape == recording.starboard.shape == (80, 400)
    assert recording.port.dtype == recording.starboard.dtype == np.float32
    assert recording.sonar.quantity is Quantity.INTENSITY
    assert recording.sonar.frequency == 400e3
    assert recording.ping_time[0] == EPOCH
    np.testing.assert_allclose(np.diff(recording.ping_time), 0.25, atol=1e-6)
    np.testing.assert_allclose(recording.depth, -recording.trajectory_dr.z)
    assert recording.truth is not None
    assert recording.truth.terrain is not None
    np.testing.assert_array_equal(recording.truth.trajectory.time, recording.ping_time)
    assert set(recording.sensors) == {"altimeter", "compass", "depth", "dvl", "imu"}
    assert all(series["time"][0] >= EPOCH for series in recording.sensors.values())


def test_the_vehicle_is_where_the_truth_says_and_not_where_it_reckons(recording: Recording) -> None:
    truth, track = recording.truth.trajectory, recording.trajectory_dr  # type: ignore[union-attr]
    assert (track.x[0], track.y[0]) == pytest.approx((truth.x[0], truth.y[0]))
    assert np.hypot(track.x[-1] - truth.x[-1], track.y[-1] - truth.y[-1]) > 0.05
    over_floor = truth.z - recording.truth.terrain.sample(truth.x, truth.y)  # type: ignore[union-attr]
    # A DVL averages four slanted beams over fractal relief.
    np.testing.assert_allclose(recording.altitude, over_floor, atol=0.7)


def test_the_first_bottom_return_emerges_near_the_altitude(recording: Recording) -> None:
    mean = recording.starboard.mean(axis=0)
    noise = mean[: int(9.0 / 0.1)].mean()
    first = np.flatnonzero(mean > 20 * noise)[0] * 0.1
    assert 10.5 < first < 13.5


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(recording: Recording) -> None:
    assert _same(simulate(_scene()), recording)
    assert not np.array_equal(simulate(with_seed(_scene(), 4)).port, recording.port)


def test_the_number_of_threads_changes_no_byte(recording: Recording) -> None:
    n_threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        assert _same(simulate(_scene()), recording)
    finally:
        numba.set_num_threads(n_threads)


@pytest.mark.parametrize("n_pings", [1000, 17])
def test_a_dive_in_pieces_is_the_dive_at_once(recording: Recording, n_pings: int) -> None:
    pieces = list(simulate_chunks(_scene(), n_pings))
    for side in ("port", "starboard"):
        np.testing.assert_array_equal(np.concatenate([getattr(p, side) for p in pieces]), getattr(recording, side))
    for name in ("x", "y", "yaw"):
        joined = np.concatenate([getattr(piece.trajectory_dr, name) for piece in pieces])
        np.testing.assert_array_equal(joined, getattr(recording.trajectory_dr, name))
    for sensor, series in recording.sensors.items():
        joined = np.concatenate([piece.sensors[sensor]["time"] for piece in pieces])
        np.testing.assert_array_equal(joined, series["time"])


def test_a_dive_written_in_pieces_reads_back_as_the_dive_at_once(recording: Recording, tmp_path: Path) -> None:
    write_netcdf(recording, tmp_path / "once.nc")
    write_netcdf_chunks(simulate_chunks(_scene(), 17), tmp_path / "pieces.nc")
    once, pieces = (read_netcdf(tmp_path / name) for name in ("once.nc", "pieces.nc"))
    assert _same(once, recording)
    assert _same(pieces, recording)
    assert pieces.sensors.keys() == recording.sensors.keys()
    assert (pieces.sonar, pieces.source, pieces.source_sha256) == (once.sonar, once.source, once.source_sha256)
    assert once.truth is not None
    assert pieces.truth is not None
    np.testing.assert_array_equal(pieces.truth.terrain.z, once.truth.terrain.z)  # type: ignore[union-attr]
    np.testing.assert_array_equal(pieces.truth.trajectory.positions, once.truth.trajectory.positions)


def test_a_dive_without_a_compass_keeps_its_gyro_in_the_container(tmp_path: Path) -> None:
    write_netcdf_chunks(simulate_chunks(_scene(sensors={"compass_rate": 0.0}), 17), tmp_path / "dive.nc")
    assert set(read_netcdf(tmp_path / "dive.nc").sensors) == {"altimeter", "depth", "directional_gyro", "dvl", "imu"}


def test_echoes_kept_in_files_are_the_same(recording: Recording, tmp_path: Path) -> None:
    kept = simulate(_scene(), tmp_path)
    assert _same(kept, recording)
    np.testing.assert_array_equal(np.load(tmp_path / "port.npy"), recording.port)


def test_speckle_of_the_sides_is_not_the_same(recording: Recording) -> None:
    assert abs(np.corrcoef(recording.port[:, :80].ravel(), recording.starboard[:, :80].ravel())[0, 1]) < 0.05


def test_recorders_keep_their_own_numbers() -> None:
    logarithmic = simulate(_scene(recorder={"format": "log", "bits": 8}))
    assert logarithmic.sonar.quantity is Quantity.LOG
    assert logarithmic.port.max() <= 255.0
    assert np.array_equal(logarithmic.port, np.rint(logarithmic.port))


def test_a_scene_with_a_place_on_the_earth_is_georeferenced() -> None:
    placed = simulate(_scene(position=(48.0, -4.5)))
    assert placed.georeference is not None
    assert (placed.georeference.latitude, placed.georeference.longitude) == (48.0, -4.5)


def test_moving_while_the_sound_travels_changes_the_echo_a_little() -> None:
    quiet = {"speckle": {"looks": 1e9}}
    hop = simulate(_scene(**quiet, sonar={**SMALL["sonar"], "motion": "stop-and-hop"}))
    travel = simulate(_scene(**quiet))
    assert not np.array_equal(hop.port, travel.port)
    lit = hop.port > 100 * np.median(hop.port[:, :50])
    assert np.median(np.abs(travel.port[lit] / hop.port[lit] - 1)) < 0.1


def test_pings_faster_than_their_echoes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"a ping rate of 30\.0 1/s given, but an echo from 40\.0 m takes 0\.053 s"):
        ping_times(_scene(sonar={**SMALL["sonar"], "ping_rate": 30.0}), 10.0)


def test_a_shorter_dive_than_a_ping_has_one() -> None:
    assert ping_times(_scene(), 0.1).tolist() == [0.0]


def test_the_demo_crosses_its_own_track_and_drifts() -> None:
    from sssslam.simulation.simulator import prepare

    scene = load_scene("demo")
    scene = scene.model_copy(update={"terrain": scene.terrain.model_copy(update={"spacing": 2.0})})
    dive = prepare(scene)
    truth = dive.motion.trajectory(dive.time)
    assert 1600 < truth.distance[-1] < 2300
    error = np.hypot(dive.trajectory_dr.x - truth.x, dive.trajectory_dr.y - truth.y)
    assert 15 < error.max() < 60
    headings = np.unique(np.round(np.degrees(truth.yaw[np.abs(np.gradient(truth.yaw)) < 2e-3]) / 45.0).astype(int) % 8)
    assert headings.size >= 4


@pytest.mark.skipif(not os.environ.get("SSSSLAM_DATA"), reason="SSSSLAM_DATA is not set: no real terrain")
def test_a_real_seafloor_and_a_real_track_make_a_scene(tmp_path: Path) -> None:
    data = Path(os.environ["SSSSLAM_DATA"])
    path = tmp_path / "caves.toml"
    path.write_text(
        f"""
[terrain]
size = [360.0, 360.0]
spacing = 0.5
[[terrain.layers]]
kind = "grid"
file = "{data / "terrain" / "south-falls-1m.npz"}"
[[terrain.layers]]
kind = "fractal"
rms = 0.05
longest = 4.0
[survey]
pattern = "track"
file = "{data / "navigation" / "girona-caves-reference.csv"}"
scale = 2.0
[sonar]
range_max = 30.0
sample_spacing = 0.2
ping_rate = 0.5
ray_step = 0.2
""",
        encoding="utf-8",
    )
    recording = simulate(load_scene(path))
    assert recording.truth is not None
    # Smoothing cuts the corners of a way of 2 x 483 m.
    assert 600 < recording.truth.trajectory.distance[-1] < 970
    assert np.isfinite(recording.altitude).all()
