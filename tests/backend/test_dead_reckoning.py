import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.stats import chi2

from backend.dead_reckoning import DeadReckoning, DeadReckoningConfig
from backend.poses import adjoint, invert, logarithm, tangent_covariance

PERFECT = {
    "heading_bias_sd": 0.0,
    "heading_walk": 1e-9,
    "heading_deviation_sd": 0.0,
    "velocity_scale_sd": 0.0,
    "velocity_misalignment_sd": 0.0,
    "velocity_noise": 1e-9,
    "depth_sd": 1e-6,
    "tilt_sd": 1e-9,
}
X, Y, Z, YAW = range(4)


def sensors(**errors):
    """Perfect sensors but for what is named."""
    return DeadReckoningConfig(**(PERFECT | errors))


def straight_run(poses, yaw=0.0, n=101, step=1.0):
    """Time and poses of a straight run at 2 m/s."""
    along = step * np.arange(n)
    positions = np.stack([along * np.cos(yaw), along * np.sin(yaw), np.zeros(n)], axis=1)
    return along / 2.0, poses(positions, np.full(n, yaw))


def circle(poses, n=361, radius=50.0, tilt=None):
    """Time and poses of one full circle, counter-clockwise, ending where it began."""
    angle = np.linspace(0.0, 2.0 * np.pi, n)
    positions = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, -10.0)], axis=1)
    return np.linspace(0.0, 200.0, n), poses(positions, angle + np.pi / 2.0, tilt)


def test_a_heading_bias_of_one_degree_shifts_the_end_of_a_hundred_metres_by_1_75_m_sideways(poses):
    reckoning = DeadReckoning(*straight_run(poses), sensors(heading_bias_sd=np.radians(1.0)))
    np.testing.assert_allclose(reckoning.sigmas[-1, [X, Y, YAW]], [0.0, 1.745, 0.01745], atol=1e-3)


def test_a_constant_heading_bias_is_gauge_and_leaves_relative_poses_alone(poses):
    reckoning = DeadReckoning(*straight_run(poses, yaw=0.7), sensors(heading_bias_sd=np.radians(5.0)))
    assert np.sqrt(np.diag(reckoning.relative_covariance(0, 100)))[2:5].max() < 1e-6


@pytest.mark.parametrize("name", ["velocity_scale_sd", "velocity_misalignment_sd"])
def test_a_relative_velocity_error_grows_with_distance_along_or_across(poses, name):
    reckoning = DeadReckoning(*straight_run(poses), sensors(**{name: 0.01}))
    along, across = np.sqrt(np.diag(reckoning.relative_covariance(0, 100)))[3:5]
    assert (along if name == "velocity_scale_sd" else across) == pytest.approx(1.0, rel=1e-6)
    assert (across if name == "velocity_scale_sd" else along) < 1e-6


@pytest.mark.parametrize("name", ["velocity_scale_sd", "velocity_misalignment_sd"])
def test_constant_velocity_errors_cancel_where_the_track_closes(poses, name):
    reckoning = DeadReckoning(*circle(poses), sensors(**{name: 0.01}))
    sigmas = np.sqrt(np.diag(reckoning.relative_covariance(0, 360)))[3:5]
    assert sigmas.max() < 1e-6  # while half way round they make 1 m each
    assert np.sqrt(np.diag(reckoning.relative_covariance(0, 180)))[3:5].max() > 0.9


def test_velocity_noise_grows_with_the_root_of_time(poses):
    reckoning = DeadReckoning(*straight_run(poses), sensors(velocity_noise=0.04))
    sigmas = np.sqrt(np.diag(reckoning.relative_covariance(0, 100)))[3:5]
    np.testing.assert_allclose(sigmas, 0.04 * np.sqrt(50.0), rtol=1e-6)


@pytest.mark.parametrize(("n", "step"), [(101, 1.0), (3, 50.0)])
def test_a_walking_heading_shifts_a_straight_run_by_its_integral_however_few_the_pings(poses, n, step):
    walk, duration, speed = 1e-3, 50.0, 2.0
    time, T = straight_run(poses, n=n, step=step)
    covariance = DeadReckoning(time, T, sensors(heading_walk=walk)).relative_covariance(0, n - 1)
    assert covariance[2, 2] == pytest.approx(walk**2 * duration)
    assert covariance[4, 4] == pytest.approx((speed * walk) ** 2 * duration**3 / 3.0, rel=1e-6)
    assert covariance[2, 4] == pytest.approx(speed * walk**2 * duration**2 / 2.0, rel=1e-6)


