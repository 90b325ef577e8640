"""A small survey from simulation to report, and what must be true of any run."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sssslam
from sssslam.evaluation.run import evaluate_run
from sssslam.products.run import read_run
from sssslam.simulation import Scene

SCENE = Scene.model_validate(
    {
        "seed": 5,
        "terrain": {
            "size": [260.0, 240.0],
            "depth": 60.0,
            "layers": [
                {"kind": "fractal", "rms": 0.8, "longest": 120.0},
                {"kind": "sediment", "rms": 0.2},
                {"kind": "objects", "count": 260},
            ],
        },
        "survey": {
            "pattern": "legs",
            "legs": [
                [-50.0, -15.0, 50.0, -15.0],
                [50.0, 15.0, -50.0, 15.0],
                [-15.0, 50.0, -15.0, -50.0],
                [15.0, -50.0, 15.0, 50.0],
            ],
        },
        "drift": {"grade": "mems"},
        "sonar": {"range_max": 50.0},
    }
)


@pytest.fixture(scope="module")
def recording():
    return sssslam.simulate(SCENE)


@pytest.fixture(scope="module")
def result(recording):
    return sssslam.slam(recording)


@pytest.fixture(scope="module")
def out(result, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    result.write(folder)
    return folder


def digests(folder: Path) -> dict[str, str]:
    """Of every product, wall times left out."""
    found = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        content = path.read_bytes()
        if path.name == "run.json":
            manifest = json.loads(content)
            manifest.pop("timings")
            content = json.dumps(manifest).encode()
        if path.name == "report.html":
            before, _, rest = content.partition(b"<!-- timings -->")
            content = before + rest.partition(b"<!-- /timings -->")[2]
        found[str(path.relative_to(folder))] = hashlib.sha256(content).hexdigest()
    return found


def test_the_track_comes_back_closer_to_the_truth(out, recording):
    metrics = {metric.name: metric.value for metric in evaluate_run(read_run(out), recording.truth)}
    assert metrics["closures_false"] == 0
    assert metrics["closures_true"] >= 2
    assert metrics["ate"] < 0.7 * metrics["ate_dr"]


def test_every_ping_keeps_its_time_and_its_measured_depth(result, recording):
    np.testing.assert_array_equal(result.trajectory.time, recording.ping_time)
    # an anchor's depth may move within the depth sensor's noise
    assert np.abs(result.trajectory.z - recording.trajectory_dr.z).max() < 0.5


def test_every_product_of_the_contract_is_there(out):
    wanted = {
        *("trajectory.tum", "trajectory_dr.tum", "trajectory.csv", "loop_closures.csv", "graph.g2o"),
        *("submaps/0000.ply", "seafloor.tif", "mosaic.tif", "report.html", "config.toml", "run.json"),
    }
    assert wanted <= set(digests(out))
    header = "target,source,t_target,t_source,x,y,yaw,sigma_x,sigma_y,sigma_yaw,n_matches,n_inliers,correlation,overlap"
    assert (out / "loop_closures.csv").read_text().splitlines()[0] == f"{header},accepted,reason"


def test_a_second_run_on_one_thread_writes_the_same_bytes(out, tmp_path):
    script = (
        "import sys, sssslam\n"
        "from pathlib import Path\n"
        "from sssslam.simulation import Scene\n"
        "scene = Scene.model_validate_json(Path(sys.argv[1]).read_text())\n"
        "sssslam.slam(sssslam.simulate(scene)).write(sys.argv[2])\n"
    )
    (tmp_path / "scene.json").write_text(SCENE.model_dump_json())
    command = [sys.executable, "-c", script, str(tmp_path / "scene.json"), str(tmp_path / "again")]
    subprocess.run(command, check=True, env={**os.environ, "NUMBA_NUM_THREADS": "1"})
    assert digests(tmp_path / "again") == digests(out)


def test_resolved_config_of_a_run_gives_the_same_run(out, result):
    assert sssslam.load_config(out / "config.toml").model_dump(mode="json") == result.config


def test_pings_as_they_come_correct_the_track_as_well(recording):
    live = sssslam.Slam()
    for first in range(0, recording.n_pings, 250):
        live.add(recording[first : first + 250])
        assert len(live.trajectory) == min(first + 250, recording.n_pings)
    assert not [c for c in live.loop_closures if c.accepted and not _is_true(c, live, recording)]
    moved = np.abs(live.trajectory.positions - recording.trajectory_dr.positions).max()
    assert moved > 0.5 or not any(closure.accepted for closure in live.loop_closures)
    assert live.n_pings_kept < recording.n_pings / 2


def _is_true(closure, live, recording) -> bool:
    from frontend.frames import invert, level, planar_parameters

    target, source = (live.submaps[k].anchor_ping for k in (closure.target, closure.source))
    T = level(recording.truth.trajectory.poses[[target, source]])
    x, y, yaw = planar_parameters(invert(invert(T[0]) @ T[1]) @ closure.T_target_source)
    return bool(np.hypot(x, y) < 3 and abs(np.degrees(yaw)) < 5)


def test_parts_work_alone(recording):
    submap = sssslam.reconstruct(recording[50:200])
    features = sssslam.describe(submap)
    assert features.descriptors.shape[1] == 33
    assert len(features) > 10
