from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from backend.dead_reckoning import DeadReckoning
from backend.poses import invert, logarithm, tangent_covariance
from backend.sensor_reckoning import Fix, reckon, surface_fixes
from tests.backend.sensor_scenes import START, Rates, attitude, grade, make_sensors, path, yaw_of

PINGS = np.arange(0.0, 120.01, 0.25)
PAIRS = np.array([(2, 5), (40, 300), (350, 90), (0, 480), (200, 208)])


def true_poses(time):
    T = np.tile(np.eye(4), (len(time), 1, 1))
    T[:, :3, 3], T[:, :3, :3] = path(time)[0], attitude(time).as_matrix()
    return T


def tilt_and_planar_error(T, T_true):
    error = T[:, :3, 3] - T_true[:, :3, 3]
    yaw = yaw_of(T_true[:, :3, :3].swapaxes(1, 2) @ T[:, :3, :3])
    return np.column_stack([error, yaw])


@pytest.fixture(scope="module")
def reckoned():
    """The eight by three grades of equipment, eight dives each."""
    return {
        name: [
            reckon(make_sensors(grade(name), np.random.default_rng(seed)), PINGS, START, grade(name))
            for seed in range(10)
        ]
        for name in ("navigation", "tactical", "mems")
    }


def test_sensors_without_errors_give_the_true_track():
    config = grade("navigation")
    T = reckon(make_sensors(config, None), PINGS, START, config).T_world_body
    error = T[:, :3, 3] - true_poses(PINGS)[:, :3, 3]
    # an inertial unit sampled at 20 Hz sees the eight's accelerations, 0.2 m/s2, to a thousandth: millimetres a leg
    assert np.abs(error).max() < 0.02
    turned = logarithm(invert(true_poses(PINGS)) @ T)[:, :3]
    assert np.abs(turned).max() < np.radians(0.02)


@pytest.mark.parametrize("name", ["navigation", "tactical", "mems"])
@pytest.mark.parametrize("ping", [60, 240, 480])
def test_absolute_covariances_are_honest(reckoned, name, ping):
    truth, runs = true_poses(PINGS[[ping]]), reckoned[name]
    nees = 0.0
    for run in runs:
        error = tilt_and_planar_error(run.T_world_body[[ping]], truth)[0]
        error[2] = 0.0  # depth has a file of its own: its sigma holds a bias that no draw has
        covariance = run.covariances[ping][np.ix_([0, 1, 3], [0, 1, 3])]
        nees += error[[0, 1, 3]] @ np.linalg.solve(covariance, error[[0, 1, 3]])
    lower, upper = chi2.ppf([0.0005, 0.9995], 3 * len(runs))  # two-sided 99.9 %: nine such tests
    assert lower < nees < upper, nees / len(runs)


@pytest.mark.parametrize("name", ["navigation", "tactical", "mems"])
def test_relative_covariances_are_honest_for_near_and_far_pings(reckoned, name):
    truth, runs = true_poses(PINGS), reckoned[name]
    T_true = invert(truth[PAIRS[:, 0]]) @ truth[PAIRS[:, 1]]
    nees = np.zeros(len(PAIRS))
    for run in runs:
        T = invert(run.T_world_body[PAIRS[:, 0]]) @ run.T_world_body[PAIRS[:, 1]]
        error = np.column_stack([yaw_of(T_true[:, :3, :3].swapaxes(1, 2) @ T[:, :3, :3]), (T - T_true)[:, :2, 3]])
        covariance = run.relative_covariances(*PAIRS.T)[:, 2:5, 2:5]
        nees += np.einsum("pa,pa->p", error, np.linalg.solve(covariance, error[:, :, None])[:, :, 0])
    lower, upper = chi2.ppf([0.0005, 0.9995], 3 * len(runs))
    assert (nees < upper).all(), nees / len(runs)
    # pings of one epoch: what tilt adds to the planar errors is counted for each by itself, on the safe side
    assert (nees[1:4] > lower).all(), nees / len(runs)


def test_the_filter_is_better_than_integrating_compass_and_log(reckoned):
    config, better = grade("mems"), []
    for seed, run in enumerate(reckoned["mems"]):
        sensors = make_sensors(config, np.random.default_rng(seed))
        compass, dvl = sensors["compass"], sensors["dvl"]
        c, s = np.cos(compass["yaw"]), np.sin(compass["yaw"])
        east, north = c * dvl["velocity_x"] - s * dvl["velocity_y"], s * dvl["velocity_x"] + c * dvl["velocity_y"]
        integrated = np.array(START) + 0.2 * np.cumsum(np.stack([east, north], axis=-1), axis=0)
        plain = np.hypot(*(integrated[:-1] - path(dvl["time"][1:])[0][:, :2]).T).max()
        error = run.T_world_body[:, :2, 3] - path(PINGS)[0][:, :2]
        better.append(np.hypot(*error.T).max() < plain)
    assert np.mean(better) >= 0.7


