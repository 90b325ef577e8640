"""What repeats goes from a relief; what does not stays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from frontend.arrays import FloatArray
from frontend.repetition import without_repetition

SHAPE = (110, 130)
ALL = np.ones(SHAPE)


def texture(seed: int, rms: float = 0.1, length: float = 1.5) -> FloatArray:
    """Relief alike in all directions."""
    field = gaussian_filter(np.random.default_rng(seed).standard_normal(SHAPE), length)
    return np.asarray(rms * field / field.std())


def waves(wavelength: float, height: float, degrees: float = 30.0) -> FloatArray:
    """Straight crests."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    phase = 2 * np.pi * (np.cos(np.radians(degrees)) * x + np.sin(np.radians(degrees)) * y) / wavelength
    return np.asarray(0.5 * height * np.sin(phase))


def correlation(a: FloatArray, b: FloatArray) -> float:
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


@given(st.integers(0, 1000))
def test_relief_alike_in_all_directions_stays(seed: int) -> None:
    floor = texture(seed)
    rest = without_repetition(floor, ALL)
    assert correlation(floor, rest) > 0.97
    assert np.std(rest) > 0.9 * np.std(floor)


@given(
    wavelength=st.floats(4.0, 14.0), height=st.floats(0.3, 1.5), degrees=st.floats(0.0, 180.0), seed=st.integers(0, 9)
)
def test_of_waves_on_a_floor_the_floor_is_left(wavelength: float, height: float, degrees: float, seed: int) -> None:
    floor = texture(seed)
    rest = without_repetition(floor + waves(wavelength, height, degrees), ALL)
    assert np.std(rest) < 2.0 * np.std(floor)
    middle = (slice(20, -20), slice(20, -20))  # at the rims a wave is cut and leaks into other wavenumbers
    assert correlation(floor[middle], rest[middle]) > 0.6


def test_two_noisy_looks_at_sand_waves_fit_at_one_place_only() -> None:
    shift, wavelength = 10, 10.0  # a whole wave along x
    floor = texture(1) + waves(wavelength, 1.0, 0.0)
    looks = [floor + texture(seed, 0.08) for seed in (2, 3)]

    def lead(a: FloatArray, b: FloatArray) -> float:
        """The correlation one wave off, over that at the right place."""
        return correlation(a[:, shift:], b[:, :-shift]) / correlation(a, b)

    assert lead(*looks) > 0.9
    assert lead(*(without_repetition(look, ALL) for look in looks)) < 0.5


def test_no_length_unit_and_no_height_unit_is_preferred() -> None:
    floor = texture(4) + waves(9.0, 1.0)
    np.testing.assert_allclose(without_repetition(1e3 * floor, ALL), 1e3 * without_repetition(floor, ALL), atol=1e-9)


def test_cells_without_trust_count_as_nothing_and_stay_so() -> None:
    weight = ALL.copy()
    weight[:, :30] = 0.0
    floor = texture(5)
    rest = without_repetition(floor, weight)
    assert not rest[:, :30].any()
    loud = np.where(weight > 0, floor, 1e6)
    np.testing.assert_array_equal(without_repetition(loud, weight), rest)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (3, 2)])
def test_the_smallest_rasters_are_taken(shape: tuple[int, int]) -> None:
    assert not without_repetition(np.zeros(shape), np.ones(shape)).any()
    assert np.isfinite(without_repetition(np.ones(shape), np.ones(shape))).all()