def test_a_deviating_heading_turns_opposite_legs_against_each_other(poses):
    out, back = straight_run(poses)[1], straight_run(poses, yaw=np.pi)[1]
    back[:, 0, 3] += 100.0
    reckoning = DeadReckoning(np.arange(202.0), np.concatenate([out, back]), sensors(heading_deviation_sd=0.01))
    assert np.sqrt(reckoning.relative_covariance(50, 150)[2, 2]) == pytest.approx(0.02, rel=1e-6)
    assert np.sqrt(reckoning.relative_covariance(10, 90)[2, 2]) < 1e-6


def test_tilt_of_the_first_body_swings_the_lever_arm_in_height(poses):
    reckoning = DeadReckoning(*straight_run(poses), sensors(tilt_sd=0.01))
    covariance = reckoning.relative_covariance(0, 100)
    assert np.sqrt(covariance[5, 5]) == pytest.approx(1.0, rel=1e-6)
    np.testing.assert_allclose(np.diag(covariance)[:2], 2 * 0.01**2, rtol=1e-6)


def test_two_measured_depths_differ_by_root_two_of_one(poses):
    reckoning = DeadReckoning(*straight_run(poses), sensors(depth_sd=0.1))
    assert np.sqrt(reckoning.relative_covariance(0, 1)[5, 5]) == pytest.approx(np.sqrt(2.0) * 0.1)


def test_a_ping_seen_from_itself_is_certain(poses):
    assert not DeadReckoning(*straight_run(poses)).relative_covariance(7, 7).any()


