"""Range law and beam pattern of cells filled by formula."""

import numpy as np
import pytest

from frontend.range_law import Excess, RangeLaw, angle_knots, fit_beam_and_range

FIRST, STEP, N_KNOTS = -0.5, 0.035, 62
KNOTS = FIRST + STEP * np.arange(N_KNOTS)


def excess(law: RangeLaw, altitude: np.ndarray, noise: float = 0.0) -> Excess:
    """A fan on both sides, seen from some altitudes, with that range law."""
    r = np.broadcast_to((np.arange(800) + 0.5) * 0.06, (len(altitude), 800))
    cosine = altitude[:, None] / r
    angle = np.arccos(np.where(cosine < 1, cosine, np.nan))
    both = np.stack([angle, angle], axis=1)
    level = np.exp(-((np.nan_to_num(both) - 1.0) ** 2) + law(r)[:, None])
    level *= np.exp(noise * np.random.default_rng(1).normal(size=level.shape))
    return Excess(both, level, np.isfinite(both), r)


def fitted(law: RangeLaw, altitude: np.ndarray, noise: float = 0.0) -> tuple[np.ndarray, RangeLaw]:
    return fit_beam_and_range(excess(law, altitude, noise), FIRST, STEP, N_KNOTS)


NOTHING = np.zeros(2), np.array([0.0, 60.0])
WAVY = 8.0 + 6.0 * np.sin(np.arange(300) / 40) ** 2
FAR = np.linspace(12.0, 45.0, 50)


@pytest.mark.parametrize("power", [0.0, 2.0, 3.0, 4.0])
@pytest.mark.parametrize("absorption", [0.0, 0.04])
def test_power_and_absorption_are_found_where_altitude_changes(power: float, absorption: float) -> None:
    true = RangeLaw(power, absorption, *NOTHING)
    beam, law = fitted(true, WAVY, noise=0.3)
    error = law(FAR) - true(FAR)
    # half a decibel over the swath
    assert np.ptp(error) < 0.12
    seen = (KNOTS > 0.5) & (KNOTS < 1.3)
    wrong = beam[:, seen] + (KNOTS[seen] - 1.0) ** 2
    assert np.ptp(wrong) < 0.12


def test_a_step_of_the_recorders_gain_is_followed() -> None:
    reach = np.linspace(0.0, 48.0, 200)
    true = RangeLaw(1.0, 0.0, 0.6 / (1 + np.exp(-(reach - 25.0) / 2.0)), reach)
    _, law = fitted(true, WAVY)
    # a step of 0.6, smoothed over a few cells of 1.2 m
    assert np.ptp(law(FAR) - true(FAR)) < 0.2


def test_at_one_altitude_what_is_known_is_the_product() -> None:
    true = RangeLaw(1.0, 0.02, *NOTHING)
    altitude = np.full(300, 10.0)
    beam, law = fitted(true, altitude)
    r = np.linspace(12.0, 40.0, 50)
    angle = np.arccos(10.0 / r)
    product = np.interp(angle, KNOTS, beam[0]) + law(r)
    np.testing.assert_allclose(product - (true(r) - (angle - 1.0) ** 2), 0.0, atol=0.1)


def test_angles_never_seen_stay_near_those_seen() -> None:
    beam, _ = fitted(RangeLaw(3.0, 0.0, *NOTHING), WAVY)
    assert np.abs(beam).max() < 10.0


def test_single_cells_gone_wrong_change_little() -> None:
    law = RangeLaw(3.0, 0.0, *NOTHING)
    clean = excess(law, WAVY)
    level = clean.level.copy()
    level[:, :, 500:520] *= 1e3  # a second bottom
    _, found = fit_beam_and_range(Excess(clean.angle, level, clean.is_usable, clean.slant_range), FIRST, STEP, N_KNOTS)
    assert np.ptp((found(FAR) - law(FAR))[FAR < 28.0]) < 0.3


def test_pings_of_two_range_settings_are_fitted_together() -> None:
    law = RangeLaw(3.0, 0.0, *NOTHING)
    near, far = excess(law, WAVY[:150]), excess(law, WAVY[150:])
    half = Excess(*(np.concatenate([a, b]) for a, b in zip(vars(near).values(), vars(far).values(), strict=True)))
    r = half.slant_range.copy()
    r[:150] /= 2
    cosine = WAVY[:150, None] / r[:150]
    angle = half.angle.copy()
    angle[:150] = np.arccos(np.where(cosine < 1, cosine, np.nan))[:, None]
    level = np.exp(-((np.nan_to_num(angle) - 1.0) ** 2) + law(r)[:, None])
    _, found = fit_beam_and_range(Excess(angle, level, np.isfinite(angle), r), FIRST, STEP, N_KNOTS)
    assert np.ptp(found(FAR) - law(FAR)) < 0.12


def test_angles_fall_on_the_nearest_knot() -> None:
    np.testing.assert_array_equal(angle_knots(np.array([-9.0, -0.5, 0.02, 9.0]), -0.5, 0.1, 12), [0, 0, 5, 11])
