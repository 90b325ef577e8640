"""A window of a few pings over a flat floor, its echoes by the formula, under any attitude."""

from dataclasses import replace

import numpy as np

from frontend.arrays import BoolArray, FloatArray
from frontend.bottom import Bottom
from frontend.radiometry import Radiometry, Tables
from frontend.reconstruction.line_image import EchoModel, LineImage, see_lines
from frontend.reconstruction.lines import LineFrames, frame_lines
from frontend.reconstruction.window_data import WindowData, window_data
from frontend.recording import Quantity
from frontend.trajectory import Trajectory
from frontend.windows import Window
from tests.frontend.flat_floor import FlatFloor, fan

ALTITUDE = 10.0
ATTITUDES = [(0.0, 0.0), (0.15, 0.0), (-0.15, 0.2), (0.3, -0.1)]  # roll and pitch [rad]


def make_tables() -> Tables:
    """What the flat floor's sonar does: its fan, spreading, its noise; finely spaced."""
    angle = -0.6 + 0.0035 * np.arange(640)
    log_range = np.log(3e6) - 3 * np.log(np.maximum(0.02 * np.arange(2500), 0.5))
    beams = np.stack([fan(side, angle) for side in (0, 1)])
    return Tables(beams, -0.6, 0.0035, log_range, 0.02, np.array([2.0, 1.0]), 2.0)


def make_window(
    n: int = 12, roll: float = 0.0, pitch: float = 0.0, turn: float = 0.0, altitude: float = ALTITUDE
) -> WindowData:
    """A window of n pings half a metre apart that turns so much from ping to ping [rad]."""
    floor = FlatFloor(np.full(n, altitude), looks=1e6, roll=roll, pitch=pitch)
    recording = floor.record(np.random.default_rng(0), Quantity.INTENSITY)
    track = recording.trajectory_dr
    yaw = turn * np.arange(n)
    run = 0.5 * np.stack([np.cos(yaw), np.sin(yaw)])
    x, y = np.cumsum(run, axis=1)
    turned = Trajectory(track.time, x, y, track.z, track.roll, track.pitch, yaw)
    bottom = Bottom(np.full((n, 2), altitude / np.cos(pitch)), np.full(n, altitude), 1.0)
    radiometry = Radiometry(Quantity.INTENSITY, 1e6, make_tables())
    return window_data(replace(recording, trajectory_dr=turned), Window(0, 0, n, n // 2), bottom, radiometry)


def make_echoes(inner_angle: float = 0.2) -> EchoModel:
    """The sonar of `make_window`."""
    return EchoModel(Radiometry(Quantity.INTENSITY, 1e6, make_tables()), inner_angle, 6.0, 4.0)


def make_lines(data: WindowData, spacing: float = 1.0) -> tuple[LineFrames, LineImage]:
    """Lines over the flat floor and what they saw."""
    frames = frame_lines(data, spacing)
    return frames, see_lines(data, no_shadow(data), frames, np.zeros(frames.shape), make_echoes())


def no_shadow(data: WindowData) -> BoolArray:
    """Labels of a window that is lit all over."""
    return np.zeros(data.intensity.shape, dtype=bool)


def rough(frames: LineFrames, seed: int = 0, height: float = 0.3) -> FloatArray:
    """A smooth random relief, shape (L, C)."""
    rng = np.random.default_rng(seed)
    points = frames.points(np.zeros(frames.shape))
    relief = np.zeros(frames.shape)
    for _ in range(5):
        k = rng.normal(0, 0.5, 2)
        relief += np.sin(points[..., 0] * k[0] + points[..., 1] * k[1] + rng.uniform(0, 6))
    return height * relief