def test_a_constant_heading_bias_is_in_the_absolute_but_not_in_the_relative_covariance():
    config = grade("tactical").model_copy(update={"heading_deviation_sd": 0.0})
    biased = config.model_copy(update={"heading_bias_sd": np.radians(5.0)})
    one, other = (reckon(make_sensors(config, None), PINGS, START, c) for c in (config, biased))
    assert other.sigmas[240, 3] == pytest.approx(np.radians(5.0), rel=0.01)
    relative, relative_biased = (r.relative_covariance(100, 400) for r in (one, other))
    np.testing.assert_allclose(relative_biased, relative, rtol=0.02, atol=1e-8)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 480), st.integers(0, 480))
def test_two_pings_are_as_uncertain_seen_from_either(reckoned, i, j):
    run = reckoned["mems"][0]
    there, back = run.drift_variances([i, j], [j, i])
    covariance = run.relative_covariance(i, j)
    assert np.linalg.eigvalsh(covariance).min() >= -1e-12 * np.trace(covariance)
    assert there[3] == pytest.approx(back[3], rel=1e-9, abs=1e-15)  # the yaw; the arm between them is another


def test_many_pairs_at_once_give_what_single_pairs_give(reckoned):
    run = reckoned["tactical"][0]
    together = run.relative_covariances(*PAIRS.T)
    np.testing.assert_allclose(together, [run.relative_covariance(i, j) for i, j in PAIRS], rtol=1e-9, atol=1e-15)


def test_odometry_in_independent_steps_covers_the_drift_of_the_heading_over_the_dive(reckoned):
    run = reckoned["mems"][0]
    anchors = np.arange(0, 481, 40)
    T, whole = run.T_world_body, run.drift_variances([0], [480])[0, 3]
    turns = [T[i, :3, :3] @ run.odometry_covariance(i, j)[:3, :3] @ T[i, :3, :3].T for i, j in pairwise(anchors)]
    assert whole <= sum(turn[2, 2] for turn in turns) < 3.0 * whole


def test_fixes_hold_the_track_and_shrink_its_covariance():
    config, rng = grade("mems"), np.random.default_rng(3)
    sensors = make_sensors(config, rng, Rates(gnss=1.0))
    run = reckon(sensors, PINGS, (START[0] + 2.0, START[1] - 1.0), config)
    error = run.T_world_body[:, :2, 3] - path(PINGS)[0][:, :2]
    # 120 fixes of 1 m; the eight's size is known to the log's scale, 1 %
    assert np.hypot(*error.T).max() < 1.0
    assert run.sigmas[:, :2].max() < 0.6


def test_without_bottom_lock_the_inertial_unit_carries_on_and_the_covariance_says_how_well():
    config, nees = grade("tactical"), []
    for seed in range(4):
        sensors = make_sensors(config, np.random.default_rng(seed))
        lost = (sensors["dvl"]["time"] > 40.0) & (sensors["dvl"]["time"] < 60.0)
        sensors["dvl"] = {k: v if k == "time" else np.where(lost, np.nan, v) for k, v in sensors["dvl"].items()}
        run = reckon(sensors, PINGS, START, config)
        k = np.searchsorted(PINGS, 61.0)
        error = tilt_and_planar_error(run.T_world_body[[k]], true_poses(PINGS[[k]]))[0][[0, 1, 3]]
        nees.append(error @ np.linalg.solve(run.covariances[k][np.ix_([0, 1, 3], [0, 1, 3])], error))
        assert np.hypot(*error[:2]) < 2.0  # 20 s at a velocity kept to 2 cm/s, and what came before
    lower, upper = chi2.ppf([0.0005, 0.9995], 3 * 4)
    assert lower < sum(nees) < upper


