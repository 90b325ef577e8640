"""Real recordings, where they are at hand."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

DATA = os.environ.get("SSSSLAM_DATA")
pytestmark = pytest.mark.skipif(DATA is None, reason="SSSSLAM_DATA is not set: real recordings are not at hand")


def sssslam(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from sssslam.cli import main; main()", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def wreck() -> Path:
    return Path(DATA or "") / "recordings" / "scotsman-iver2.xtf"


@pytest.fixture(scope="module")
def out(wreck, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("scotsman")
    done = sssslam("run", wreck, "-o", folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_a_straight_dive_has_no_closure_and_keeps_its_track(out):
    assert len((out / "loop_closures.csv").read_text().splitlines()) == 1
    assert (out / "trajectory.tum").read_bytes() == (out / "trajectory_dr.tum").read_bytes()


def test_the_wreck_stands_up_from_the_seafloor(out):
    import rasterio

    with rasterio.open(out / "seafloor.tif") as grid:
        z = grid.read(1, masked=True)
    # depth was 23 m and altitude 3 m where the vehicle had come down: the floor lies near 26 m
    assert -30 < float(np.ma.median(z)) < -22
    # the hull is metres high; a speckled flat floor would stay within a few decimetres, a divergence would not
    assert 0.6 < float(np.percentile(z.compressed(), 99.5) - np.percentile(z.compressed(), 0.5)) < 8


def test_a_file_without_side_scan_is_refused_in_one_line(tmp_path, wreck):
    done = sssslam("run", wreck.with_name("r2sonic-no-sidescan.xtf"), "-o", tmp_path / "out")
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "side-scan" in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_cut_file_gives_its_whole_pings_or_one_line(tmp_path, wreck):
    content = wreck.read_bytes()
    for k, cut in enumerate(np.random.default_rng(0).integers(0, len(content), 4)):
        path = tmp_path / f"cut{k}.xtf"
        path.write_bytes(content[:cut])
        done = sssslam("info", path)
        assert (done.returncode, bool(done.stderr)) in ((0, False), (1, True)), done.stderr
        assert "Traceback" not in done.stderr
        assert len(done.stderr.splitlines()) <= 1


def test_a_dead_reckoned_dive_is_judged_by_its_recorded_positions(tmp_path, wreck):
    out = tmp_path / "out"
    done = sssslam("run", wreck, "-o", out, "--navigation", "dead-reckoned")
    assert done.returncode == 0, done.stderr
    assert "positions are rebuilt from heading and speed" in done.stdout
    assert "! the nose points 20 deg down in the middle of all pings: " in done.stdout
    ate = next(line for line in done.stdout.splitlines() if line.startswith("ate_dr"))
    # a magnetic heading turns the whole track, which ATE does not see; held speed and jitter of fixes are left of 55 m
    assert 0.1 < float(ate.split()[1]) < 2.0
    assert (out / "trajectory_ref.tum").read_bytes() != (out / "trajectory_dr.tum").read_bytes()
    again = sssslam("evaluate", out, "--reference", out / "trajectory_ref.tum")
    assert again.returncode == 0, again.stderr
    assert next(line for line in again.stdout.splitlines() if line.startswith("ate_dr")) == ate


def test_a_file_of_navigation_may_come_from_a_run_of_the_same_dive(tmp_path, wreck, out):
    joined = tmp_path / "joined.nc"
    done = sssslam("convert", wreck, joined, "--nav", out / "trajectory.tum")
    assert done.returncode == 0, done.stderr
    assert "100.0% of 460 pings covered" in done.stdout
    assert "positions are 0 m from those recorded" in done.stdout or "e-07 m from those" in done.stdout
