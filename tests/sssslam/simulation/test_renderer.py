"""Echoes of floors simple enough for pencil and paper."""

from itertools import pairwise
from typing import Any

import numba
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq

from frontend.arrays import FloatArray
from sssslam.simulation.planes import Rates
from sssslam.simulation.receiver import ReceiverConfig
from sssslam.simulation.seabed import Lambert

H = 12.0  # the bench's altitude
slow_fixture = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
angle = st.floats(-0.35, 0.35)


def _level(bench: Any) -> float:
    """Energy of a broadside ray per unit of footprint: width of the one sub-beam times its beamwidth."""
    return 2 * bench.sonar.sub_beam_extent * bench.sonar.horizontal_beamwidth(bench.sound_speed)


def _flat_floor(edges: FloatArray, h: float, exponent: float = 2.0) -> FloatArray:
    """Sum of cos^n area / r^4 over each bin: a footprint r wide has area r (r / y) dr at y; cos = h / r."""
    below = [max(edge, h) for edge in edges]
    return np.array(
        [
            quad(lambda r: (h / r) ** exponent / (r**2 * np.sqrt(r**2 - h**2)), a, b)[0] if b > a else 0.0
            for a, b in pairwise(below)
        ]
    )


def test_flat_floor_returns_what_the_sonar_equation_says(bench: Any) -> None:
    bench.seabed = Lambert(strength=0.0, exponent=2.0)
    expected = _level(bench) * _flat_floor(bench.ranges(), H)
    echo = bench.echo()
    far = int(15 / 0.05)
    # Trapezium steps of 5 cm on a 12 m range: (dt)^2 errors below 1e-3; nothing at all before the bottom.
    np.testing.assert_allclose(echo[far:-1], expected[far:-1], rtol=2e-3)
    assert echo[: int(H / 0.05) - 1].max() == 0.0
    assert echo.sum() == pytest.approx(expected.sum(), rel=2e-3)


def test_absorption_costs_its_decibels_both_ways(bench: Any) -> None:
    clear = bench.echo()
    bench.absorption = 0.1
    loss = 10 * np.log10(bench.echo()[500] / clear[500])
    assert loss == pytest.approx(-2 * 0.1 * 500.5 * 0.05, abs=0.02)


@given(roll=angle, pitch=angle, yaw=st.floats(-3.0, 3.0), side=st.sampled_from([1.0, -1.0]))
@slow_fixture
def test_a_pencil_beam_meets_a_flat_floor_at_the_range_of_the_closed_form(
    bench: Any, roll: float, pitch: float, yaw: float, side: float
) -> None:
    # A fan 1 degree wide, 40 degrees below the horizontal, that hears nothing elsewhere.
    bench.options |= {"vertical_beamwidth_deg": 1.0, "depression_deg": 40.0, "sidelobe_level": -300.0}
    peak = (np.argmax(bench.echo(side, roll=roll, pitch=pitch, yaw=yaw)) + 0.5) * 0.05
    off_nadir = np.radians(50.0) + side * roll
    expected = H / (np.cos(pitch) * np.cos(off_nadir))
    # The brightest bin lies nearer than the axis by the fall of the echo within the fan, some 1 % of the range.
    assert peak == pytest.approx(expected, rel=0.015, abs=0.1)


@given(roll=angle, pitch=angle)
@slow_fixture
def test_the_first_bottom_return_over_a_flat_floor_grows_with_pitch_and_not_with_roll(
    bench: Any, roll: float, pitch: float
) -> None:
    first = np.flatnonzero(bench.echo(roll=roll, pitch=pitch))[0]
    assert first == int(H / np.cos(pitch) / 0.05 + 1e-9)


def test_roll_moves_no_echo_on_a_flat_floor(bench: Any) -> None:
    # An omnidirectional array hears the same whatever its roll.
    np.testing.assert_allclose(bench.echo(roll=0.3), bench.echo(), rtol=1e-9)


def test_the_first_bottom_return_over_a_slope_is_the_distance_to_its_plane(bench: Any) -> None:
    slope = np.radians(10.0)
    bench.height = lambda x, y: y * np.tan(slope) + 0.0 * x
    bench.options["inner_angle_deg"] = 60.0
    for side in (1.0, -1.0):
        first = np.flatnonzero(bench.echo(side))[0]
        assert first == int(H * np.cos(slope) / 0.05)


