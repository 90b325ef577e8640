"""Sensors and dead reckoning against the closed forms of their errors."""

from typing import Any

import numpy as np
import pytest

from frontend.frames import rotation_world_body
from frontend.georeference import Georeference
from frontend.heightfield import Heightfield
from frontend.trajectory import Trajectory
from sssslam.simulation.dead_reckoning import dead_reckon
from sssslam.simulation.directional_gyro import integrated_heading
from sssslam.simulation.drift import Drift, DriftConfig, draw_drift
from sssslam.simulation.sensors import Platform, SensorsConfig, Series, sense
from sssslam.simulation.survey import Legs
from sssslam.simulation.vehicle import Motion, VehicleConfig, make_motion

ORDINARY: dict[str, Any] = {"waves": {"roll_deg": 1.0, "pitch_deg": 1.0, "yaw_deg": 0.5, "heave": 0.1}}
CALM: dict[str, Any] = {"waves": {"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0, "heave": 0.0}}
NO_DRIFT = Drift(0.0, (0.0, 0.0), np.zeros(2), 0.0, 0.0, 0.0)
PERFECT = DriftConfig.model_validate({})
FLOOR = Heightfield(np.full((1301, 1301), -50.0), 1.0, (-650.0, -650.0))


def _motion(legs: Any = ((-500.0, 0.0, 500.0, 0.0),), **values: Any) -> Motion:
    config = VehicleConfig.model_validate({**CALM, **values})
    return make_motion(config, Legs(legs=legs).path(config.turn_radius), FLOOR, np.random.default_rng(0))


def _sensors(
    motion: Motion,
    drift: Drift = NO_DRIFT,
    errors: DriftConfig = PERFECT,
    place: Georeference | None = None,
    seed: int = 0,
    **rates: float,
) -> dict[str, Series]:
    platform = Platform(motion, FLOOR, drift, errors, place)
    return sense(platform, SensorsConfig.model_validate({"imu_rate": 0.0, **rates}), np.random.default_rng(seed))


def _reckoned(motion: Motion, sensors: dict[str, Series]) -> tuple[Trajectory, Trajectory]:
    """True and dead-reckoned track, one row a second."""
    time = np.arange(0.0, motion.duration)
    truth = motion.trajectory(time)
    return truth, dead_reckon(sensors, time, (float(truth.x[0]), float(truth.y[0])))


def _drift(**values: Any) -> Drift:
    return Drift(**{**NO_DRIFT.__dict__, **values})


def test_perfect_sensors_reckon_the_true_track() -> None:
    motion = _motion(((-100.0, 0.0, 100.0, 0.0), (100.0, 50.0, -100.0, 50.0)), **ORDINARY, current=(0.3, -0.2))
    truth, reckoned = _reckoned(motion, _sensors(motion))
    for name in ("x", "y", "z"):
        # Sampling at 4 to 10 Hz costs millimetres, and centimetres of heave.
        np.testing.assert_allclose(getattr(reckoned, name), getattr(truth, name), atol=0.03)
    for name in ("roll", "pitch", "yaw"):
        difference = getattr(reckoned, name) - getattr(truth, name)
        np.testing.assert_allclose(np.sin(difference), 0.0, atol=1e-3)


def test_a_heading_bias_turns_the_track_about_its_start() -> None:
    motion = _motion()
    truth, reckoned = _reckoned(motion, _sensors(motion, _drift(heading_bias=np.radians(1.0))))
    run = truth.distance[-1]
    # Cross-track error D sin e, along-track D (1 - cos e): 1.75 % of the distance for 1 degree.
    assert reckoned.y[-1] == pytest.approx(run * np.sin(np.radians(1.0)), rel=1e-3)
    assert truth.x[-1] - reckoned.x[-1] == pytest.approx(run * (1 - np.cos(np.radians(1.0))), rel=0.01)
    assert reckoned.yaw[-1] == pytest.approx(np.radians(1.0), abs=1e-9)


def test_a_scale_error_grows_along_the_track_with_distance() -> None:
    motion = _motion()
    truth, reckoned = _reckoned(motion, _sensors(motion, _drift(velocity_scale=0.01)))
    assert reckoned.x[-1] - truth.x[-1] == pytest.approx(0.01 * truth.distance[-1], rel=1e-3)
    assert reckoned.y[-1] == pytest.approx(0.0, abs=1e-3)


def test_a_misaligned_log_errs_across_the_track_but_not_in_heading() -> None:
    motion = _motion()
    truth, reckoned = _reckoned(motion, _sensors(motion, _drift(misalignment=np.radians(0.5))))
    assert reckoned.y[-1] == pytest.approx(truth.distance[-1] * np.sin(np.radians(0.5)), rel=1e-3)
    assert reckoned.yaw[-1] == pytest.approx(0.0, abs=1e-9)


def test_a_body_fixed_error_cancels_on_the_way_back() -> None:
    motion = _motion(((-200.0, 0.0, 200.0, 0.0), (200.0, 60.0, -200.0, 60.0)))
    truth, reckoned = _reckoned(motion, _sensors(motion, _drift(velocity_scale=0.02)))
    halfway = np.argmax(truth.x)
    assert abs(reckoned.x[-1] - truth.x[-1]) < 0.3
    assert reckoned.x[halfway] - truth.x[halfway] == pytest.approx(0.02 * (truth.x[halfway] + 200.0), rel=0.01)


def test_a_heading_deviation_errs_between_opposite_legs() -> None:
    drift = _drift(heading_deviation=(np.radians(1.0), 0.0))
    yaw = np.array([0.0, np.pi / 2, np.pi])
    np.testing.assert_allclose(drift.heading_error(np.zeros(3), yaw), np.radians([1.0, 0.0, -1.0]), atol=1e-12)


def test_white_velocity_noise_walks_with_the_root_of_time() -> None:
    motion = _motion(((-60.0, 0.0, 60.0, 0.0),))
    errors = DriftConfig.model_validate({"velocity_noise": 0.05})
    ends = []
    for seed in range(60):
        truth, reckoned = _reckoned(motion, _sensors(motion, errors=errors, seed=seed))
        ends.append([reckoned.x[-1] - truth.x[-1], reckoned.y[-1] - truth.y[-1]])
    # s sqrt(T / f) with s^2 / f the density squared; 120 draws know a standard deviation to 6.5 %.
    assert np.std(ends) == pytest.approx(0.05 * np.sqrt(motion.duration), rel=0.2)


def test_the_heading_walks_with_the_root_of_time() -> None:
    config = DriftConfig.model_validate({"heading_walk_deg": 6.0})
    ends = [draw_drift(config, 3600.0, np.random.default_rng(seed)).heading_walk[3600] for seed in range(400)]
    # 400 draws: 3.5 %.
    assert np.degrees(np.std(ends)) == pytest.approx(6.0, rel=0.12)


def test_a_drift_is_drawn_with_the_deviations_of_its_grade() -> None:
    config = DriftConfig.model_validate({"grade": "mems"})
    drifts = [draw_drift(config, 1.0, np.random.default_rng(seed)) for seed in range(600)]
    drawn = {
        "heading_bias": np.radians(config.heading_bias_deg),
        "velocity_scale": config.velocity_scale,
        "misalignment": np.radians(config.misalignment_deg),
        "depth_bias": config.depth_bias,
    }
    for name, deviation in drawn.items():
        assert np.std([getattr(drift, name) for drift in drifts]) == pytest.approx(deviation, rel=0.12)


def test_grades_order_as_their_prices() -> None:
    grades = [DriftConfig.model_validate({"grade": grade}) for grade in ("none", "navigation", "tactical", "mems")]
    for name in DriftConfig.model_fields:
        if name != "grade":
            values = [getattr(grade, name) for grade in grades]
            assert values == sorted(values), name


def test_an_unknown_grade_is_refused_by_name() -> None:
    with pytest.raises(
        ValueError, match="grade 'gold' given, one of none, navigation, tactical, mems, mems-no-dvl wanted"
    ):
        DriftConfig.model_validate({"grade": "gold"})


def test_a_dvl_that_loses_the_bottom_has_no_velocity_and_reckoning_keeps_the_last() -> None:
    motion = _motion()
    sensors = _sensors(motion, dropouts=40.0, dropout_length=10.0)
    lost = np.isnan(sensors["dvl"]["velocity_x"])
    assert 0 < lost.sum() < lost.size / 2
    assert np.array_equal(lost, np.isnan(sensors["dvl"]["range_1"]))
    truth, reckoned = _reckoned(motion, sensors)
    # Even speed on a straight run: nothing is lost with the bottom.
    np.testing.assert_allclose(reckoned.x, truth.x, atol=0.02)


def test_a_dvl_out_of_range_of_the_floor_is_refused() -> None:
    motion = _motion(altitude=30.0)
    with pytest.raises(ValueError, match="the DVL never sees the bottom"):
        _reckoned(motion, _sensors(motion, dvl_range_max=20.0))


def test_without_a_dvl_the_current_goes_unseen() -> None:
    motion = _motion(current=(0.0, 0.3))
    sensors = _sensors(motion, dvl_rate=0.0)
    assert "dvl" not in sensors
    truth, reckoned = _reckoned(motion, sensors)
    # Through the water the vehicle goes south of east; over ground it does not.
    assert reckoned.y[-1] == pytest.approx(-0.3 * truth.time[-1], rel=0.01)


def test_the_dvl_measures_the_slanted_ranges_of_a_flat_floor() -> None:
    motion = _motion(altitude=12.0)
    ranges = np.stack([_sensors(motion)["dvl"][f"range_{k}"] for k in (1, 2, 3, 4)])
    np.testing.assert_allclose(ranges, 12.0 / np.cos(np.radians(30.0)), atol=1e-6)


def test_the_altimeter_reads_the_altitude_over_a_flat_floor() -> None:
    motion = _motion(altitude=12.0)
    assert np.allclose(_sensors(motion)["altimeter"]["altitude"], 12.0)
    errors = DriftConfig.model_validate({"altimeter_noise": 0.1})
    noisy = _sensors(motion, errors=errors)["altimeter"]["altitude"]
    # The mean of four ranges, 30 degrees off the vertical.
    assert noisy.std() == pytest.approx(0.1 * np.cos(np.radians(30.0)) / 2, rel=0.08)


def test_the_depth_sensor_is_biased_and_noisy() -> None:
    motion = _motion()
    errors = DriftConfig.model_validate({"depth_noise": 0.05})
    depth = _sensors(motion, _drift(depth_bias=0.2), errors)["depth"]["depth"]
    assert depth.mean() == pytest.approx(38.2, abs=0.01)
    assert depth.std() == pytest.approx(0.05, rel=0.08)


def test_an_inertial_sensor_at_rest_feels_gravity_and_the_turning_earth() -> None:
    motion = _motion(trim_deg=10.0)
    imu = _sensors(motion, place=Georeference(30.0, 0.0), imu_rate=10.0)["imu"]
    middle = slice(200, -200)
    force = [imu[f"specific_force_{axis}"][middle].mean() for axis in "xyz"]
    # Nose down by 10 degrees: gravity's reaction, up, leans towards the tail.
    assert force == pytest.approx([-9.80665 * np.sin(np.radians(10)), 0.0, 9.80665 * np.cos(np.radians(10))], abs=1e-3)
    rate = np.array([imu[f"angular_rate_{axis}"][middle].mean() for axis in "xyz"])
    body = rotation_world_body(0.0, np.radians(10.0), 0.0).T
    earth = 7.292115e-5 * np.array([0.0, np.cos(np.radians(30)), np.sin(np.radians(30))])
    np.testing.assert_allclose(rate, body @ earth, atol=1e-8)


def test_gyro_noise_is_the_angle_random_walk_asked_for() -> None:
    motion = _motion()
    imu = _sensors(motion, errors=DriftConfig.model_validate({"gyro_noise_deg": 0.5}), imu_rate=20.0)["imu"]
    # deg / sqrt(h) is a density of 1/60 deg/s/sqrt(Hz); white at 20 Hz.
    expected = np.radians(0.5 / 60) * np.sqrt(20.0)
    assert imu["angular_rate_x"].std() == pytest.approx(expected, rel=0.05)


def test_turning_shows_on_the_upright_gyro() -> None:
    motion = _motion(((-60.0, 0.0, 60.0, 0.0), (60.0, 80.0, -60.0, 80.0)), bank=0.0)
    imu = _sensors(motion, imu_rate=20.0)["imu"]
    assert np.trapezoid(imu["angular_rate_z"], imu["time"]) == pytest.approx(np.pi, abs=0.02)


def test_a_gyro_of_ten_degrees_an_hour_errs_by_471_metres_in_an_hour() -> None:
    time = np.arange(0.0, 3600.5, 0.5)
    still, even = np.zeros(time.size), np.ones(time.size)
    bias = np.radians(10.0 / 3600)
    imu = {"time": time, "angular_rate_x": still, "angular_rate_y": still, "angular_rate_z": bias * even}
    yaw = integrated_heading(imu, np.zeros((time.size, 2)), 0.0, 0.0)
    sensors = {
        "directional_gyro": {"time": time, "roll": still, "pitch": still, "yaw": yaw},
        "depth": {"time": time, "depth": still},
        "speed_log": {"time": time[1:], "speed": 1.5 * even[1:]},
    }
    reckoned = dead_reckon(sensors, time, (0.0, 0.0))
    # An arc of radius v / g: y = v / g (1 - cos g T); v g T^2 / 2 = 471 m is its first term, 0.25 % more.
    assert reckoned.y[-1] == pytest.approx(1.5 / bias * (1 - np.cos(bias * 3600.0)), rel=1e-6)
    assert reckoned.y[-1] == pytest.approx(471.0, rel=3e-3)


def test_without_a_compass_a_gyro_bias_errs_with_the_square_of_time() -> None:
    motion = _motion()
    errors = DriftConfig.model_validate({"gyro_bias_deg": 10.0})
    sensors = _sensors(motion, errors=errors, imu_rate=20.0, compass_rate=0.0)
    assert "compass" not in sensors
    truth, reckoned = _reckoned(motion, sensors)
    bias = sensors["imu"]["angular_rate_z"].mean()
    assert abs(bias) > np.radians(1.0 / 3600)
    for k in (truth.time.size // 2, -1):
        # v g T^2 / 2; the cubic term is (g T)^2 / 12, below a ten-thousandth.
        assert reckoned.y[k] == pytest.approx(0.5 * 2.0 * bias * truth.time[k] ** 2, rel=2e-3)


def test_with_a_compass_a_gyro_bias_costs_nothing() -> None:
    motion = _motion()
    errors = DriftConfig.model_validate({"gyro_bias_deg": 10.0})
    _, reckoned = _reckoned(motion, _sensors(motion, errors=errors, imu_rate=20.0))
    assert reckoned.y[-1] == pytest.approx(0.0, abs=1e-3)


def test_a_gyro_aligned_wrongly_turns_the_track_about_its_start() -> None:
    motion = _motion()
    drift = _drift(heading_bias=np.radians(1.0))
    truth, reckoned = _reckoned(motion, _sensors(motion, drift, imu_rate=20.0, compass_rate=0.0))
    # As with a compass: D sin e across the track, D (1 - cos e) along it, and the bias stays what it was.
    assert reckoned.y[-1] == pytest.approx(truth.distance[-1] * np.sin(np.radians(1.0)), rel=1e-3)
    assert truth.x[-1] - reckoned.x[-1] == pytest.approx(truth.distance[-1] * (1 - np.cos(np.radians(1.0))), rel=0.01)
    assert reckoned.yaw[-1] == pytest.approx(np.radians(1.0), abs=1e-6)


def test_a_perfect_gyro_reckons_the_true_track_through_waves_and_turns() -> None:
    motion = _motion(((-100.0, 0.0, 100.0, 0.0), (100.0, 50.0, -100.0, 50.0)), **ORDINARY, trim_deg=5.0)
    truth, reckoned = _reckoned(motion, _sensors(motion, imu_rate=20.0, compass_rate=0.0))
    # The trapezoid over 1/20 s costs 1e-4 rad in a turn: centimetres over 200 m.
    np.testing.assert_allclose(np.sin(reckoned.yaw - truth.yaw), 0.0, atol=5e-4)
    np.testing.assert_allclose(reckoned.x, truth.x, atol=0.1)
    np.testing.assert_allclose(reckoned.y, truth.y, atol=0.1)


def test_the_turning_earth_turns_no_level_gyro() -> None:
    motion = _motion()
    sensors = _sensors(motion, place=Georeference(48.0, -4.5), imu_rate=20.0, compass_rate=0.0)
    _, reckoned = _reckoned(motion, sensors)
    # Left in, 11 deg/h would cost 13 m.
    assert reckoned.y[-1] == pytest.approx(0.0, abs=0.01)


def test_white_gyro_noise_walks_the_heading_with_the_root_of_time() -> None:
    time, density = np.arange(0.0, 100.05, 0.05), np.radians(0.5 / 60)
    still, rng = np.zeros(time.size), np.random.default_rng(0)
    ends = []
    for _ in range(400):
        rate = density * np.sqrt(20.0) * rng.standard_normal(time.size)
        imu = {"time": time, "angular_rate_x": still, "angular_rate_y": still, "angular_rate_z": rate}
        ends.append(integrated_heading(imu, np.zeros((time.size, 2)), 0.0, 0.0)[-1])
    # 400 draws: 3.5 %.
    assert np.std(ends) == pytest.approx(density * np.sqrt(100.0), rel=0.12)


def test_biases_of_gyros_and_accelerometers_are_drawn_with_their_deviations() -> None:
    motion = _motion(((-10.0, 0.0, 10.0, 0.0),))
    perfect = _sensors(motion, imu_rate=2.0)["imu"]
    errors = DriftConfig.model_validate({"gyro_bias_deg": 10.0, "accelerometer_bias": 0.05})
    drawn = [_sensors(motion, errors=errors, seed=seed, imu_rate=2.0)["imu"] for seed in range(60)]
    for name, deviation in (("angular_rate", np.radians(10.0 / 3600)), ("specific_force", 0.05)):
        biases = [(imu[f"{name}_{k}"] - perfect[f"{name}_{k}"]).mean() for imu in drawn for k in "xyz"]
        # 180 draws: 5.3 %.
        assert np.std(biases) == pytest.approx(deviation, rel=0.18)


def test_a_vehicle_that_nothing_tells_its_heading_is_refused() -> None:
    with pytest.raises(ValueError, match="a compass_rate and an imu_rate of 0 given, one of them wanted"):
        SensorsConfig.model_validate({"compass_rate": 0.0, "imu_rate": 0.0})


def test_fixes_come_at_the_surface_only() -> None:
    assert "gnss" not in _sensors(_motion())
    afloat = _motion(keeping="depth", depth=0.2)
    gnss = _sensors(afloat, place=Georeference(47.0, 8.0))["gnss"]
    truth = afloat.trajectory(gnss["time"])
    assert np.std(gnss["position_x"] - truth.x) == pytest.approx(1.0, rel=0.1)
    x, y = Georeference(47.0, 8.0).to_local(gnss["latitude"], gnss["longitude"])
    np.testing.assert_allclose(np.stack([x, y]), np.stack([gnss["position_x"], gnss["position_y"]]), atol=1e-3)


def test_every_sensor_ticks_on_its_own_clock_over_the_whole_dive() -> None:
    motion = _motion()
    sensors = _sensors(motion, imu_rate=20.0)
    for name, rate in {"imu": 20.0, "compass": 10.0, "dvl": 5.0, "depth": 4.0, "altimeter": 5.0}.items():
        time = sensors[name]["time"]
        np.testing.assert_allclose(np.diff(time), 1 / rate)
        assert time[0] < 1 / rate
        assert time[-1] >= motion.duration
    assert not np.isin(sensors["dvl"]["time"], sensors["compass"]["time"]).all()
