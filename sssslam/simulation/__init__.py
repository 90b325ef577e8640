"""Recordings with truth: terrain, vehicle, sonar physics and drift, from a scene file and a seed."""

from sssslam.simulation.scene import Scene, load_scene, scene_names, with_seed
from sssslam.simulation.simulator import simulate, simulate_chunks
from sssslam.simulation.xtf_writer import write_xtf

__all__ = ["Scene", "load_scene", "scene_names", "simulate", "simulate_chunks", "with_seed", "write_xtf"]
