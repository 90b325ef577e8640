from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from backend.correction import spread_correction, spread_sigmas
from backend.dead_reckoning import DeadReckoning, DeadReckoningConfig
from backend.sensor_reckoning import reckon
from tests.backend.sensor_scenes import START, grade, make_sensors


def turned(T, yaw, shift):
    """Poses turned about the world's vertical and shifted."""
    G = np.eye(4)
    G[:3, :3], G[:3, 3] = Rotation.from_rotvec([0.0, 0.0, yaw]).as_matrix(), shift
    return G @ T


def yaw_of(T):
    return np.arctan2(T[:, 1, 0], T[:, 0, 0])


@pytest.fixture(scope="module")
def track(make_survey):
    survey = make_survey(0, n_legs=3, n_ties=1)
    return survey.time, survey.T_world_body_dr


@pytest.fixture(scope="module")
def straight(poses):
    """A run to the east at 1 m/s, a ping every 0.1 s."""
    time = np.arange(0.0, 100.0, 0.1)
    return time, poses(np.pad(time[:, None], ((0, 0), (0, 2))), np.zeros(len(time)))


def test_anchors_that_stay_leave_every_ping_bit_for_bit(track):
    time, T = track
    T = T.copy()
    T[3, 2, 3] = -0.0
    pings = np.arange(10, len(time), 40)
    assert spread_correction(time, T, pings, T[pings]).tobytes() == T.tobytes()


def test_pings_between_two_anchors_that_stay_are_left_bit_for_bit_though_a_third_moves(track):
    time, T = track
    pings, anchors = np.array([10, 50, 90, 130]), T[[10, 50, 90, 130]].copy()
    anchors[3, :3, 3] += 1.0
    corrected = spread_correction(time, T, pings, anchors)
    assert corrected[:91].tobytes() == T[:91].tobytes()
    assert not np.array_equal(corrected[91:], T[91:])


@settings(max_examples=25)
@given(st.floats(-3.0, 3.0), st.tuples(*[st.floats(-100.0, 100.0)] * 3))
def test_one_motion_of_all_anchors_moves_every_ping_by_it(track, yaw, shift):
    time, T = track
    pings = np.arange(10, len(time), 40)
    corrected = spread_correction(time, T, pings, turned(T[pings], yaw, shift))
    np.testing.assert_allclose(corrected, turned(T, yaw, shift), rtol=0, atol=1e-9)


def test_anchors_are_met_exactly(track):
    time, T = track
    pings, rng = np.arange(10, len(time), 40), np.random.default_rng(0)
    anchors = T[pings].copy()
    anchors[:, :3, :3] = Rotation.from_rotvec(0.05 * rng.normal(size=(len(pings), 3))).as_matrix() @ anchors[:, :3, :3]
    anchors[:, :3, 3] += rng.normal(size=(len(pings), 3))
    assert np.array_equal(spread_correction(time, T, pings, anchors)[pings], anchors)


