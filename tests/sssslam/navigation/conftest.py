"""A dive whose navigation is known by formula, and logs of it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from frontend.georeference import Georeference
from frontend.recording import Recording
from frontend.trajectory import Trajectory

START = 1_700_000_000.0  # 2023-11-14 22:13:20 UTC


def vehicle(time: np.ndarray) -> dict[str, np.ndarray]:
    """Where the vehicle is [s since START]: 1.5 m/s on a weaving course, its height above the floor not periodic."""
    heading = np.radians(30.0) * np.sin(time / 17.0)
    return {
        "yaw": heading,
        "roll": 0.03 * np.sin(time / 3.1) + 0.01 * np.sin(time / 7.3),
        "pitch": 0.02 * np.sin(time / 4.3),
        "altitude": 8.0 + 1.5 * np.sin(time / 21.0) + 0.8 * np.sin(time / 9.7),
        "depth": 20.0 - 0.5 * np.sin(time / 21.0),
        "speed": np.full(len(time), 1.5),
    }


def positions(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """East and north of the start [m], by fine sums."""
    fine = 0.002 * np.arange(-20_000, int(float(np.max(time)) / 0.002) + 500)
    heading = vehicle(fine + 0.001)["yaw"]
    x, y = (np.concatenate([[0.0], np.cumsum(0.002 * 1.5 * f(heading))])[:-1] for f in (np.cos, np.sin))
    return np.interp(time, fine, x - x[20_000]), np.interp(time, fine, y - y[20_000])


@pytest.fixture
def dive() -> Callable[..., Recording]:
    """Makes the dive: 5 Hz, a dark water column and a bright floor, any field replaced."""

    def make(n: int = 600, **changes) -> Recording:
        time = 0.2 * np.arange(n)
        said, (x, y) = vehicle(time), positions(time)
        slant_range = (np.arange(200) + 0.5) * 0.15
        rng = np.random.default_rng(5)
        level = np.where(slant_range[None, :] < said["altitude"][:, None], 2.0, 300.0)
        echoes = (rng.gamma(3.0, 1 / 3, (2, n, 200)) * level).astype(np.float32)
        track = Trajectory(START + time, x, y, -said["depth"], said["roll"], said["pitch"], said["yaw"])
        fields = {name: said[name] for name in ("altitude", "depth", "speed")} | changes
        water = {"sample_spacing": np.full(n, 0.15), "sound_speed": np.full(n, 1500.0)}
        place = {"georeference": Georeference(45.0, 5.0), "source": "dive.xtf"}
        return Recording(echoes[0], echoes[1], trajectory_dr=track, **(water | place | fields))

    return make


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Writes text to a file."""

    def write_text(text: str, name: str = "navigation.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(text.encode())
        return path

    return write_text
