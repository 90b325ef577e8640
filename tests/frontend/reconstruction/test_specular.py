"""Specular echoes: told from a diffuse floor, and not believed to be shape."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.reconstruction.specular import specular_end, specular_variance

ALTITUDE, SPACING, N = 12.0, 0.05, 40
RANGE = SPACING * (np.arange(800) + 0.5)


def echoes(decibels: float, width: float = np.radians(6.0), seed: int = 0) -> np.ndarray:
    """Single-look echoes of a flat floor: Lambert's law, and a Gaussian lobe about the nadir so much louder."""
    cosine = np.minimum(ALTITUDE / RANGE, 1.0)
    angle = np.arccos(cosine)
    law = cosine**2 + 10 ** (decibels / 10) * np.exp(-((angle / width) ** 2) / 2)
    mean = np.where(RANGE >= ALTITUDE, law, 1e-4)
    return mean * np.random.default_rng(seed).exponential(size=(N, 2, len(RANGE)))


def end_of(intensity: np.ndarray) -> np.ndarray:
    return specular_end(intensity, np.full(N, SPACING), np.full((N, 2), ALTITUDE))


@given(st.integers(0, 999))
def test_a_diffuse_floor_has_no_specular_echo(seed):
    assert np.array_equal(end_of(echoes(-40.0, seed=seed)), [0.0, 0.0])


@given(st.integers(0, 999), st.floats(15.0, 30.0))
def test_a_specular_echo_ends_where_its_lobe_does(seed, decibels):
    end = end_of(echoes(decibels, seed=seed))
    lobe = ALTITUDE / np.cos(np.radians(6.0) * np.sqrt(2 * decibels * np.log(10) / 10))  # as loud as Lambert's law
    assert ((end > ALTITUDE) & (end < lobe + 2 * 0.04 * ALTITUDE)).all()


def test_each_side_is_judged_by_itself_and_a_missing_one_is_not_specular():
    intensity = echoes(20.0)
    intensity[:, 0] = np.nan
    end = end_of(intensity)
    assert end[0] == 0.0
    assert end[1] > ALTITUDE


def test_flanks_within_the_specular_echo_may_be_wrong_and_nothing_else():
    level = np.exp(np.array([[0.0, 5.0, 2.0, 1.5, 1.0, -3.0, -3.5]] * 2))
    variance = specular_variance(level, np.array([4.0, 0.0]))
    assert variance[0] == pytest.approx([16.0, 16.0, 4.0, 0.0, 0.0, 0.0, 0.0])
    assert np.array_equal(variance[1], np.zeros(7))
