"""Shadows on lines whose lit and silent parts are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frontend.arrays import FloatArray
from frontend.shadows import ShadowConfig, expected_echo, label_shadows
from tests.frontend.flat_floor import FlatFloor, fan
from tests.frontend.reconstruction.small_window import make_tables

SPACING, N_SAMPLES, ALTITUDE = 0.05, 900, 10.0
RANGE = (np.arange(N_SAMPLES) + 0.5) * SPACING
NOISE = np.array([2e-7, 1e-7])


def lines(n: int = 6, roll: float = 0.0) -> FloatArray:
    """What a flat floor 10 m down would return, shape (n, 2, 900)."""
    altitude, zero = np.full(n, ALTITUDE), np.zeros(n)
    return expected_echo(np.broadcast_to(RANGE, (n, N_SAMPLES)), altitude, (zero + roll, zero), make_tables())


def heard(mean: FloatArray, looks: float = 1.0, seed: int = 0) -> FloatArray:
    """The floor's echo on top of the noise, with speckle."""
    mu = np.nan_to_num(mean) + NOISE[:, None]
    return np.asarray(mu * np.random.default_rng(seed).gamma(looks, 1 / looks, mu.shape))


def labels(intensity: FloatArray, expected: FloatArray, config: ShadowConfig | None = None) -> np.ndarray:
    return label_shadows(intensity, expected, np.full(len(intensity), SPACING), NOISE, config or ShadowConfig())


def between(near: float, far: float) -> np.ndarray:
    return np.asarray((near <= RANGE) & (far > RANGE))


def test_what_is_expected_of_a_flat_floor_is_what_the_formula_gives() -> None:
    # the fixture writes the same physics down by itself: beam, power law of range, Lambert's law, area of a cell
    floor = FlatFloor(np.full(3, ALTITUDE), N_SAMPLES, noise=(0.0, 0.0), strength=1.0, roll=0.05, pitch=0.0)
    tables = make_tables()
    angle = -0.5 + 0.0035 * np.arange(610)
    knots = 0.02 * np.arange(2500)
    tables = type(tables)(
        np.stack([fan(k, angle) for k in (0, 1)]), -0.5, 0.0035, -3 * np.log(np.maximum(knots, 0.5)), 0.02, NOISE, 2.0
    )
    attitude = (np.full(3, 0.05), np.zeros(3))
    found = expected_echo(np.broadcast_to(RANGE, (3, N_SAMPLES)), floor.altitude, attitude, tables)
    seen = np.broadcast_to(RANGE > 10.1, found.shape)
    # knots 0.2 degrees and 2 cm apart: linear interpolation in the logarithm
    np.testing.assert_allclose(found[seen], floor.mean_intensity()[seen], rtol=1e-3)
    assert np.isnan(found[..., RANGE < ALTITUDE]).all()


def test_a_flat_floor_has_no_shadow_whatever_the_speckle() -> None:
    expected = lines(60)
    assert labels(heard(expected), expected).mean() < 2e-3


@pytest.mark.parametrize("side", [0, 1], ids=["port", "starboard"])
def test_a_gap_in_the_echo_is_a_shadow_from_end_to_end(side: int) -> None:
    expected = lines()
    mean = expected.copy()
    mean[2, side, between(20.0, 26.0)] = 0.0
    found = labels(heard(mean, looks=4.0), expected)
    truth = np.zeros(found.shape, dtype=bool)
    truth[2, side] = between(20.0, 26.0)
    # ends are good to half of the averaged length
    blurred = between(19.75, 20.25) | between(25.75, 26.25)
    assert np.array_equal(found[..., ~blurred], truth[..., ~blurred])


def test_mud_is_no_shadow() -> None:
    expected = lines()
    mean = expected.copy()
    mean[:, :, between(18.0, 45.0)] *= 0.4
    assert labels(heard(mean, looks=4.0), expected).mean() < 2e-3


def test_a_fade_shorter_than_the_shortest_shadow_is_none() -> None:
    expected = lines()
    mean = expected.copy()
    mean[:, :, between(20.0, 20.9)] = 0.0
    quiet = heard(mean, looks=100.0)
    assert labels(quiet, expected, ShadowConfig(shortest=0.5))[..., between(20.2, 20.7)].all()
    assert not labels(quiet, expected, ShadowConfig(shortest=1.5)).any()


def test_what_a_lit_floor_would_not_lift_out_of_the_noise_is_not_called_shadow() -> None:
    expected = 1e-3 * lines()
    mean = expected.copy()
    mean[:, :, between(40.0, 44.0)] = 0.0
    assert not labels(heard(mean), expected)[..., RANGE > 30].any()


def test_the_water_column_and_nadir_are_not_shadow() -> None:
    expected = lines()
    found = labels(heard(np.zeros_like(expected)), expected)
    # a ray that grazes at 1.1 rad is 10 / sin(1.1) = 11.2 m long
    assert not found[..., RANGE < 11.2].any()


def test_gaps_in_the_recording_are_not_shadow() -> None:
    expected = lines()
    intensity = heard(expected)
    intensity[1, 0, between(20.0, 30.0)] = np.nan
    intensity[3] = np.nan
    found = labels(intensity, expected)
    assert not found[1, 0, between(20.0, 30.0)].any()
    assert not found[3].any()


@settings(max_examples=20, deadline=None)
@given(st.floats(1e-6, 1e6), st.integers(0, 3))
def test_a_lines_gain_and_its_neighbours_change_nothing(gain: float, row: int) -> None:
    expected = lines(4)
    mean = expected.copy()
    mean[:, :, between(25.0, 29.0)] = 0.0
    intensity = heard(mean, looks=4.0)
    whole = label_shadows(gain * intensity, expected, np.full(4, SPACING), gain * NOISE, ShadowConfig())
    alone = label_shadows(intensity[row : row + 1], expected[row : row + 1], np.full(1, SPACING), NOISE, ShadowConfig())
    reference = label_shadows(gain * intensity, gain * expected, np.full(4, SPACING), gain * NOISE, ShadowConfig())
    np.testing.assert_array_equal(reference[row], alone[0])
    np.testing.assert_array_equal(whole, reference)


def test_inputs_stay_as_they_are() -> None:
    expected = lines()
    intensity = heard(expected)
    before = intensity.copy(), expected.copy()
    labels(intensity, expected)
    np.testing.assert_array_equal(intensity, before[0])
    np.testing.assert_array_equal(expected, before[1])


@pytest.mark.parametrize("shape", [(6, 2, 5), (6, 900), (6, 3, 900)])
def test_shapes_that_do_not_agree_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="intensity and expected must both be"):
        labels(np.ones(shape), np.ones((6, 2, 900)) if shape != (6, 3, 900) else np.ones(shape))
