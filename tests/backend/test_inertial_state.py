import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from backend.inertial_state import (
    CURRENT,
    DEVIATION,
    HEADING,
    N_STATES,
    POSITION,
    TURN,
    VELOCITY,
    State,
    prior_covariance,
)
from backend.mechanisation import mechanise
from backend.sensor_models import MODELS, View
from tests.backend.sensor_scenes import GRAVITY, attitude, grade, path

CONFIG = grade("mems")


@pytest.fixture
def state():
    rng = np.random.default_rng(0)
    vector = rng.normal(size=N_STATES) * 0.05
    vector[TURN], vector[VELOCITY], vector[POSITION] = 0.0, [1.5, -0.7, 0.1], [40.0, -60.0, 3.0]
    return State(Rotation.from_euler("ZYX", [0.8, 0.06, -0.04]).as_matrix(), vector)


def test_what_is_added_can_be_taken_off(state):
    error = 0.1 * np.random.default_rng(1).normal(size=N_STATES)
    np.testing.assert_allclose(state.plus(error).minus(state), error, atol=1e-12)


def test_the_track_depends_on_the_errors_as_said(state):
    step = 1e-6
    for k in range(N_STATES):
        error = step * np.eye(N_STATES)[k]
        moved = state.plus(error)
        change = np.append(
            [np.arctan2(m[1, 0], m[0, 0]) for m in [moved.attitude @ state.attitude.T]],
            moved.vector[POSITION] - state.vector[POSITION],
        )
        np.testing.assert_allclose(change / step, state.track_sensitivity[:, k], atol=1e-4)


def expected(name, state, lag=0.0):
    """What a sensor should answer, up to sign: the difference to zeros."""
    pose = state.attitude[None], state.vector[None, VELOCITY], state.vector[None, POSITION]
    n = {"compass": 1, "tilt": 2, "dvl": 3, "speed_log": 1, "depth": 1, "gnss": 2}[name]
    return MODELS[name](View(*pose, np.array([lag]), state.vector, 5.0), np.zeros((1, n)), CONFIG)


@pytest.mark.parametrize("name", ["compass", "dvl", "speed_log", "depth", "gnss"])
def test_sensitivities_are_the_derivatives_of_what_is_expected(state, name):
    if name == "compass":
        # a deviation turns with the heading: left out, so that nothing is learnt of the heading by it
        state.vector[DEVIATION] = 0.0
    step, H = 1e-6, expected(name, state).sensitivity
    for k in range(N_STATES):
        ends = [expected(name, state.plus(sign * step * np.eye(N_STATES)[k])).difference for sign in (-1.0, 1.0)]
        np.testing.assert_allclose((ends[0] - ends[1]) / (2.0 * step), H[:, k], atol=1e-5)


def test_level_bodies_see_up_along_z():
    state = State(np.eye(3), np.zeros(N_STATES))
    np.testing.assert_allclose(expected("tilt", state).difference, 0.0, atol=1e-15)


def test_a_body_rolled_to_starboard_against_a_level_state_has_a_tilt_error_about_x():
    state = State(np.eye(3), np.zeros(N_STATES))
    view = View(state.attitude[None], np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1), state.vector, 5.0)
    residual = MODELS["tilt"](view, np.array([[0.01, 0.0]]), CONFIG)
    np.testing.assert_allclose(residual.difference, [0.01, 0.0], atol=1e-6)
    assert np.allclose(residual.sensitivity[:, TURN], np.eye(3)[:2])


@pytest.mark.parametrize("name", ["compass", "tilt", "dvl", "depth"])
def test_nothing_on_board_sees_a_turn_of_the_whole_track_that_the_compass_shares(state, name):
    whole = np.zeros(N_STATES)
    whole[TURN.stop - 1], whole[HEADING] = 1.0, -1.0
    np.testing.assert_allclose(expected(name, state, lag=0.3).sensitivity @ whole, 0.0, atol=1e-12)


def motion_of_the_eight(earth=(0.0, 0.0, 0.0)):
    time = np.arange(0.0, 10.001, 0.02)
    half, turned = 1e-3, attitude(time)
    rate = (attitude(time - half).inv() * attitude(time + half)).as_rotvec() / (2.0 * half)
    rate = rate + turned.inv().apply(earth)
    inertial = np.concatenate([rate, turned.inv().apply(path(time)[2] + [0.0, 0.0, GRAVITY])], axis=1)
    vector = np.zeros(N_STATES)
    vector[VELOCITY], vector[POSITION] = path(time[:1])[1][0], path(time[:1])[0][0]
    return State(turned[0].as_matrix(), vector), time, inertial


def test_perfect_rates_and_forces_give_the_path_back():
    state, time, inertial = motion_of_the_eight()
    motion = mechanise(state, time, inertial, np.zeros((len(time), 2)), np.zeros(3))
    # trapezoids over 20 ms: the third derivative of a heave of 8 s makes millimetres in 10 s
    np.testing.assert_allclose(motion.position, path(time)[0], atol=5e-3)
    np.testing.assert_allclose(motion.attitude, attitude(time).as_matrix(), atol=1e-4)


def test_the_earths_rate_does_not_turn_the_track():
    earth = np.array([0.0, 4e-3, 5e-3])  # a hundred times the Earth's, to be seen
    state, time, inertial = motion_of_the_eight(earth)
    motion = mechanise(state, time, inertial, np.zeros((len(time), 2)), earth)
    np.testing.assert_allclose(motion.attitude, attitude(time).as_matrix(), atol=1e-4)


def test_the_transition_carries_errors_as_the_mechanisation_does():
    state, time, inertial = motion_of_the_eight()
    time, inertial, noise = time[:26], inertial[:26], np.zeros((26, 2))  # half a second
    whole = mechanise(state, time, inertial, noise, np.zeros(3))

    def end(start):
        motion = mechanise(start, time, inertial, noise, np.zeros(3))
        vector = start.vector.copy()
        vector[VELOCITY], vector[POSITION] = motion.velocity[-1], motion.position[-1]
        return State(motion.attitude[-1], vector)

    for k in range(15):
        error = 1e-4 * np.eye(N_STATES)[k]
        slope = end(state.plus(error)).minus(end(state)) / 1e-4
        # second order in steps of 20 ms; the arm to the origin, 30 m, is long
        np.testing.assert_allclose(slope, whole.transition[:, k], atol=2e-2)


def test_noise_grows_as_a_random_walk():
    state, time, inertial = motion_of_the_eight()
    motion = mechanise(state, time, inertial, np.tile([1e-5, 2e-3], (len(time), 1)), np.zeros(3))
    np.testing.assert_allclose(np.diag(motion.noise)[:3], 1e-10 * 10.0, rtol=1e-6)
    assert np.diag(motion.noise)[5] == pytest.approx(4e-6 * 10.0, rel=0.01)  # turns by the gyro's noise hardly reach it


def test_without_a_compass_the_heading_is_as_known_as_at_the_start():
    with_compass, without = (prior_covariance(CONFIG, has, True, 0.0) for has in (True, False))
    assert without[2, 2] == pytest.approx(CONFIG.heading_bias_sd**2)
    assert with_compass[2, 2] > 9.0  # anything: the compass will say
    assert np.diag(without)[[HEADING, *range(DEVIATION.start, DEVIATION.stop)]].max() < 1e-15
    assert (np.diag(with_compass)[CURRENT] > 0).all()
