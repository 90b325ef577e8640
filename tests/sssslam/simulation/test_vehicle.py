from typing import Any

import numpy as np
import pytest

from frontend.arrays import FloatArray
from frontend.frames import rotation_world_body
from frontend.heightfield import Heightfield
from sssslam.simulation.survey import Legs
from sssslam.simulation.vehicle import Motion, VehicleConfig, crab_angle, make_motion
from sssslam.simulation.waves import WavesConfig, make_waves

CALM = {"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0, "heave": 0.0}
STRAIGHT = np.stack([np.linspace(-80.0, 80.0, 641), np.zeros(641)], axis=-1)


def _floor(height: Any = lambda x, y: 0.0 * (x + y) - 50.0) -> Heightfield:
    axis = np.arange(-150.0, 151.0)
    return Heightfield(height(axis[None, :], axis[:, None]), 1.0, (-150.0, -150.0))


def _drive(path: FloatArray = STRAIGHT, floor: Heightfield | None = None, seed: int = 0, **values: Any) -> Motion:
    config = VehicleConfig.model_validate({"waves": CALM, **values})
    return make_motion(config, path, floor or _floor(), np.random.default_rng(seed))


def _times(motion: Motion) -> FloatArray:
    return np.linspace(0.0, motion.duration, 4001)


def test_a_calm_straight_run_is_even_level_and_on_its_line() -> None:
    motion = _drive(speed=2.0)
    truth = motion.trajectory(np.array([0.0, 10.0, 30.0]))
    assert truth.x.tolist() == pytest.approx([-80.0, -60.0, -20.0])
    for angle in (truth.y, truth.roll, truth.pitch, truth.yaw):
        np.testing.assert_allclose(angle, 0.0, atol=1e-9)
    np.testing.assert_allclose(truth.z, -38.0)
    assert motion.duration == pytest.approx(80.0)


def test_a_vehicle_that_keeps_its_depth_ignores_the_floor() -> None:
    motion = _drive(keeping="depth", depth=20.0, floor=_floor(lambda x, y: -50.0 + 5 * np.sin(x / 20) + 0 * y))
    np.testing.assert_allclose(motion.trajectory(_times(motion)).z, -20.0)


def test_a_vehicle_that_keeps_its_altitude_follows_long_slopes_and_not_short_bumps() -> None:
    slope = _drive(altitude=10.0, floor=_floor(lambda x, y: -50.0 + 0.1 * x + 0 * y))
    truth = slope.trajectory(_times(slope))
    np.testing.assert_allclose(truth.z, -40.0 + 0.1 * truth.x, atol=1e-6)
    bumps = _drive(altitude=10.0, floor=_floor(lambda x, y: -50.0 + np.sin(2 * np.pi * x / 6.0) + 0 * y))
    # Where the path ends there is nothing to smooth with.
    assert np.ptp(bumps.trajectory(np.linspace(15.0, 65.0, 500)).z) < 0.3


def test_a_climb_lifts_the_nose() -> None:
    motion = _drive(floor=_floor(lambda x, y: -50.0 + 0.1 * x + 0 * y), trim_deg=1.0)
    pitch = motion.trajectory(np.array([40.0])).pitch[0]
    assert pitch == pytest.approx(np.radians(1.0) - np.arctan(0.1), abs=1e-6)


def test_turns_keep_the_yaw_rate_and_bank_the_vehicle_into_them() -> None:
    legs = Legs(legs=((-60.0, -30.0, 60.0, -30.0), (60.0, 30.0, -60.0, 30.0)))
    config = VehicleConfig.model_validate({"waves": CALM, "turn_rate_deg": 4.0, "bank": 0.5})
    motion = make_motion(config, legs.path(config.turn_radius), _floor(), np.random.default_rng(0))
    time = _times(motion)
    rate = np.degrees(motion.angular_rate(time)[:, 2])
    # Rounded by inertia, a turn is never faster than planned; interpolation ripples by a few per cent.
    assert 3.8 < rate.max() < 4.25
    fastest = np.argmax(rate)
    # To port, so the port side goes down: negative roll.
    assert motion.trajectory(time).roll[fastest] == pytest.approx(-0.5 * np.radians(rate[fastest]), rel=0.01)


def test_velocity_is_the_derivative_of_position() -> None:
    motion = _drive(waves={"heave": 0.2}, floor=_floor(lambda x, y: -50.0 + 3 * np.sin(x / 20) + 0 * y))
    time = np.linspace(1.0, motion.duration - 1.0, 200)
    step = motion.trajectory(time + 1e-3).positions - motion.trajectory(time - 1e-3).positions
    np.testing.assert_allclose(motion.velocity(time), step / 2e-3, atol=1e-4)


def test_angular_rate_turns_the_body_as_its_poses_say() -> None:
    motion = _drive(waves={"roll_deg": 5.0, "pitch_deg": 4.0, "yaw_deg": 3.0})
    time, step = np.linspace(1.0, motion.duration - 1.0, 50), 0.01
    before, after = (motion.trajectory(time + shift) for shift in (-step / 2, step / 2))
    R_before, R_after = (rotation_world_body(t.roll, t.pitch, t.yaw) for t in (before, after))
    rate = motion.angular_rate(time)
    small = np.zeros((50, 3, 3))
    small[:, 2, 1], small[:, 0, 2], small[:, 1, 0] = (rate * step).T
    small -= np.swapaxes(small, -1, -2)
    # To second order in a turn of a few milliradians.
    np.testing.assert_allclose(R_after, (np.eye(3) + small + 0.5 * small @ small) @ R_before, atol=2e-6)


def test_waves_have_the_deviations_asked_for() -> None:
    waves = make_waves(WavesConfig(roll_deg=2.0, pitch_deg=1.0, yaw_deg=0.5, heave=0.1), np.random.default_rng(1))
    motion = waves.at(np.linspace(0.0, 3e4, 200_001))
    expected = [*np.radians([2.0, 1.0, 0.5]), 0.1]
    # The beat of sixteen sines averages out over hours.
    np.testing.assert_allclose(motion.std(axis=0), expected, rtol=0.02)
    np.testing.assert_allclose(motion.mean(axis=0), 0.0, atol=1e-3)


def test_waves_swing_with_their_period() -> None:
    waves = make_waves(WavesConfig(period=6.0), np.random.default_rng(2))
    roll = waves.at(np.linspace(0.0, 6000.0, 120_001))[:, 0]
    upward = np.count_nonzero((roll[:-1] < 0) & (roll[1:] >= 0))
    assert 6000.0 / upward == pytest.approx(6.0, rel=0.15)


def test_a_current_from_the_side_makes_the_vehicle_crab() -> None:
    # 2 m/s east over ground in water that sets 0.5 m/s north: it must head south of east.
    angle = crab_angle(np.array([[2.0, 0.0, 0.0]]), (0.0, 0.5))
    assert angle[0] == pytest.approx(-np.arctan(0.25))
    motion = _drive(current=(0.0, 0.5))
    assert motion.trajectory(np.array([20.0])).yaw[0] == pytest.approx(-np.arctan(0.25))


def test_a_current_from_astern_changes_no_heading() -> None:
    assert crab_angle(np.array([[2.0, 0.0, 0.0]]), (1.0, 0.0))[0] == 0.0


def test_speed_varies_as_much_as_asked() -> None:
    motion = _drive(speed_variation=0.2)
    speed = np.hypot(*motion.velocity(_times(motion))[:, :2].T)
    assert speed.std() / speed.mean() == pytest.approx(0.2, abs=0.1)
    assert speed.min() > 0.3


def test_a_path_off_the_terrain_is_refused() -> None:
    far = np.stack([np.linspace(0.0, 200.0, 801), np.zeros(801)], axis=-1)
    with pytest.raises(
        ValueError, match=r"the path leaves the terrain at x 150\.\d m, y 0\.0 m: a larger terrain is wanted"
    ):
        _drive(path=far)


def test_flying_into_the_floor_is_refused() -> None:
    with pytest.raises(ValueError, match=r"the vehicle comes within 0\.5 m of the floor, 1 m wanted: fly higher"):
        _drive(keeping="depth", depth=49.5)


def test_a_path_of_no_length_is_refused() -> None:
    with pytest.raises(ValueError, match=r"a path of 0\.50 m at 2\.0 m/s given, at least 0\.75 s of it wanted"):
        _drive(path=np.array([[0.0, 0.0], [0.5, 0.0]]))
