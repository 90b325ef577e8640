"""Tracks with known errors."""

import numpy as np
import pytest

from frontend.trajectory import Trajectory


def make_track(n: int = 400, seed: int = 0) -> Trajectory:
    """A winding survey of some 400 m at 1 m between poses, 1 Hz, with a little roll and pitch."""
    rng, s = np.random.default_rng(seed), np.arange(float(n))
    yaw = 0.5 * np.sin(s / 40.0) + s / 120.0
    x, y = (np.concatenate([[0.0], np.cumsum(f(yaw[:-1]))]) for f in (np.cos, np.sin))
    return Trajectory(1.7e9 + s, x, y, -50.0 + np.sin(s / 17.0), *(0.02 * rng.standard_normal((2, n))), yaw)


@pytest.fixture
def track_ref() -> Trajectory:
    """The reference."""
    return make_track()


@pytest.fixture
def track() -> Trajectory:
    """The same track with a drift and noise of its own."""
    ref, rng = make_track(), np.random.default_rng(1)
    s = np.arange(len(ref))
    noise = np.cumsum(0.05 * rng.standard_normal((3, len(ref))), axis=1)
    yaw = ref.yaw + 0.0005 * s
    return Trajectory(ref.time, ref.x + noise[0], ref.y + noise[1], ref.z + noise[2], ref.roll, ref.pitch, yaw)
