"""The demo survey over other floors and other drift: one row a seed."""

import argparse
import platform
import subprocess
import time

import sssslam
from sssslam.evaluation.loop_closures import evaluate_loop_closures
from sssslam.evaluation.trajectory import evaluate_tracks
from sssslam.simulation import load_scene, simulate, with_seed


def row(scene: str, seed: int) -> str:
    """One survey as a line of a markdown table."""
    recording = simulate(with_seed(load_scene(scene), seed))
    start = time.perf_counter()
    result = sssslam.slam(recording)
    seconds = time.perf_counter() - start
    truth = recording.truth.trajectory
    anchor_time = {submap.number: submap.anchor_time for submap in result.submaps}
    metrics = evaluate_tracks(result.trajectory, recording.trajectory_dr, truth)
    metrics += evaluate_loop_closures(result.loop_closures, anchor_time, truth)
    found = {metric.name: metric.value for metric in metrics}
    errors = f"{found['ate_dr']:.2f} | {found['ate']:.2f} | {found['ate'] / found['ate_dr']:.2f}"
    closures = f"{found['closures_true']:.0f} | {found['closures_false']:.0f}"
    return f"| {scene} | {seed} | {errors} | {closures} | {1e3 * seconds / recording.n_pings:.1f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=["demo"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[2, 3, 4])
    arguments = parser.parse_args()
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
    print(f"commit {commit.stdout.strip()}, {platform.machine()}, Python {platform.python_version()}\n")
    print("| scene | seed | ATE dead-reckoned [m] | ATE corrected [m] | ratio | true closures | false | ms a ping |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for scene in arguments.scenes:
        for seed in arguments.seeds:
            print(row(scene, seed), flush=True)


if __name__ == "__main__":
    main()