def test_before_the_first_and_after_the_last_anchor_the_track_goes_on_rigidly(straight):
    time, T = straight
    anchors = np.stack([turned(T[300], 0.0, [0.0, 1.0, 0.0]), T[700]])
    anchors[1, :2, :2] = [[0.0, -1.0], [1.0, 0.0]]  # a quarter turn to port
    corrected = spread_correction(time, T, [300, 700], anchors)
    np.testing.assert_allclose(corrected[:300, :3, 3], T[:300, :3, 3] + [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(corrected[701:, 0, 3], T[700, 0, 3], atol=1e-12)
    np.testing.assert_allclose(corrected[701:, 1, 3], T[701:, 0, 3] - T[700, 0, 3], atol=1e-12)


def test_position_velocity_and_acceleration_are_continuous_at_an_anchor(straight):
    time, T = straight
    pings, anchors = np.array([200, 500, 800]), T[[200, 500, 800]]
    anchors = np.stack(
        [anchors[0], turned(anchors[1], 0.02, [0.0, -8.0, 0.0]), turned(anchors[2], -0.03, [0.0, 26.0, 0.0])]
    )
    x = spread_correction(time, T, pings, anchors)[:, :3, 3]
    velocity, acceleration = np.diff(x, axis=0) / 0.1, np.diff(x, n=2, axis=0) / 0.01
    # the third derivative of a quintic step of 30 m over 30 s is below 60 * 30 / 30**3 = 0.07 m/s**3
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.1 * 0.1
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.2 * 0.1
    assert np.abs(acceleration[498]).max() < 0.01


def test_half_way_in_time_both_anchors_count_alike(straight):
    time, T = straight
    anchors = np.stack([T[200], turned(T[600], 0.0, [0.0, 2.0, 0.0])])
    corrected = spread_correction(time, T, [200, 600], anchors)
    np.testing.assert_allclose(corrected[400, :3, 3] - T[400, :3, 3], [0.0, 1.0, 0.0], atol=1e-12)


def test_depth_roll_and_pitch_stay_as_measured_where_anchors_only_turn_and_shift(track):
    time, T = track
    pings, rng = np.arange(10, len(time), 40), np.random.default_rng(1)
    anchors = np.stack([turned(T[ping], *[0.1 * rng.normal(), [*rng.normal(size=2), 0.0]]) for ping in pings])
    anchors[:, :2, 3] = T[pings, :2, 3] + rng.normal(size=(len(pings), 2))
    corrected = spread_correction(time, T, pings, anchors)
    np.testing.assert_allclose(corrected[:, 2, 3], T[:, 2, 3], atol=1e-12)
    np.testing.assert_allclose(corrected[:, 2, :3], T[:, 2, :3], atol=1e-12)  # the vertical as the body sees it


def test_yaw_goes_the_short_way_across_the_half_turn(straight):
    time, T = straight
    west = turned(T, np.pi - 0.01, [0.0, 0.0, 0.0])
    anchors = np.stack([west[200], turned(west[600], 0.02, [0.0, 0.0, 0.0])])
    change = yaw_of(np.swapaxes(west, 1, 2)[:, :3, :3] @ spread_correction(time, west, [200, 600], anchors)[:, :3, :3])
    assert change.min() > -1e-9
    assert change.max() < 0.02 + 1e-9


def test_one_anchor_moves_the_whole_track(straight):
    time, T = straight
    corrected = spread_correction(time, T, [500], turned(T[500], 0.1, [1.0, 2.0, 3.0])[None])
    np.testing.assert_allclose(corrected, turned(T, 0.1, [1.0, 2.0, 3.0]), atol=1e-9)


SHIFTS = st.lists(st.tuples(*[st.floats(-20.0, 20.0)] * 3), min_size=4, max_size=4)
TURNS = st.lists(st.floats(-0.2, 0.2), min_size=4, max_size=4)
FOUR = np.array([150, 400, 450, 900])


def moved_anchors(T, shifts, yaws):
    """Four anchors of a track, each shifted, and turned where it is."""
    anchors = T[FOUR].copy()
    turns = Rotation.from_rotvec(np.multiply.outer(yaws, [0.0, 0.0, 1.0])).as_matrix()
    anchors[:, :3, :3] = turns @ anchors[:, :3, :3]
    anchors[:, :3, 3] += shifts
    return anchors


@settings(max_examples=25, deadline=None)
@given(SHIFTS, TURNS, st.floats(-3.0, 3.0), st.tuples(*[st.floats(-1e3, 1e3)] * 3))
def test_where_the_world_lies_does_not_matter(straight, shifts, yaws, yaw, shift):
    time, T = straight
    anchors = moved_anchors(T, shifts, yaws)
    here = spread_correction(time, T, FOUR, anchors)
    there = spread_correction(time, turned(T, yaw, shift), FOUR, turned(anchors, yaw, shift))
    np.testing.assert_allclose(there, turned(here, yaw, shift), atol=1e-8)


@settings(max_examples=25, deadline=None)
@given(SHIFTS)
def test_no_ping_is_shifted_farther_than_the_anchors_around_it(straight, shifts):
    time, T = straight
    moved = spread_correction(time, T, FOUR, moved_anchors(T, shifts, np.zeros(4)))[:, :3, 3] - T[:, :3, 3]
    shifts = np.array(shifts)
    after = np.searchsorted(FOUR, np.arange(len(time)))
    left, right = shifts[np.clip(after - 1, 0, 3)], shifts[np.clip(after, 0, 3)]
    assert (moved >= np.minimum(left, right) - 1e-9).all()
    assert (moved <= np.maximum(left, right) + 1e-9).all()


@settings(max_examples=25, deadline=None)
@given(SHIFTS, TURNS)
def test_the_correction_never_jerks_position_or_heading(straight, shifts, yaws):
    time, T = straight
    corrected = spread_correction(time, T, FOUR, moved_anchors(T, shifts, yaws))
    moved = corrected[:, :3, 3] - T[:, :3, 3]
    turn = np.unwrap(yaw_of(corrected))
    # pieces at most apart by both shifts and by the arms that both turns swing; the quintic's steepest is 15/8 of its
    # mean, over 5 s at least; a turned piece swings its arm as the vehicle goes on at 1 m/s
    apart = np.linalg.norm(shifts, axis=1).max() * 2.0 + 2.0 * 0.2 * 50.0
    assert np.linalg.norm(np.diff(moved, axis=0), axis=1).max() <= 0.1 * (15.0 / 8.0 * apart / 5.0 + 0.2)
    assert np.abs(np.diff(turn)).max() <= 0.1 * 15.0 / 8.0 * 0.4 / 5.0


@settings(max_examples=10, deadline=None)
@given(SHIFTS, TURNS, st.sets(st.integers(0, 999), max_size=300))
def test_pings_left_out_change_nothing_for_the_others(straight, shifts, yaws, left_out):
    time, T = straight
    anchors, kept = moved_anchors(T, shifts, yaws), np.setdiff1d(np.arange(1000), sorted(left_out - set(FOUR.tolist())))
    few = spread_correction(time[kept], T[kept], np.searchsorted(kept, FOUR), anchors)
    np.testing.assert_allclose(few, spread_correction(time, T, FOUR, anchors)[kept], atol=1e-9)


def test_a_track_from_sensors_gets_its_sigmas_from_the_filter():
    config = grade("mems")
    reckoning = reckon(make_sensors(config, np.random.default_rng(0)), np.arange(0.0, 120.0, 0.5), START, config)
    anchors = np.tile([0.05, 0.05, 0.02, 0.002], (3, 1))
    sigmas = spread_sigmas(reckoning, [20, 120, 220], anchors)
    assert np.isfinite(sigmas).all()
    assert (sigmas > 0).all()
    assert sigmas[70, 0] > sigmas[20, 0]  # half way between two anchors, 50 s on
    # never more than the filter's own relative drift beside the anchor's own, its arm and what no closure sees
    drift = reckoning.drift_variances(np.full(100, 20), np.arange(20, 120))
    arm = (reckoning.positions[20:120] - reckoning.positions[20])[:, 1::-1] ** 2 * 0.002**2
    most = drift[:, :2] + 0.05**2 + arm + reckoning.unseen_variances(20)[20:120, :2]
    assert (sigmas[20:120, :2] ** 2 <= most + 1e-9).all()


@pytest.mark.parametrize(
    ("pings", "n_anchors", "message"),
    [
        ([1, 2], 3, r"one ping an anchor is wanted, got pings of shape \(2,\) for 3 anchors"),
        ([], 0, r"one ping an anchor is wanted, got pings of shape \(0,\) for 0 anchors"),
        ([5, 5], 2, r"anchor pings must increase strictly within 0\.\.999, got 5\.\.5"),
        ([5, 1000], 2, r"anchor pings must increase strictly within 0\.\.999, got 5\.\.1000"),
        ([-1, 5], 2, r"anchor pings must increase strictly within 0\.\.999, got -1\.\.5"),
    ],
)
def test_anchors_that_are_no_pings_of_the_track_are_refused(straight, pings, n_anchors, message):
    time, T = straight
    with pytest.raises(ValueError, match=message):
        spread_correction(time, T, pings, T[:n_anchors])


def test_times_that_do_not_fit_the_poses_are_refused(straight):
    time, T = straight
    with pytest.raises(ValueError, match=r"one time a pose is wanted, got \(999,\) times and 1000 poses"):
        spread_correction(time[1:], T, [5], T[:1])


def test_sigmas_of_the_anchors_are_met_and_dead_reckoning_grows_beyond_them(straight):
    reckoning = DeadReckoning(*straight, DeadReckoningConfig(velocity_scale_sd=0.0, velocity_misalignment_sd=0.0))
    anchors = np.array([[0.1, 0.2, 0.05, 0.01], [0.3, 0.2, 0.05, 0.02]])
    sigmas = spread_sigmas(reckoning, [300, 700], anchors)
    np.testing.assert_allclose(sigmas[[300, 700]], anchors, rtol=1e-12)
    assert (np.diff(sigmas[:300, :2], axis=0) < 0).all()
    assert (np.diff(sigmas[701:, :2], axis=0) > 0).all()
    drift = reckoning.drift_variances([700], [999])[0]
    lever = np.array([0.0, 29.9 * 0.02, 0.0, 0.0])
    np.testing.assert_allclose(sigmas[999], np.sqrt(anchors[1] ** 2 + lever**2 + drift), rtol=1e-9)


def test_sigmas_of_pure_dead_reckoning_are_its_own(straight):
    config = DeadReckoningConfig(
        heading_bias_sd=0.0, heading_walk=1e-12, heading_deviation_sd=0.0, velocity_scale_sd=0.0
    )
    reckoning = DeadReckoning(*straight, config.model_copy(update={"velocity_misalignment_sd": 0.0}))
    pings = np.array([0, 400, 900])
    np.testing.assert_allclose(spread_sigmas(reckoning, pings, reckoning.sigmas[pings]), reckoning.sigmas, rtol=1e-6)


class Stretched(DeadReckoning):
    """A track whose scale no graph solves for, as that of the inertial filter."""

    def unseen_variances(self, origin):
        return np.pad(0.01**2 * (self.positions[:, :2] - self.positions[origin, :2]) ** 2, ((0, 0), (0, 2)))


def test_what_no_closure_sees_grows_with_the_distance_from_the_first_anchor(straight):
    known = {"heading_walk": 1e-12, "heading_deviation_sd": 0.0, "velocity_noise": 1e-9}
    config = DeadReckoningConfig(velocity_scale_sd=0.0, velocity_misalignment_sd=0.0, **known)
    sigmas = spread_sigmas(Stretched(*straight, config), [100, 600], np.full((2, 4), 1e-6))
    np.testing.assert_allclose(sigmas[600, 0], 0.5, rtol=1e-6)  # 50 m to the east
    assert sigmas[100, :2].max() < 1e-5


def test_constant_errors_are_left_to_the_graph(straight):
    reckoning = DeadReckoning(*straight, DeadReckoningConfig(velocity_scale_sd=0.01))
    assert (reckoning.unseen_variances(100) == 0.0).all()
    with pytest.raises(ValueError, match=r"pings must lie in 0\.\.999, got 1000\.\.1000"):
        reckoning.unseen_variances(1000)


def test_the_corrected_track_is_as_uncertain_as_its_errors_are_large(make_survey):
    nees = []
    for seed in range(10):
        survey, rng = first_anchor_known(make_survey(seed)), np.random.default_rng(seed)
        graph = survey.graph(survey.true_closures(rng), first_pose=[0.005, 0.005, 1e-4, 1e-3, 1e-3, 0.1])
        graph.add_constant_errors(survey.dead_reckoning.constant_errors(survey.anchor_pings))
        solution = graph.solve()
        T = spread_correction(survey.time, survey.T_world_body_dr, survey.anchor_pings, solution.T_world_anchor)
        sigmas = spread_sigmas(survey.dead_reckoning, survey.anchor_pings, solution.sigmas)
        error = T[:, :2, 3] - survey.T_world_body[:, :2, 3]
        nees.append(np.mean((error[100:] / sigmas[100:, :2]) ** 2))
    # constant heading deviation, scale and misalignment make the figure of a run a chi-square of few degrees of
    # freedom, and the mean of ten good to a factor of two
    assert 0.5 < np.mean(nees) < 2.0


def first_anchor_known(survey):
    """The survey with dead reckoning moved as a whole to where the first anchor truly is."""
    first = survey.anchor_pings[0]
    truth, dr = survey.T_world_body[first], survey.T_world_body_dr[first]
    turn = yaw_of(truth[None])[0] - yaw_of(dr[None])[0]
    T_dr = turned(survey.T_world_body_dr, turn, truth[:3, 3] - turned(dr, turn, np.zeros(3))[:3, 3])
    T_dr[:, 2, 3] = survey.T_world_body_dr[:, 2, 3]
    return replace(
        survey, T_world_body_dr=T_dr, dead_reckoning=DeadReckoning(survey.time, T_dr, survey.dead_reckoning.config)
    )


def test_between_two_well_known_anchors_dead_reckoning_sags(straight):
    config = DeadReckoningConfig(
        heading_walk=1e-12, heading_deviation_sd=0.0, velocity_scale_sd=0.0, velocity_noise=0.1
    )
    reckoning = DeadReckoning(*straight, config.model_copy(update={"velocity_misalignment_sd": 0.0}))
    sigmas = spread_sigmas(reckoning, [0, 800], np.full((2, 4), 1e-6))
    # a Brownian bridge of 80 s at its middle: 0.1 m/s/sqrt(Hz) over 20 s
    np.testing.assert_allclose(sigmas[400, :2], 0.1 * np.sqrt(20.0), rtol=1e-4)


def test_sigmas_refuse_rows_that_do_not_fit(straight):
    with pytest.raises(ValueError, match=r"one ping an anchor is wanted, got pings of shape \(2,\) for 3 anchors"):
        spread_sigmas(DeadReckoning(*straight), [0, 9], np.ones((3, 4)))
