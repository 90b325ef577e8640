"""End to end: terrains x surveys x equipment x seeds, one JSON a run; a run that is there is not made again."""

import argparse
import itertools
import json
import subprocess
import time
from pathlib import Path

import numpy as np
from report import tables
from scenes import GRADES, PATTERNS, TERRAINS, data_sheet, make_scene
from variants import Variant, variants

import sssslam
from frontend.trajectory import Trajectory
from sssslam.config import Config, resolve
from sssslam.dead_reckoning import dead_reckon
from sssslam.evaluation.legs import rpe_legs
from sssslam.evaluation.loop_closures import evaluate_loop_closures
from sssslam.evaluation.metric import Metric
from sssslam.evaluation.trajectory import evaluate_tracks, track_coverage, track_nees

Row = dict[str, float]


def make_run(terrain: str, pattern: str, grade: str, seed: int, source: str) -> dict[str, object]:
    """Simulate, run, and judge every variant."""
    scene = make_scene(terrain, pattern, grade, seed)
    start = time.perf_counter()
    recording = sssslam.simulate(scene)
    simulated = time.perf_counter()
    result = sssslam.slam(recording, Config(dead_reckoning=data_sheet(scene.drift, source)))
    finished = time.perf_counter()
    config = resolve(Config(dead_reckoning=data_sheet(scene.drift, source)), recording)
    truth = recording.truth.trajectory
    _, dead_reckoning = dead_reckon(recording, config.dead_reckoning)
    times = {submap.number: submap.anchor_time for submap in result.submaps}
    tracks = variants(result, dead_reckoning, config, seed)
    dead_reckoned = tracks["dead reckoning"].trajectory
    rows = {name: judge(variant, dead_reckoned, truth, times) for name, variant in tracks.items()}
    return {
        "terrain": terrain,
        "pattern": pattern,
        "grade": grade,
        "seed": seed,
        "source": source,
        "commit": commit(),
        "n_pings": recording.n_pings,
        "distance": float(truth.distance[-1]),
        "n_submaps": len(result.submaps),
        "simulate_seconds": simulated - start,
        "slam_seconds": finished - simulated,
        "variants": rows,
    }


def judge(variant: Variant, dead_reckoned: Trajectory, truth: Trajectory, times: dict[int, float]) -> Row:
    """All figures of one track."""
    metrics: list[Metric] = evaluate_tracks(variant.trajectory, dead_reckoned, truth)
    metrics += rpe_legs(variant.trajectory, truth)
    metrics += [f(variant.trajectory, variant.sigmas, truth) for f in (track_nees, track_coverage)]
    metrics += evaluate_loop_closures(variant.closures, times, truth)
    row = {metric.name: metric.value for metric in metrics}
    return row | {"ate_by_evo": ate_by_evo(variant.trajectory, truth)}


def ate_by_evo(trajectory: Trajectory, truth: Trajectory) -> float:
    """The same horizontal, aligned error by an independent judge; NaN where evo is not installed."""
    try:
        from evo.core import metrics
        from evo.core.trajectory import Plane, PosePath3D
    except ImportError:
        return float("nan")
    ours, ref = (PosePath3D(poses_se3=list(track.poses)) for track in (trajectory, truth))
    for path in (ours, ref):
        path.project(Plane.XY)
    ours.align(ref)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((ref, ours))
    return float(ape.get_statistic(metrics.StatisticsType.rmse))


def commit() -> str:
    """The commit this runs on, where there is one."""
    asked = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    return asked.stdout.strip() or "unknown"


def main() -> None:
    """Make the runs that are not there, then print the tables of all that are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--terrains", nargs="+", choices=list(TERRAINS), default=list(TERRAINS))
    parser.add_argument("--patterns", nargs="+", choices=list(PATTERNS), default=list(PATTERNS))
    parser.add_argument("--grades", nargs="+", choices=GRADES, default=list(GRADES))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3, 4, 5])
    parser.add_argument("--source", choices=["recorded", "sensors"], default="recorded")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "out")
    parser.add_argument("--report", action="store_true", help="only print the tables of what is there")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    wanted = itertools.product(arguments.terrains, arguments.patterns, arguments.grades, arguments.seeds)
    for run in [] if arguments.report else wanted:
        file = arguments.out / f"{'-'.join(map(str, run))}-{arguments.source}.json"
        if not file.exists():
            made = make_run(*run, arguments.source)
            partial = file.with_suffix(".part")
            partial.write_text(json.dumps(made, indent=1, allow_nan=True))
            partial.replace(file)
            ratio = made["variants"]["ours"]["ate"] / max(made["variants"]["ours"]["ate_dr"], np.finfo(float).tiny)
            print(f"{file.stem}: ATE {ratio:.2f} of dead reckoning, {made['slam_seconds']:.0f} s", flush=True)
    print(tables([json.loads(file.read_text()) for file in sorted(arguments.out.glob("*.json"))]))


if __name__ == "__main__":
    main()
