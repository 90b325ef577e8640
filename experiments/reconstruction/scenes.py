"""The cases of the experiment: which seafloor, which motion, which passes; simulated with their truth."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from frontend.arrays import FloatArray
from frontend.bottom import Bottom, BottomConfig, find_bottom
from frontend.radiometry import Radiometry, RadiometryConfig
from frontend.reconstruction import JointConfig, calibrate
from frontend.recording import Recording
from frontend.trajectory import Trajectory
from frontend.windows import Window, sliding_windows
from sssslam.simulation import Scene, simulate

TUNING_SEEDS = range(4)  # looked at while settings were chosen
REPORTING_SEEDS = range(10, 100)  # never looked at before they are reported
_MISSION_SEED = 500  # of the floor that the sonar is calibrated over

Leg = tuple[float, float, float, float]
Layers = list[dict[str, Any]]


@dataclass(frozen=True)
class Dive:
    """A simulated dive, the window of each pass, and what is known of the whole of it."""

    recording: Recording
    windows: list[Window]
    bottom: Bottom
    radiometry: Radiometry

    @property
    def n_pings(self) -> int:
        """Pings in all windows together."""
        return sum(window.n_pings for window in self.windows)


def groove(_: int) -> Layers:
    """Woock 2011, figure 1."""
    return [{"kind": "groove", "height": 4.0, "foot": 8.0, "brink": 30.0, "drop": 1.0, "strike_deg": 90.0}]


def fractal(rms: float) -> Callable[[int], Layers]:
    """The floor of SCIENCE 0 with another roughness: power-law relief, sediment, boulders and pits."""
    layers = [{"kind": "fractal", "rms": rms}, {"kind": "sediment", "rms": 0.2}, {"kind": "objects", "count": 300}]
    return lambda _: layers


def bare(_: int) -> Layers:
    """The floor of ``fractal-0.8`` without boulders and pits: what a method says of smooth relief alone."""
    return [{"kind": "fractal", "rms": 0.8}, {"kind": "sediment", "rms": 0.2}]


def falls(seed: int) -> Layers:
    """A place in South Falls, with a fine texture, for the survey resolves a metre."""
    centre = np.random.default_rng(seed).uniform([-50.0, -300.0], [50.0, 300.0])
    texture = {"kind": "fractal", "rms": 0.05, "exponent": 3.5, "longest": 4.0}
    layer = {"kind": "grid", "file": str(data_folder() / "terrain" / "south-falls-1m.npz"), "centre": centre.tolist()}
    return [layer, texture, {"kind": "sediment", "rms": 0.2}]


def reef(_: int) -> Layers:
    """The reef at 20 times its size; a quarter of its height, or it would stand 27 m tall and hide itself."""
    file = str(data_folder() / "terrain" / "horseshoe-reef-1cm.npz")
    return [{"kind": "grid", "file": file, "scale": 20.0, "height_scale": 5.0}, {"kind": "sediment", "rms": 0.2}]


def waves(_: int) -> Layers:
    """The floor of the scene ``sand-waves``: 0.9 m high, 14 m long, oblique to the track."""
    return [
        {"kind": "waves", "wavelength": 14.0, "height": 0.9, "direction_deg": 60.0, "skewness": 0.5, "wander": 0.12},
        {"kind": "fractal", "rms": 0.25, "exponent": 3.5, "longest": 40.0},
        {"kind": "sediment", "rms": 0.15},
    ]


FLOORS: dict[str, Callable[[int], Layers]] = {
    "groove": groove,
    "fractal-0.4": fractal(0.4),
    "fractal-0.8": fractal(0.8),
    "fractal-1.6": fractal(1.6),
    "bare-0.8": bare,
    "falls": falls,
    "reef": reef,
    "waves": waves,
}
_SIZES = {"reef": 159.0, "falls": 380.0}  # of the terrain [m]; what the file holds
_LENGTHS = {"reef": 70.0}  # of a pass [m]
_RANGES = {"reef": 40.0}  # slant range [m]

_STILL = {"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0, "heave": 0.0}
# the sum of sines reaches twice its standard deviation: +-5 degrees of pitch, +-10 of roll
MOTIONS: dict[str, dict[str, float]] = {
    "straight": {},
    "turns": {},
    "pitch": {"pitch_deg": 2.5},
    "roll": {"roll_deg": 5.0},
    "heave": {"heave": 0.5},
    "all": {"pitch_deg": 2.5, "roll_deg": 5.0, "yaw_deg": 1.0, "heave": 0.5},
}
_WEAVING = ("turns", "all")
_SPEED, _PING_RATE = 2.0, 5.0


def passes_of(name: str, length: float, apart: float) -> list[Leg]:
    """Start and end of each pass [m]: one, two opposing that look at the same floor, or those and one across."""
    half, y = 0.5 * length, 0.5 * apart
    legs: dict[str, list[Leg]] = {
        "one": [(-half, 0.0, half, 0.0)],
        "opposing": [(-half, -y, half, -y), (half, y, -half, y)],
        "crossing": [(-half, -y, half, -y), (half, y, -half, y), (0.0, half, 0.0, -half)],
    }
    return legs[name]


PASSES = ("one", "opposing", "crossing")


def data_folder() -> Path:
    """Where real data lie."""
    folder = os.environ.get("SSSSLAM_DATA")
    if not folder:
        raise ValueError("SSSSLAM_DATA is not set; the folder of real recordings and terrain is wanted")
    return Path(folder)


def scene_of(floor: str, motion: str, passes: str, seed: int) -> tuple[Scene, list[Leg]]:
    """The scene of a case, and its passes."""
    reach, size = _RANGES.get(floor, 55.0), _SIZES.get(floor, 400.0)
    legs = passes_of(passes, _LENGTHS.get(floor, 120.0), 0.6 * reach)
    weaves = motion in _WEAVING
    turn_rate = 5.0 if weaves else 10.0  # of the turns between passes where nothing weaves: they are not looked at
    radius = _SPEED / np.radians(turn_rate)
    flown = [piece for leg in legs for piece in (_woven(leg, radius) if weaves else [leg])]
    scene = {
        "name": f"{floor} {motion} {passes}",
        "seed": seed,
        "terrain": {"size": [size, size], "layers": FLOORS[floor](seed)},
        "survey": {"pattern": "legs", "legs": flown},
        "vehicle": {"turn_rate_deg": turn_rate, "waves": {**_STILL, **MOTIONS[motion]}},
        "sonar": {"range_max": reach, "ping_rate": _PING_RATE},
        "drift": {"grade": "none", "altimeter_noise": 0.05},
    }
    return Scene.model_validate(scene), legs


def make_dive(floor: str, motion: str, passes: str, seed: int, calibration: "Calibration") -> Dive:
    """Simulate a case and calibrate its sonar."""
    scene, legs = scene_of(floor, motion, passes, seed)
    recording = simulate(scene)
    assert recording.truth is not None
    windows = windows_of(recording.truth.trajectory, legs)
    bottom = find_bottom(recording, BottomConfig())
    return Dive(recording, windows, bottom, calibration(recording, windows, bottom))


def rougher(dive: Dive, factor: float) -> Dive:
    """The same dive, its seafloor believed so many times as rough as calibration found; only `joint` asks for it."""
    seafloor = dive.radiometry.seafloor
    believed = replace(seafloor, roughness=factor * seafloor.roughness)
    return replace(dive, radiometry=replace(dive.radiometry, seafloor=believed))


def calibrate_on_passes(recording: Recording, windows: list[Window], bottom: Bottom) -> Radiometry:
    """From the passes themselves: what they all have in common goes into the beam pattern."""
    return calibrate(recording, windows, bottom, RadiometryConfig(), JointConfig())


def calibrate_on_mission(recording: Recording, windows: list[Window], bottom: Bottom) -> Radiometry:  # noqa: ARG001
    """From another part of the mission: the same sonar over a floor that is no case of the experiment."""
    return _mission_radiometry(float(recording.slant_range_max.max()))


@cache
def _mission_radiometry(reach: float) -> Radiometry:
    scene = {
        "seed": _MISSION_SEED,
        "terrain": {"size": [400.0, 400.0], "layers": fractal(0.6)(_MISSION_SEED)},
        "survey": {"length": 220.0, "spacing": 40.0, "n_legs": 4, "n_ties": 1},
        "sonar": {"range_max": reach, "ping_rate": _PING_RATE},
        "drift": {"grade": "none", "altimeter_noise": 0.05},
    }
    recording = simulate(Scene.model_validate(scene))
    windows = sliding_windows(recording.trajectory_dr, reach)
    return calibrate_on_passes(recording, windows, find_bottom(recording, BottomConfig()))


Calibration = Callable[[Recording, list[Window], Bottom], Radiometry]
CALIBRATIONS: dict[str, Calibration] = {"mission": calibrate_on_mission, "passes": calibrate_on_passes}


def windows_of(trajectory: Trajectory, legs: list[Leg]) -> list[Window]:
    """The pings of each pass, from the one nearest to its start to the one nearest to its end."""
    windows: list[Window] = []
    first = 0
    for number, leg in enumerate(legs):
        first = first + _nearest(trajectory, leg[:2], first)
        end = first + _nearest(trajectory, leg[2:], first) + 1
        windows.append(Window(number, first, end, (first + end) // 2))
        first = end
    return windows


def _nearest(trajectory: Trajectory, place: tuple[float, ...], first: int) -> int:
    return int(np.argmin(np.hypot(trajectory.x[first:] - place[0], trajectory.y[first:] - place[1])))


def _woven(leg: Leg, radius: float) -> list[Leg]:
    """A pass as short stretches to the left and right of it; arcs of the radius join them."""
    start, end = np.array(leg[:2]), np.array(leg[2:])
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    left = np.array([-along[1], along[0]])
    angle, stretch = np.radians(18.0), 10.0
    step = stretch * np.cos(angle) + 2 * radius * np.sin(angle)
    n = max(2, int((length + 2 * radius * np.sin(angle)) / step))
    offset, rise = 0.5 * (length - n * step + 2 * radius * np.sin(angle)), 0.5 * stretch * np.sin(angle)
    pieces: list[FloatArray] = []
    for k in range(n):
        sign, begin = (-1) ** k, start + (offset + k * step) * along
        middle, half = begin + 0.5 * stretch * np.cos(angle) * along, 0.5 * stretch * np.cos(angle) * along
        pieces.append(np.concatenate([middle - half - sign * rise * left, middle + half + sign * rise * left]))
    return [(float(p[0]), float(p[1]), float(p[2]), float(p[3])) for p in pieces]
