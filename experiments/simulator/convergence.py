"""Halve the terrain step, then the ray step: the image converges. Usage: convergence.py."""

from dataclasses import replace

import numpy as np

from frontend.arrays import FloatArray
from sssslam.simulation import Scene
from sssslam.simulation.absorption import absorption
from sssslam.simulation.planes import Mounting, Rates, beam_planes
from sssslam.simulation.renderer import make_beam, render
from sssslam.simulation.simulator import Dive, prepare
from sssslam.simulation.terrain import Terrain

FINEST = 0.0625
SCENE = {
    "seed": 1,
    "terrain": {
        "size": (100.0, 100.0),
        "spacing": FINEST,
        "layers": [
            {"kind": "fractal", "rms": 0.8, "longest": 100.0, "shortest": 2.0},
            {"kind": "objects", "count": 40, "radius": (1.5, 4.0)},
        ],
    },
    "survey": {"pattern": "legs", "legs": [(-8.0, 0.0, 8.0, 0.0)]},
    "sonar": {"range_max": 45.0, "ping_rate": 5.0, "sample_spacing": 0.1},
}


def decimated(terrain: Terrain, step: int) -> Terrain:
    """Every so many cells of a terrain."""
    heights, reflectivity = terrain.z[::step, ::step].copy(), terrain.reflectivity[::step, ::step].copy()
    return replace(terrain, z=heights, reflectivity=reflectivity, spacing=terrain.spacing * step)


def image(dive: Dive, terrain: Terrain, ray_step: float) -> FloatArray:
    """Mean intensity of the port side."""
    scene = dive.scene
    sonar = scene.sonar.model_copy(update={"ray_step": ray_step})
    loss = float(absorption(sonar.frequency, scene.water))
    beam = make_beam(sonar, scene.receiver, scene.seabed, scene.water.sound_speed, loss)
    rates = Rates(dive.motion.velocity(dive.time), dive.motion.angular_rate(dive.time))
    planes = beam_planes(dive.motion.trajectory(dive.time), rates, Mounting(sonar.lever_arm_port, 1.0))
    return render(terrain, beam, planes, sonar.n_samples)


def main() -> None:
    """Print two tables."""
    dive = prepare(Scene.model_validate(SCENE))
    reference = image(dive, dive.terrain, 0.00625)
    size = np.abs(reference).sum()
    print("| terrain step [m] | image error [%] |\n|---|---|")
    for step in (16, 8, 4, 2):
        error = np.abs(image(dive, decimated(dive.terrain, step), 0.00625) - reference).sum() / size
        print(f"| {step * FINEST:g} | {100 * error:.2f} |")
    print("\n| ray step [m] | image error [%] |\n|---|---|")
    for ray_step in (0.2, 0.1, 0.05, 0.025, 0.0125):
        error = np.abs(image(dive, dive.terrain, ray_step) - reference).sum() / size
        print(f"| {ray_step:g} | {100 * error:.2f} |")


if __name__ == "__main__":
    main()
