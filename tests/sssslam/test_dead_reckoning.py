from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import sssslam
from backend.dead_reckoning import DeadReckoning
from backend.drift_model import DeadReckoningConfig
from backend.sensor_errors import SensorErrorsConfig
from backend.sensor_reckoning import SensorReckoning
from frontend.georeference import Georeference
from frontend.recording import Recording
from frontend.trajectory import Trajectory
from sssslam.config import load_config
from sssslam.dead_reckoning import dead_reckon, earth_rate, first_pose_sigmas, on_the_map, suit_sensors
from sssslam.simulation import Scene
from sssslam.simulation.drift import DriftConfig
from sssslam.simulation.simulator import prepare

GRADES = ("navigation", "tactical", "mems")
SENSORS = DeadReckoningConfig(source="sensors")


def scene(grade, seed, **sections):
    """Two legs with a turn, 120 m, and no echoes."""
    return Scene.model_validate(
        {
            "seed": seed,
            "terrain": {"size": [240.0, 200.0], "spacing": 2.0},
            "survey": {"pattern": "legs", "legs": [[-40.0, -20.0, 40.0, -20.0], [40.0, 20.0, -40.0, 20.0]]},
            "drift": {"grade": grade},
            **sections,
        }
    )


def errors_of(drift: DriftConfig) -> DeadReckoningConfig:
    """What a data sheet of the simulated equipment would say."""
    sensors = SensorErrorsConfig(
        gyro_bias_sd=np.radians(drift.gyro_bias_deg) / 3600.0,
        gyro_noise=np.radians(drift.gyro_noise_deg) / 60.0,
        accelerometer_bias_sd=drift.accelerometer_bias,
        accelerometer_noise=drift.accelerometer_noise,
        compass_noise=2e-4,
        depth_noise=drift.depth_noise,
    )
    return DeadReckoningConfig(
        source="sensors",
        heading_bias_sd=np.radians(drift.heading_bias_deg),
        heading_walk=np.radians(drift.heading_walk_deg) / 60.0,
        heading_deviation_sd=np.radians(drift.heading_deviation_deg),
        velocity_scale_sd=drift.velocity_scale,
        velocity_misalignment_sd=np.radians(drift.misalignment_deg),
        velocity_noise=drift.velocity_noise,
        depth_sd=drift.depth_bias,
        tilt_sd=np.radians(drift.attitude_noise_deg),
        sensors=sensors,
    )


def recording_of(dive) -> tuple[Recording, Trajectory]:
    """The dive with one silent sample a ping, and the truth."""
    n, track = dive.time.size, dive.trajectory_dr
    echo, known = np.ones((n, 1), dtype=np.float32), np.full(n, 1500.0)
    place = None if dive.scene.position is None else Georeference(*dive.scene.position)
    recording = Recording(
        echo, echo, known / 1e4, known, track, known, known, known, georeference=place, sensors=dive.sensors
    )
    return recording, dive.motion.trajectory(dive.time)


@pytest.fixture(scope="module")
def mems():
    return recording_of(prepare(scene("mems", 1)))


def test_the_recorded_track_is_taken_as_it_is_unless_the_sensors_are_asked_for(mems):
    recording, reckoning = dead_reckon(mems[0], DeadReckoningConfig())
    assert recording is mems[0]
    assert type(reckoning) is DeadReckoning


def test_the_track_from_sensors_replaces_the_recorded_one_and_brings_its_own_covariance(mems):
    recording, reckoning = dead_reckon(mems[0], SENSORS)
    assert isinstance(reckoning, SensorReckoning)
    np.testing.assert_allclose(recording.trajectory_dr.poses, reckoning.T_world_body, atol=1e-9)
    assert "Track reckoned anew from the raw sensors (compass, depth, dvl, imu)" in recording.notes[-1]
    assert mems[0].notes == ()


def test_a_recording_without_positions_is_reckoned_from_its_sensors(mems):
    n = mems[0].n_pings
    lost = replace(mems[0].trajectory_dr, x=np.zeros(n), y=np.zeros(n))
    recording, reckoning = dead_reckon(replace(mems[0], trajectory_dr=lost), DeadReckoningConfig())
    assert isinstance(reckoning, SensorReckoning)
    length = recording.trajectory_dr.distance[-1]
    assert length == pytest.approx(mems[1].distance[-1], rel=0.05)  # scale and noise of a MEMS vehicle's log


@pytest.mark.parametrize("grade", GRADES)
def test_simulated_grades_of_equipment_lie_within_their_covariances(grade):
    nees, seeds = [], range(4)
    for seed in seeds:
        dive = prepare(scene(grade, seed))
        recording, truth = recording_of(dive)
        recording, reckoning = dead_reckon(recording, errors_of(dive.scene.drift))
        error = (recording.trajectory_dr.poses - truth.poses)[-1]
        yaw = np.arctan2(*(recording.trajectory_dr.poses[-1, :3, :3] @ truth.poses[-1, :3, :3].T)[[1, 0], 0])
        x = np.array([*error[:3, 3], yaw])
        nees.append(x @ np.linalg.solve(reckoning.covariances[-1], x))
    lower, upper = chi2.ppf([0.0005, 0.9995], 4 * len(seeds))
    assert lower < sum(nees) < upper, nees