def test_axes_are_those_of_the_first_body(poses):
    time, T = straight_run(poses, yaw=np.pi / 2.0)  # north
    reckoning = DeadReckoning(time, T, sensors(velocity_scale_sd=0.01))
    np.testing.assert_allclose(np.diag(reckoning.relative_covariance(0, 100))[3:5], [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(reckoning.drift_variances([0], [100])[0, :2], [0.0, 1.0], atol=1e-9)


@settings(max_examples=25)
@given(st.integers(0, 360), st.integers(0, 360))
def test_the_inverse_relative_pose_has_the_covariance_that_the_adjoint_makes(poses, i, j):
    rng = np.random.default_rng(0)
    time, T = circle(poses, tilt=0.1 * rng.normal(size=(361, 2)))
    reckoning = DeadReckoning(time, T)
    T_ij = invert(T[i]) @ T[j]
    there = tangent_covariance(T_ij, reckoning.relative_covariance(i, j))
    back = tangent_covariance(invert(T_ij), reckoning.relative_covariance(j, i))
    Ad = adjoint(T_ij)
    np.testing.assert_allclose(back, Ad @ there @ Ad.T, rtol=1e-9, atol=1e-9)


@pytest.fixture(scope="module")
def runs(make_survey):
    """The same short survey, drifted 200 times."""
    return [make_survey(seed, n_legs=3, n_ties=1) for seed in range(200)]


def test_relative_covariances_are_honest_for_near_and_far_pings(runs):
    pairs = np.array([(5, 6), (0, 100), (300, 40), (250, 500), (60, 580)])
    truth = runs[0].T_world_body
    covariances = DeadReckoning(runs[0].time, truth, runs[0].dead_reckoning.config).relative_covariances(*pairs.T)
    T_true = invert(truth[pairs[:, 0]]) @ truth[pairs[:, 1]]
    tangent = tangent_covariance(T_true, covariances)
    nees = np.zeros(len(pairs))
    for run in runs:
        T = run.T_world_body_dr
        error = logarithm(invert(T_true) @ invert(T[pairs[:, 0]]) @ T[pairs[:, 1]])
        nees += np.einsum("ai,ai->a", error, np.linalg.solve(tangent, error[..., None])[..., 0])
    # two-sided 99.9 % bounds of a chi-square with 6 degrees of freedom a run
    lower, upper = chi2.ppf([0.0005, 0.9995], 6 * len(runs))
    assert ((nees > lower) & (nees < upper)).all(), nees / len(runs)


@pytest.mark.parametrize("ping", [1, 100, 580])
def test_absolute_covariances_are_honest(runs, ping):
    covariances = DeadReckoning(runs[0].time, runs[0].T_world_body, runs[0].dead_reckoning.config).covariances
    difference = np.array([run.T_world_body_dr[ping] - run.T_world_body[ping] for run in runs])
    turn = np.array([run.T_world_body[ping, :3, :3].T @ run.T_world_body_dr[ping, :3, :3] for run in runs])
    error = np.column_stack([difference[:, :3, 3], np.arctan2(turn[:, 1, 0], turn[:, 0, 0])])
    nees = np.einsum("ai,ij,aj->", error, np.linalg.inv(covariances[ping]), error)
    lower, upper = chi2.ppf([0.0005, 0.9995], 4 * len(runs))
    assert lower < nees < upper


def test_filtered_covariances_equal_the_closed_form(make_survey):
    survey = make_survey(0, n_legs=3, n_ties=1)
    config = DeadReckoningConfig(heading_bias_sd=0.02, heading_deviation_sd=0.0)
    reckoning = DeadReckoning(survey.time, survey.T_world_body_dr, config)
    ping = np.arange(reckoning.n_pings)
    arm = reckoning.positions - reckoning.positions[0]
    expected = reckoning.drift_variances(np.zeros_like(ping), ping)
    expected += 0.02**2 * np.stack([arm[:, 1] ** 2, arm[:, 0] ** 2, 0 * ping, 1.0 + 0 * ping], axis=1)
    expected[:, Z] = config.depth_sd**2
    np.testing.assert_allclose(reckoning.sigmas**2, expected, rtol=1e-9, atol=1e-12)


def test_odometry_leaves_depth_and_tilt_to_the_unary_factors(poses):
    reckoning = DeadReckoning(*straight_run(poses), DeadReckoningConfig(unary_slack=10.0))
    relative, odometry = (np.diag(f(3, 40)) for f in (reckoning.relative_covariance, reckoning.odometry_covariance))
    np.testing.assert_allclose(odometry[[0, 1, 5]] / relative[[0, 1, 5]], 100.0, rtol=1e-9)
    np.testing.assert_allclose(odometry[[2, 3, 4]], relative[[2, 3, 4]], rtol=1e-6)


def test_many_pairs_at_once_give_what_single_pairs_give(make_survey):
    reckoning = make_survey(3, n_legs=3, n_ties=1).dead_reckoning
    first, second = np.array([0, 500, 20]), np.array([580, 3, 21])
    together = reckoning.relative_covariances(first, second)
    alone = [reckoning.relative_covariance(i, j) for i, j in zip(first, second, strict=True)]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


def test_far_from_the_origin_the_covariance_is_the_same(make_survey):
    survey = make_survey(3, n_legs=3, n_ties=1)
    T = survey.T_world_body_dr.copy()
    T[:, :2, 3] += [4e5, -5e6]
    far = DeadReckoning(survey.time, T, survey.dead_reckoning.config).relative_covariance(20, 500)
    near = survey.dead_reckoning.relative_covariance(20, 500)
    np.testing.assert_allclose(far, near, rtol=1e-6, atol=1e-9)  # positions keep 1e-9 m of 5e6 m


def test_the_track_given_is_not_changed(make_survey):
    survey = make_survey(4, n_legs=3, n_ties=1)
    before = survey.T_world_body_dr.copy()
    reckoning = DeadReckoning(survey.time, survey.T_world_body_dr, survey.dead_reckoning.config)
    reckoning.relative_covariance(0, 9)
    assert np.array_equal(reckoning.sigmas.shape, (len(before), 4))
    assert np.array_equal(before, survey.T_world_body_dr)


@pytest.mark.parametrize(
    ("time", "n", "message"),
    [
        ([0.0, 1.0], 3, r"one time a pose is wanted, got \(2,\) times and 3 poses"),
        ([], 0, r"one time a pose is wanted, got \(0,\) times and 0 poses"),
        ([0.0, 1.0, 1.0], 3, "time must increase strictly from ping to ping"),
        ([0.0, np.nan, 1.0], 3, "time must increase strictly from ping to ping"),
    ],
)
def test_times_that_do_not_fit_are_refused(time, n, message):
    with pytest.raises(ValueError, match=message):
        DeadReckoning(time, np.tile(np.eye(4), (n, 1, 1)))


def test_pings_outside_the_track_are_refused(poses):
    with pytest.raises(ValueError, match=r"pings must lie in 0\.\.100, got 101\.\.101"):
        DeadReckoning(*straight_run(poses)).relative_covariance(0, 101)


def test_misspelt_settings_are_refused():
    with pytest.raises(ValidationError, match="heading_wlak"):
        DeadReckoningConfig(heading_wlak=1.0)
