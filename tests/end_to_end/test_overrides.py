"""A user's decisions from a table on the disk to the corrected track."""

import sys

import numpy as np
import pytest

import sssslam
from sssslam.cli import main
from sssslam.products.run import read_run
from sssslam.readers.netcdf import write_netcdf
from sssslam.simulation import Scene

SCENE = Scene.model_validate(
    {
        "seed": 5,
        "terrain": {
            "size": [260.0, 200.0],
            "depth": 60.0,
            "layers": [{"kind": "fractal", "rms": 0.8, "longest": 120.0}, {"kind": "objects", "count": 200}],
        },
        "survey": {"pattern": "legs", "legs": [[-50.0, -10.0, 50.0, -10.0], [50.0, 15.0, -50.0, 15.0]]},
        "drift": {"grade": "mems"},
        "sonar": {"range_max": 50.0},
    }
)


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs the command with further options; gives what it left."""
    dive = tmp_path / "dive.nc"
    write_netcdf(sssslam.simulate(SCENE), dive)

    def call(name, *options):
        settings = ["-s", "reconstruction.joint.spacing=1.0", *options]
        monkeypatch.setattr(sys, "argv", list(map(str, ["sssslam", "run", dive, "-o", tmp_path / name, *settings])))
        with pytest.raises(SystemExit) as stop:
            main()
        assert not stop.value.code
        return read_run(tmp_path / name)

    return call


@pytest.mark.slow  # two runs
def test_an_edited_copy_of_the_table_of_a_run_decides(run, tmp_path):
    plain = run("plain")
    assert any(c.accepted for c in plain.loop_closures)
    doubtful = next(c for c in plain.loop_closures if not c.accepted and np.isfinite(c.sigmas[[2, 3, 4]]).all())
    header, *rows = (plain.out / "loop_closures.csv").read_text().splitlines()
    decisions = ["accept" if c is doubtful else "reject" if c.accepted else "" for c in plain.loop_closures]
    table = tmp_path / "decisions.csv"
    table.write_text("\n".join([f"{header},decision", *map(",".join, zip(rows, decisions, strict=True))]))

    ours = run("ours", "--closures", table)
    pairs = zip(plain.loop_closures, ours.loop_closures, strict=True)
    assert {new.reason for old, new in pairs if old.accepted} == {"rejected by the user"}
    (held,) = [c for c in ours.loop_closures if c.accepted]
    assert (held.target, held.source, held.reason) == (doubtful.target, doubtful.source, "")
    assert np.array_equal(held.T_target_source, doubtful.T_target_source)
    assert np.array_equal(held.sigmas, doubtful.sigmas, equal_nan=True)
    assert not np.array_equal(ours.trajectory.poses, ours.trajectory_dr.poses)
    notes = [note for note in ours.manifest["notes"] if note.startswith("Loop closures by the user")]
    name = f"{held.target}-{held.source} (against: {doubtful.reason})"
    assert notes[0] == f"Loop closures by the user accepted: {name}."
    assert notes[1].startswith("Loop closures by the user rejected: ")
    assert notes[0] in (ours.out / "report.html").read_text()


def test_a_table_that_is_none_is_one_line_before_anything_is_read(monkeypatch, capsys, tmp_path):
    table = tmp_path / "decisions.csv"
    table.write_text("target,source,decision\n3,17,maybe\n")
    monkeypatch.setattr(
        sys, "argv", ["sssslam", "run", "no.xtf", "-o", str(tmp_path / "out"), "--closures", str(table)]
    )
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 1
    assert capsys.readouterr().err == (f"sssslam: {table}, row 2: decision is accept, reject or empty, got 'maybe'\n")