def test_an_array_that_does_not_look_past_nadir_misses_the_foot_on_the_other_side(bench: Any) -> None:
    bench.height = lambda x, y: y * np.tan(np.radians(10.0)) + 0.0 * x
    first = np.flatnonzero(bench.echo(-1.0))[0]
    assert first == int(H / 0.05)


def test_the_shadow_of_a_wall_ends_where_the_ray_over_its_crest_meets_the_floor(bench: Any) -> None:
    wall, near, far = 2.0, 20.0, 21.0
    bench.spacing, bench.size = 0.05, 110.0
    bench.height = lambda x, y: np.where((y > near) & (y < far), wall, 0.0) + 0.0 * x
    echo = bench.echo()
    crest = np.hypot(far, H - wall)
    # (h - z_crest) / y_crest = h / y_end
    end = far * H / (H - wall)
    dark = np.flatnonzero(echo[int(crest / 0.05) + 2 :] == 0) + int(crest / 0.05) + 2
    # One cell of the terrain (5 cm) blurs the crest, which the lever h / (h - z) = 1.2 magnifies.
    assert dark[0] * 0.05 == pytest.approx(crest, abs=0.15)
    assert (dark[-1] + 1) * 0.05 == pytest.approx(np.hypot(end, H), abs=0.15)
    assert dark.size == dark[-1] - dark[0] + 1


def test_a_ramp_is_foreshortened_as_its_tilt_demands(bench: Any) -> None:
    slope = np.radians(20.0)
    bench.height = lambda x, y: np.maximum(y - 15.0, 0.0) * np.tan(slope) + 0.0 * x
    echo, sample = bench.echo(), int(28 / 0.05)
    r = (sample + 0.5) * 0.05
    # The ramp is a plane at distance d, tilted by s: r = d / cos(t - s), energy per range ~ cos / (r^3 tan).
    d = (H + 15.0 * np.tan(slope)) * np.cos(slope)
    expected = _level(bench) * 0.05 * (d / r) / (r**3 * np.tan(np.arccos(d / r)))
    assert echo[sample] == pytest.approx(expected, rel=5e-3)


def test_a_cliff_that_faces_the_sonar_lays_its_top_over_its_foot(bench: Any) -> None:
    bench.spacing = 0.1
    bench.size = 90.0
    bench.height = lambda x, y: np.clip((y - 20.0) / 0.1, 0.0, 1.0) * 6.0 + 0.0 * x
    echo = bench.echo()
    bench.height = lambda x, y: 0.0 * (x + y)
    flat = bench.echo()
    foot, top = np.hypot(20.0, H), np.hypot(20.0, H - 6.0)
    over = slice(int(top / 0.05) + 4, int(foot / 0.05) - 4)
    # The cliff's top is nearer than its foot, and what it sends comes on top of the flat floor before it.
    assert top < foot
    assert np.all(echo[over] > 1.5 * flat[over])
    np.testing.assert_allclose(echo[: int(top / 0.05) - 4], flat[: int(top / 0.05) - 4], rtol=1e-9)


def test_coarser_bins_hold_the_same_energy(bench: Any) -> None:
    rng = np.random.default_rng(3)
    bumps = rng.uniform(-0.3, 0.3, (521, 521))
    bench.height = lambda x, y: bumps + 0.0 * (x + y)
    fine = bench.echo()
    bench.options["sample_spacing"] = 0.2
    coarse = bench.echo()
    np.testing.assert_allclose(fine.reshape(-1, 4).sum(axis=1)[:-2], coarse[:-2], rtol=1e-9)


def test_reflectivity_scales_the_echo(bench: Any) -> None:
    plain = bench.echo()
    bench.reflectivity = lambda x, y: 3.0 + 0.0 * (x + y)
    np.testing.assert_allclose(bench.echo(), 3.0 * plain, rtol=1e-6)


def test_a_mirrored_world_gives_the_mirrored_side(bench: Any) -> None:
    rough = np.random.default_rng(1).uniform(-0.5, 0.5, (521, 521))
    bench.options["inner_angle_deg"] = 30.0
    bench.height = lambda x, y: rough + 0.0 * (x + y)
    port = bench.echo(1.0, roll=0.1, pitch=0.05, yaw=0.3)
    bench.height = lambda x, y: rough[::-1] + 0.0 * (x + y)
    starboard = bench.echo(-1.0, roll=-0.1, pitch=0.05, yaw=-0.3)
    np.testing.assert_allclose(port, starboard, rtol=1e-6, atol=1e-12 * port.max())


