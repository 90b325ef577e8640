"""Floors, surveys and equipment of the navigation experiment."""

from typing import Any

import numpy as np

from backend.drift_model import DeadReckoningConfig
from backend.sensor_errors import SensorErrorsConfig
from sssslam.simulation import Scene, load_scene
from sssslam.simulation.drift import DriftConfig

# A floor is that of a shipped scene, with room for every survey; sand waves are for reporting only.
TERRAINS = {"rough": "demo", "reef": "reef", "sand-waves": "sand-waves", "mud": "mud"}
PATTERNS: dict[str, dict[str, Any]] = {
    "lawnmower": {"pattern": "lawnmower", "length": 200.0, "spacing": 40.0, "n_legs": 4, "n_ties": 2},
    "star": {"pattern": "star", "length": 200.0, "n_legs": 4},
    "eight": {"pattern": "figure-of-eight", "radius": 45.0, "n_rounds": 3},
}
GRADES = ("navigation", "tactical", "mems")
_SIZE = (400.0, 400.0)
_PING_RATE = 5.0
_RANGE = 50.0


def make_scene(terrain: str, pattern: str, grade: str, seed: int) -> Scene:
    """A floor, a survey over it and the equipment, with all randomness from one seed."""
    shipped = load_scene(TERRAINS[terrain])
    sonar = shipped.sonar.model_copy(update={"range_max": _RANGE, "ping_rate": _PING_RATE})
    return Scene.model_validate(
        {
            "name": f"{terrain}-{pattern}-{grade}",
            "seed": seed,
            "terrain": {**shipped.terrain.model_dump(), "size": _SIZE},
            "seabed": shipped.seabed.model_dump(),
            "survey": PATTERNS[pattern],
            "sonar": sonar.model_dump(),
            "speckle": shipped.speckle.model_dump(),
            "drift": {"grade": grade},
        }
    )


def data_sheet(drift: DriftConfig, source: str) -> DeadReckoningConfig:
    """What the maker of the simulated equipment would state."""
    sensors = SensorErrorsConfig(
        gyro_bias_sd=np.radians(drift.gyro_bias_deg) / 3600.0,
        gyro_noise=np.radians(drift.gyro_noise_deg) / 60.0,
        accelerometer_bias_sd=drift.accelerometer_bias,
        accelerometer_noise=drift.accelerometer_noise,
        compass_noise=2e-4,
        depth_noise=drift.depth_noise,
    )
    return DeadReckoningConfig.model_validate(
        {
            "source": source,
            "heading_bias_sd": np.radians(drift.heading_bias_deg),
            "heading_walk": np.radians(drift.heading_walk_deg) / 60.0,
            "heading_deviation_sd": np.radians(drift.heading_deviation_deg),
            "velocity_scale_sd": drift.velocity_scale,
            "velocity_misalignment_sd": np.radians(drift.misalignment_deg),
            "velocity_noise": drift.velocity_noise,
            "depth_sd": float(np.hypot(drift.depth_bias, drift.depth_noise)),
            "tilt_sd": np.radians(drift.attitude_noise_deg),
            "sensors": sensors,
        }
    )
