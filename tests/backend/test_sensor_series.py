import numpy as np
import pytest

from backend.sensor_errors import SensorErrorsConfig
from backend.sensor_series import can_reckon, gather, gather_fixes
from tests.backend.sensor_scenes import Rates, grade, make_sensors

CONFIG = SensorErrorsConfig()


@pytest.fixture
def sensors():
    return make_sensors(grade("tactical"), None, Rates(duration=10.0))


def test_every_answer_falls_on_the_grid_and_every_epoch_ends_on_it(sensors):
    series = gather(sensors, CONFIG)
    assert (np.diff(series.time) > 0).all()
    for answers in series.answers.values():
        assert np.isin(answers.time, series.time).all()
    assert series.edges[0] == 0
    assert series.edges[-1] == len(series.time) - 1
    assert np.diff(series.time[series.edges]).max() <= CONFIG.epoch + 0.05 + 1e-9  # and the grid's step


def test_the_tilt_comes_from_whatever_tells_the_heading(sensors):
    sensors["directional_gyro"] = sensors.pop("compass")
    series = gather(sensors, CONFIG)
    assert "compass" not in series.answers  # a gyro's own integral says nothing new of the heading
    assert "tilt" in series.answers


def test_a_gap_of_the_inertial_unit_counts_as_unmeasured(sensors):
    kept = (sensors["imu"]["time"] < 3.0) | (sensors["imu"]["time"] > 5.0)
    sensors["imu"] = {k: v[kept] for k, v in sensors["imu"].items()}
    series = gather(sensors, CONFIG)
    inside = (series.time > 3.1) & (series.time < 4.9)
    assert (series.noise[inside, 0] == CONFIG.turn_noise).all()
    assert (series.noise[series.time < 2.9, 0] == CONFIG.gyro_noise).all()


def test_without_an_inertial_unit_rates_come_from_the_attitude(sensors):
    measured = gather(sensors, CONFIG)
    derived = gather({k: v for k, v in sensors.items() if k != "imu"}, CONFIG)
    assert not derived.has_imu
    at = np.linspace(1.0, 9.0, 50)
    rates = [np.interp(at, s.time, s.inertial[:, 2]) for s in (measured, derived)]
    # differences over 0.4 s of a heading that swings within 30 s
    np.testing.assert_allclose(rates[1], rates[0], atol=0.01)


def test_rows_that_are_not_finite_or_not_later_are_left_out(sensors):
    n = sensors["depth"]["time"].size
    sensors["depth"] = {k: v.copy() for k, v in sensors["depth"].items()}
    sensors["depth"]["depth"][3] = np.nan
    sensors["depth"]["time"][7] = sensors["depth"]["time"][6]
    sensors["depth"]["time"][9] = np.nan
    assert gather(sensors, CONFIG).answers["depth"].time.size == n - 3


def test_a_log_that_never_saw_the_bottom_counts_as_none(sensors):
    sensors["dvl"] = {k: v if k == "time" else np.full_like(v, np.nan) for k, v in sensors["dvl"].items()}
    assert not can_reckon(sensors)


@pytest.mark.parametrize("missing", ["compass", "dvl", "depth"])
def test_too_few_sensors_are_refused_by_name(sensors, missing):
    del sensors[missing]
    given = ", ".join(sorted(sensors))
    with pytest.raises(
        ValueError, match=f"wants compass or directional_gyro, dvl or speed_log.* and depth; got {given}"
    ):
        gather(sensors, CONFIG)


def test_no_sensors_are_refused():
    with pytest.raises(ValueError, match="got none"):
        gather({}, CONFIG)


def test_a_missing_column_is_named(sensors):
    del sensors["compass"]["roll"]
    with pytest.raises(ValueError, match="sensor compass has no roll: time, roll, pitch, yaw wanted"):
        gather(sensors, CONFIG)


def test_a_column_of_another_length_is_named(sensors):
    sensors["compass"]["yaw"] = sensors["compass"]["yaw"][1:]
    with pytest.raises(ValueError, match=r"sensor compass: yaw of shape \(50,\) given, one a time wanted: \(51,\)"):
        gather(sensors, CONFIG)


def test_answers_at_one_time_only_are_refused(sensors):
    one = {name: {k: v[:1] for k, v in series.items()} for name, series in sensors.items()}
    with pytest.raises(ValueError, match="wants answers over some time, got 1 times"):
        gather(one, CONFIG)


def test_the_series_given_are_not_changed(sensors):
    before = {n: {k: v.copy() for k, v in s.items()} for n, s in sensors.items()}
    gather(sensors, CONFIG)
    assert all(np.array_equal(before[n][k], v) for n, s in sensors.items() for k, v in s.items())


def test_no_fix_is_none():
    assert gather_fixes({"gnss": {"time": np.zeros(0), "position_x": np.zeros(0), "position_y": np.zeros(0)}}) is None