def test_a_world_turned_with_the_vehicle_gives_the_same_echo(bench: Any) -> None:
    rough = np.random.default_rng(2).uniform(-0.5, 0.5, (521, 521))
    bench.height = lambda x, y: rough + 0.0 * (x + y)
    first = bench.echo(roll=0.1, pitch=-0.1, yaw=0.2)
    bench.height = lambda x, y: np.rot90(rough, -1) + 0.0 * (x + y)
    turned = bench.echo(roll=0.1, pitch=-0.1, yaw=0.2 + np.pi / 2)
    np.testing.assert_allclose(turned, first, rtol=1e-5, atol=1e-9 * first.max())


def test_nothing_comes_back_from_beyond_the_edge_of_the_terrain(bench: Any) -> None:
    bench.size = 60.0
    echo = bench.echo()
    edge = np.hypot(30.0, H)
    assert echo[int(edge / 0.05) + 1 :].max() == 0.0
    assert echo[int(edge / 0.05) - 4] > 0.0


def test_a_lever_arm_shifts_the_first_bottom_return(bench: Any) -> None:
    bench.options["lever_arm_port"] = (0.0, 0.0, -2.0)
    assert np.flatnonzero(bench.echo())[0] == int((H - 2.0) / 0.05)


def test_squint_turns_the_beam_forward_on_both_sides(bench: Any) -> None:
    bench.options["squint_deg"] = 20.0
    bench.reflectivity = lambda x, y: np.where(x > 0.0, 1.0, 0.0) + 0.0 * y
    assert all(bench.echo(side)[300:].min() > 0 for side in (1.0, -1.0))
    bench.options["squint_deg"] = -20.0
    assert all(bench.echo(side)[300:].max() < 1e-12 for side in (1.0, -1.0))


def test_the_near_field_keeps_the_footprint_at_the_length_of_the_array(bench: Any) -> None:
    bench.options |= {"array_length": 2.0, "frequency": 400e3, "n_sub_beams": 81, "sub_beam_extent": 0.5}
    bench.spacing, bench.size = 0.1, 110.0
    whole = bench.echo()
    # One bright strip along the beam, its edges half-way between cells 10 cm apart: how much of the beam sees it?
    bench.reflectivity = lambda x, y: np.where(np.abs(x) < 0.45, 1.0, 0.0) + 0.0 * y
    share = bench.echo() / np.maximum(whole, 1e-300)
    offsets = np.linspace(-0.5, 0.5, 20001)
    weight = np.sinc(2 * 0.442946 * offsets) ** 4
    for sample in (400, 900):
        width = np.hypot(2.0, (sample + 0.5) * 0.05 * bench.sonar.horizontal_beamwidth(bench.sound_speed))
        inside = weight[np.abs(offsets) * width < 0.45].sum() / weight.sum()
        # 81 sub-beams resolve the strip's edges to one in forty.
        assert share[sample] == pytest.approx(inside, abs=0.02)


def test_yaw_between_sending_and_receiving_costs_the_overlap_of_the_beams(bench: Any) -> None:
    bench.options |= {"array_length": 0.5, "frequency": 400e3, "n_sub_beams": 101, "sub_beam_extent": 1.5}
    still = bench.echo()
    rate = np.radians(5.0)
    turning = bench.echo(rates=Rates(np.zeros((1, 3)), np.array([[0.0, 0.0, rate]])))
    r = 45.0
    sample = int(r / 0.05)
    width = np.hypot(0.5, r * bench.sonar.horizontal_beamwidth(1500.0))
    ground = np.sqrt(r**2 - H**2)
    shift = rate * 2 * r / 1500.0 * ground / width
    u = np.linspace(-1.5, 1.5, 4001)
    beam = lambda offset: np.sinc(2 * 0.442946 * offset) ** 2  # noqa: E731
    expected = (beam(u) * beam(u + shift)).sum() / (beam(u) ** 2).sum()
    assert expected < 0.9
    assert turning[sample] / still[sample] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("velocity", "yaw_rate", "ahead"), [(20.0, 0.0, True), (0.0, 0.1, False), (0.0, -0.1, True)])