def test_a_directional_gyro_and_a_boat_with_fixes_are_understood():
    dive = prepare(
        scene(
            "mems-no-dvl",
            2,
            position=[46.5, 6.5],
            vehicle={"keeping": "depth", "depth": 0.3},
            sensors={"compass_rate": 0.0, "dvl_rate": 0.0},
        )
    )
    recording, truth = recording_of(dive)
    recording, _ = dead_reckon(recording, SENSORS)
    error = np.hypot(recording.trajectory_dr.x - truth.x, recording.trajectory_dr.y - truth.y)
    assert error.max() < 2.0  # fixes of 1 m each second


def test_fixes_in_degrees_are_brought_to_the_map():
    dive = prepare(scene("mems", 2, position=[46.5, 6.5], vehicle={"keeping": "depth", "depth": 0.3}))
    recording = recording_of(dive)[0]
    degrees = {k: v for k, v in recording.sensors["gnss"].items() if not k.startswith("position")}
    fixes = on_the_map(replace(recording, sensors={**recording.sensors, "gnss": degrees}))["gnss"]
    np.testing.assert_allclose(fixes["position_x"], recording.sensors["gnss"]["position_x"], atol=1e-6)
    nowhere = replace(recording, georeference=None, sensors={**recording.sensors, "gnss": degrees})
    assert "gnss" not in on_the_map(nowhere)


def test_the_earth_turns_about_the_vertical_at_the_pole_and_about_north_at_the_equator():
    assert np.allclose(earth_rate(Georeference(90.0, 0.0)), [0.0, 0.0, 7.292115e-5])
    assert np.allclose(earth_rate(Georeference(0.0, 0.0)), [0.0, 7.292115e-5, 0.0])
    assert not earth_rate(None).any()


def test_the_first_anchor_is_as_uncertain_as_dead_reckoning_up_to_it(mems):
    reckoning = dead_reckon(mems[0], DeadReckoningConfig(heading_bias_sd=0.1, heading_deviation_sd=0.0, depth_sd=1e-6))[
        1
    ]
    sigmas = first_pose_sigmas(reckoning, 100)
    assert sigmas[2] == pytest.approx(0.1, rel=0.05)  # and what the heading walked in 100 pings
    np.testing.assert_allclose(sigmas[3:5], reckoning.sigmas[100, :2])
    assert sigmas[5] == 1e-3
    assert (first_pose_sigmas(reckoning, 0)[3:5] == 1e-3).all()


def test_sensors_that_are_not_there_are_asked_for_in_one_line(mems):
    with pytest.raises(ValueError, match=r"dead reckoning from sensors wants compass or directional_gyro.*; got none"):
        dead_reckon(replace(mems[0], sensors={}), SENSORS)


def test_pings_as_they_come_cannot_be_smoothed():
    with pytest.raises(ValueError, match=r"dead_reckoning\.source is 'sensors'; 'recorded' is wanted"):
        sssslam.Slam(load_config(None, ["dead_reckoning.source=sensors"]))


@pytest.fixture
def without_doppler(mems):
    """The dive with the speed log of a boat in place of its Doppler log."""
    log = {"time": mems[0].ping_time, "speed": np.full(mems[0].n_pings, 1.5)}
    sensors = {name: series for name, series in mems[0].sensors.items() if name != "dvl"}
    return replace(mems[0], sensors=sensors | {"speed_log": log})


def test_a_track_without_doppler_log_drifts_like_a_speed_through_the_water(without_doppler):
    _, reckoning = dead_reckon(without_doppler, suit_sensors(DeadReckoningConfig(), without_doppler))
    _, usual = dead_reckon(without_doppler, DeadReckoningConfig())
    config = reckoning.config
    assert (config.velocity_scale_sd, config.velocity_misalignment_sd, config.heading_deviation_sd) == (0.1, 0.1, 0.05)
    # At the end of the first leg, 80 m on a straight line: a tenth of it ahead; 0.2 m/s/sqrt(Hz) over 53 s add 1.5 m.
    ping = int(np.searchsorted(without_doppler.trajectory_dr.distance, 80.0))
    assert reckoning.sigmas[ping, 0] == pytest.approx(np.hypot(8.0, 0.2 * np.sqrt(80.0 / 1.5)), rel=0.1)
    assert reckoning.sigmas[-1, 0] > 3 * usual.sigmas[-1, 0]


def test_a_doppler_log_or_no_word_on_the_speed_leaves_the_drift_as_it_is(mems, without_doppler):
    config = DeadReckoningConfig()
    assert suit_sensors(config, mems[0]) is config
    assert suit_sensors(config, replace(mems[0], sensors={})) is config
    both = without_doppler.sensors | {"dvl": mems[0].sensors["dvl"]}
    assert suit_sensors(config, replace(without_doppler, sensors=both)) is config


def test_a_drift_that_the_user_set_is_kept_key_by_key(without_doppler):
    config = suit_sensors(
        load_config(settings=["dead_reckoning.velocity_scale_sd=0.01"]).dead_reckoning, without_doppler
    )
    assert (config.velocity_scale_sd, config.velocity_misalignment_sd) == (0.01, 0.1)
    assert suit_sensors(config, without_doppler) == config


def test_the_drift_of_a_track_without_doppler_log_is_said_as_it_is(mems, without_doppler):
    config = suit_sensors(DeadReckoningConfig(velocity_scale_sd=0.04), without_doppler)
    recording, _ = dead_reckon(without_doppler, config)
    (note,) = recording.notes
    assert "No Doppler log: the drift is that of a compass and a speed through the water, 4% of the speed" in note
    assert "0.1 rad of crab, 0.05 rad of compass deviation" in note
    assert dead_reckon(mems[0], DeadReckoningConfig())[0].notes == ()