def test_heading_speed_and_depth_alone_make_a_track_with_an_honest_covariance():
    config, nees = grade("mems"), []
    for seed in range(4):
        sensors = make_sensors(config, np.random.default_rng(seed), Rates(imu=0.0))
        run = reckon(sensors, PINGS, START, config)
        error = tilt_and_planar_error(run.T_world_body[[-1]], true_poses(PINGS[[-1]]))[0][[0, 1, 3]]
        nees.append(error @ np.linalg.solve(run.covariances[-1][np.ix_([0, 1, 3], [0, 1, 3])], error))
    lower, upper = chi2.ppf([0.0005, 0.9995], 3 * 4)
    assert sum(nees) < upper
    assert sum(nees) > 0.3 * lower  # the allowance for unmeasured turning is for steering harder than this


def test_a_speed_log_alone_drifts_with_the_current_and_says_so():
    config = grade("mems")
    sensors = make_sensors(config, np.random.default_rng(0))
    time = np.arange(0.0, 120.1, 1.0)
    through = attitude(time).inv().apply(path(time)[1] - [0.2, 0.1, 0.0])[:, 0]
    sensors["speed_log"] = {"time": time, "speed": through}
    del sensors["dvl"]
    run = reckon(sensors, PINGS, START, config)
    error = np.hypot(*(run.T_world_body[-1, :2, 3] - path(PINGS[-1:])[0][0, :2]))
    sigma = np.hypot(*run.sigmas[-1, :2])
    assert sigma > 0.3 * 0.22 * 120.0  # a current of 0.3 m/s is not known from speed through the water
    assert error < 3.0 * sigma


def test_the_turning_earth_is_taken_out_of_the_gyros():
    config, earth = grade("navigation"), np.array([0.0, 5.2e-5, 5.2e-5])
    sensors = make_sensors(config, None, Rates(earth=earth))
    right, wrong = (reckon(sensors, PINGS, START, config, e).T_world_body for e in (earth, np.zeros(3)))
    yaw_error = [np.ptp(yaw_of(true_poses(PINGS)[:, :3, :3].swapaxes(1, 2) @ T[:, :3, :3])) for T in (right, wrong)]
    assert yaw_error[0] < 0.2 * yaw_error[1]


def test_one_false_velocity_is_left_out():
    config = grade("tactical")
    sensors = make_sensors(config, np.random.default_rng(1))
    clean = reckon(sensors, PINGS, START, config).T_world_body
    spoilt = {k: v.copy() for k, v in sensors["dvl"].items()}
    spoilt["velocity_x"][300:303] = -8.0  # a fish
    T = reckon({**sensors, "dvl": spoilt}, PINGS, START, config).T_world_body
    assert np.abs(T[:, :2, 3] - clean[:, :2, 3]).max() < 0.05


def test_sensors_in_another_order_and_with_bad_rows_give_the_same_bytes():
    config = grade("tactical")
    sensors = make_sensors(config, np.random.default_rng(2))
    T = reckon(sensors, PINGS, START, config).T_world_body
    spoilt = dict(reversed(sensors.items()))
    depth = {k: np.insert(v, 50, np.nan) for k, v in sensors["depth"].items()}
    depth["time"][50] = depth["time"][49] + 0.01
    again = reckon({**spoilt, "depth": depth}, PINGS, START, config).T_world_body
    assert again.tobytes() == T.tobytes()


def test_pings_that_the_sensors_do_not_cover_are_refused():
    config = grade("tactical")
    sensors = make_sensors(config, None, Rates(duration=30.0))
    with pytest.raises(
        ValueError, match=r"sensors must cover the pings: they answer from 0\.000 to 30\.000 s, pings come"
    ):
        reckon(sensors, PINGS, START, config)


def test_a_finished_track_keeps_the_drift_model(reckoned):
    run = reckoned["mems"][0]
    plain = DeadReckoning(PINGS, run.T_world_body, run.config)
    assert plain.relative_covariance(0, 480)[3, 3] > run.relative_covariance(0, 480)[3, 3]


def test_fixes_are_told_by_ping_place_and_sigma():
    gnss = {"time": np.array([0.1, 50.0, 400.0]), "position_x": np.array([1.0, 2.0, 3.0]), "position_y": np.zeros(3)}
    assert surface_fixes({"gnss": gnss}, PINGS, 1.5) == [Fix(0, 1.0, 0.0, 1.5), Fix(200, 2.0, 0.0, 1.5)]
    assert surface_fixes({}, PINGS, 1.5) == []


def test_relative_covariances_fit_the_frames_of_a_graph(reckoned):
    run = reckoned["mems"][0]
    T = run.T_world_body
    there = tangent_covariance(invert(T[40]) @ T[300], run.relative_covariance(40, 300))
    assert np.linalg.eigvalsh(there).min() > 0