def test_echoes_come_from_half_way_between_the_beam_that_sends_and_the_beam_that_hears(
    bench: Any, velocity: float, yaw_rate: float, ahead: bool
) -> None:
    # Moving on, the port array hears ahead of where it sent; turning to port it hears behind.
    bench.options |= {"array_length": 0.5, "frequency": 400e3, "n_sub_beams": 101, "sub_beam_extent": 1.5}
    rates = Rates(np.array([[velocity, 0.0, 0.0]]), np.array([[0.0, 0.0, yaw_rate]]))
    front, back = (
        _with_reflectivity(bench, lambda x, y, s=sign: np.where(s * x > 0, 1.0, 0.0) + 0.0 * y).echo(rates=rates)[700]
        for sign in (1.0, -1.0)
    )
    assert (front > 1.5 * back) if ahead else (back > 1.5 * front)


def _with_reflectivity(bench: Any, reflectivity: Any) -> Any:
    bench.reflectivity = reflectivity
    return bench


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_side_that_rises_while_the_sound_travels_hears_farther_out(bench: Any, side: float) -> None:
    bench.options |= {"vertical_beamwidth_deg": 4.0, "depression_deg": 40.0, "sidelobe_level": -300.0}
    delay = 2 * H / np.cos(np.radians(50.0)) / 1500.0
    # Starboard goes down by 4 degrees in the meantime: port rises, and the beams meet half-way.
    rates = Rates(np.zeros((1, 3)), np.array([[np.radians(4.0) / delay, 0.0, 0.0]]))
    moved = np.argmax(bench.echo(side, rates)) - np.argmax(bench.echo(side))
    expected = H / np.cos(np.radians(50.0 + side * 2.0)) - H / np.cos(np.radians(50.0))
    assert moved * 0.05 == pytest.approx(expected, abs=0.15)


def test_closing_in_on_the_floor_shortens_the_echo_by_half_the_way_made(bench: Any) -> None:
    speed = 30.0
    moving = bench.echo(rates=Rates(np.array([[0.0, 0.0, -speed]]), np.zeros((1, 3))))
    # At nadir the array comes down by v tau while the sound is under way; half of it counts.
    expected = H - 0.5 * speed * 2 * H / 1500.0
    assert np.flatnonzero(moving)[0] == int(expected / 0.05)


def test_the_surface_returns_a_second_bottom_half_the_detour_later(bench: Any) -> None:
    bench.receiver = ReceiverConfig(gain=0.0, surface_loss=3.0)
    bench.height = lambda x, y: -20.0 + 0.0 * (x + y)
    ghost = bench.echo(z=-15.0)
    bench.receiver = ReceiverConfig(gain=0.0)
    extra = ghost - bench.echo(z=-15.0)
    # Straight down: 5 m direct, 15 up and 20 down by way of the surface.
    assert np.flatnonzero(extra > 0)[0] == int(0.5 * (5.0 + 35.0) / 0.05)
    # Two ways round, 3 dB lost, spreading over the longer leg: r -> sqrt(r^2 - 5^2 + 35^2).
    longest = brentq(lambda r: 0.5 * (r + np.sqrt(r**2 + 1200.0)) - 50.0, 5.0, 50.0)
    flat = lambda r: (5.0 / r) ** 2 / (r**2 * np.sqrt(r**2 - 25.0))  # noqa: E731
    expected = quad(lambda r: flat(r) * r**2 / (r**2 + 1200.0), 5.0, longest)[0]
    assert extra.sum() == pytest.approx(2 * 10**-0.3 * _level(bench) * expected, rel=5e-3)


def test_halving_the_ray_step_converges(bench: Any) -> None:
    hills = lambda x, y: 0.8 * np.sin(0.9 * x + 0.3) * np.cos(0.7 * y)  # noqa: E731
    bench.height, bench.spacing, bench.size = hills, 0.5, 120.0
    images = []
    for step in (0.2, 0.1, 0.05, 0.0125):
        bench.options |= {"ray_step": step, "sample_spacing": 0.5}
        images.append(bench.echo(roll=0.05, pitch=0.05, yaw=0.4))
    errors = [np.abs(image - images[-1]).sum() for image in images[:-1]]
    # Second order inside facets, first order at the edges of shadows: at least as fast as the step.
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]


def test_one_thread_and_many_give_the_same_bytes(bench: Any) -> None:
    rough = np.random.default_rng(5).uniform(-0.5, 0.5, (521, 521))
    bench.height = lambda x, y: rough + 0.0 * (x + y)
    n_threads = numba.get_num_threads()
    many = bench.echo(roll=0.1)
    try:
        numba.set_num_threads(1)
        one = bench.echo(roll=0.1)
    finally:
        numba.set_num_threads(n_threads)
    assert one.tobytes() == many.tobytes()
