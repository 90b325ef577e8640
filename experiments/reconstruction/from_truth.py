"""Is it the solver or the belief that ends it? `joint` as it is, run on, and run on from the true heights."""

import argparse
from typing import NamedTuple

import numpy as np
from fusion import Target, fuse, target
from metrics import as_row, columns
from scenes import CALIBRATIONS, FLOORS, MOTIONS, Dive, make_dive
from scipy.ndimage import gaussian_filter

from frontend.arrays import FloatArray
from frontend.frames import transform
from frontend.heightfield import Heightfield
from frontend.reconstruction.forward import Raster, coverage
from frontend.reconstruction.joint import JointConfig, coarse_to_fine, descend
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.roughness import believing, learn_roughness
from frontend.reconstruction.shadow_ends import find_shadow_ends
from frontend.reconstruction.solver import SolverConfig, minimise
from frontend.reconstruction.unknowns import Unknowns
from frontend.reconstruction.window_data import WindowData, window_data
from frontend.submaps import Submap

ON_AND_ON = SolverConfig(n_steps=8, doubt=1e9, improvement=1e-9)  # no line kept aside ends it
SMOOTH = 3.0  # cells over which the true heights count as relief; what is left of them stands on it


class Case(NamedTuple):
    """A dive of one pass with its truth, and its only window."""

    dive: Dive
    wanted: Target
    data: WindowData


def true_heights(case: Case, raster: Raster) -> FloatArray:
    """In the submap's frame; NaN where no ping sees the floor."""
    x, y = (o + raster.spacing * np.arange(n) for o, n in zip(raster.origin, raster.shape[::-1], strict=True))
    points = np.stack([*np.meshgrid(x, y), np.zeros(raster.shape)], axis=-1)
    world = transform(case.data.T_world_submap, points)
    return case.wanted.surface.sample(world[..., 0], world[..., 1]) - case.data.T_world_submap[2, 3]


def at_truth(case: Case, posterior: Posterior, x: Unknowns) -> Unknowns:
    """The same unknowns with the true heights where they are known, but for their mean."""
    z = posterior.height(x)
    missing = true_heights(case, posterior.raster) - z
    passed, _ = coverage(z, posterior.raster, posterior.beams, case.data.slant_range_max)
    known = passed & np.isfinite(missing)
    missing = np.where(known, missing - missing[known].mean(), 0.0)
    smooth = gaussian_filter(missing, SMOOTH)
    return Unknowns(x.background + smooth, x.objects + missing - smooth, x.log_reflectivity, x.beam, x.gain)


def row(case: Case, what: str, posterior: Posterior, x: Unknowns) -> str:
    """Cost and errors of a state."""
    z, window, data = posterior.height(x), case.dive.windows[0], case.data
    passed, seen = coverage(z, posterior.raster, posterior.beams, data.slant_range_max)
    z, sigma = (np.where(passed, values, np.nan) for values in (z, np.full(z.shape, 0.1)))
    span = (window.number, window.first_ping, window.end_ping, window.anchor_ping)
    time = float(case.dive.recording.ping_time[window.anchor_ping])
    surface = Heightfield(z, posterior.raster.spacing, posterior.raster.origin)
    submap = Submap(
        *span, time, data.T_world_submap, data.T_submap_body, surface, sigma, x.log_reflectivity, passed & ~seen
    )
    truth = case.dive.recording.truth
    assert truth is not None
    found = as_row(columns(fuse([submap], truth.trajectory, case.wanted.surface), case.wanted, 12.0))
    errors = " | ".join(f"{found[k]:.3f}" for k in ("rmse_without_plane", "correlation_20m", "correlation_10m"))
    return f"| {what} | {posterior.cost(x, posterior.predict(x)):.0f} | {errors} |"


def compare(case: Case, config: JointConfig) -> list[str]:
    """Rows of one case."""
    posteriors = coarse_to_fine(case.data, case.dive.radiometry, config)
    roughness = learn_roughness(posteriors[-2:][0], config.roughness, config.solver)
    ends = find_shadow_ends(posteriors[-1], config.shadow_ends)
    posterior, solution = descend([believing(p, roughness) for p in posteriors], config.solver, ends=ends)[-1]
    true = at_truth(case, posterior, solution.x)
    return [
        row(case, "as it ends", posterior, solution.x),
        row(case, "run on", posterior, minimise(posterior, solution.x, ON_AND_ON).x),
        row(case, "true heights", posterior, true),
        row(case, "run on from there", posterior, minimise(posterior, true, ON_AND_ON).x),
    ]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", choices=FLOORS, default=["fractal-0.8"])
    parser.add_argument("--motion", choices=MOTIONS, default="straight")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2])
    arguments = parser.parse_args()
    print(
        "| scene | seed | state | cost | without plane [m] | corr. 20 m | corr. 10 m |\n|---|---|---|---|---|---|---|"
    )
    for scene in arguments.scenes:
        for seed in arguments.seeds:
            dive = make_dive(scene, arguments.motion, "one", seed, CALIBRATIONS["mission"])
            data = window_data(dive.recording, dive.windows[0], dive.bottom, dive.radiometry)
            for line in compare(Case(dive, target(dive), data), JointConfig()):
                print(f"| {scene} | {seed} {line}", flush=True)


if __name__ == "__main__":
    main()
