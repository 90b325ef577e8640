"""The command line as a person or a script meets it: help, status, one line of error, no traceback."""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sssslam
from sssslam.cli import main
from sssslam.config import load_config
from sssslam.readers import read
from sssslam.readers.netcdf import write_netcdf
from tests.frontend.flat_floor import FlatFloor

COMMANDS = ["demo", "run", "simulate", "reconstruct", "evaluate", "info", "convert", "view", "config"]
Shell = Callable[..., tuple[int, str, str]]


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Shell:
    """Runs a command in an empty folder; gives status, output and errors."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["sssslam", *map(str, arguments)])
        status: object = 0
        try:
            main()
        except SystemExit as stop:
            status = stop.code
        captured = capsys.readouterr()
        return int(str(status or 0)), captured.out, captured.err

    return call


def is_one_line(errors: str) -> bool:
    return errors.startswith("sssslam: ") and errors.count("\n") == 1 and "Traceback" not in errors


@pytest.fixture
def dive(tmp_path: Path) -> Path:
    """A short recording in the open container."""
    path = tmp_path / "dive.nc"
    write_netcdf(FlatFloor(np.full(20, 12.0)).record(np.random.default_rng(1)), path)
    return path


@pytest.mark.parametrize("command", COMMANDS)
def test_help_opens_with_examples_of_the_command(shell: Shell, command: str) -> None:
    status, output, _ = shell(command, "--help")
    assert status == 0
    usage, _, rest = output.strip().partition("\n\n")
    assert f"sssslam {command}" in usage
    lines = [line.strip() for line in rest.splitlines() if line.strip()]
    assert lines[0] == "Examples:"
    assert lines[1].startswith(f"sssslam {command}")


def test_help_names_every_command(shell: Shell) -> None:
    status, output, _ = shell("--help")
    assert status == 0
    assert all(f"\n  {command} " in output for command in COMMANDS)


def test_the_version_is_that_of_the_package(shell: Shell) -> None:
    assert shell("--version") == (0, f"sssslam {sssslam.__version__}\n", "")


@pytest.mark.parametrize(
    "arguments",
    [
        ["walk"],
        ["run"],
        ["run", "dive.xtf"],
        ["run", "dive.xtf", "-o", "out", "--colour", "red"],
        ["simulate"],
        ["simulate", "demo"],
        ["simulate", "demo", "-o", "x.nc", "--seed", "-1"],
        ["evaluate", "out"],
        ["convert", "dive.xtf"],
        ["demo", "--seed", "many"],
        ["info"],
        ["view"],
        ["view", "out", "--colour", "red"],
    ],
    ids=" ".join,
)
def test_wrong_usage_is_status_two(shell: Shell, arguments: list[str]) -> None:
    status, output, errors = shell(*arguments)
    assert status == 2
    assert output == ""
    assert "Error" in errors
    assert "Traceback" not in errors


def broken(kind: str, folder: Path) -> Path:
    """A recording that is none."""
    path = folder / "dive.xtf"
    if kind == "folder":
        path.mkdir()
    elif kind == "empty":
        path.touch()
    elif kind == "text":
        path.write_text("This is no sonar.\n" * 100)
    elif kind == "zeros":
        path.write_bytes(bytes(5000))
    return path


@pytest.mark.parametrize("kind", ["missing", "folder", "empty", "text", "zeros"])
@pytest.mark.parametrize("command", ["info", "run", "reconstruct", "convert"])
def test_a_file_that_is_no_recording_is_one_line_and_status_one(
    shell: Shell, tmp_path: Path, kind: str, command: str
) -> None:
    target = {"info": [], "run": ["-o", "out"], "reconstruct": ["-o", "out"], "convert": ["out.nc"]}[command]
    status, output, errors = shell(command, broken(kind, tmp_path), *target)
    assert (status, output) == (1, "")
    assert is_one_line(errors)
    assert "dive.xtf" in errors
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "out.nc").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-s", "windows.lenght=80"], "no key windows.lenght; did you mean length?"),
        (["-s", "windows.length"], "a setting reads section.key=value"),
        (["--config", "my.toml"], "my.toml is not there; a TOML file is wanted"),
        (["-o", "dive.nc"], "dive.nc is a file; a folder for the products is wanted"),
        (["-o", "dive.nc/out"], "a folder that can is wanted"),
    ],
)
def test_a_wrong_option_is_refused_before_the_work(shell: Shell, dive: Path, options: list[str], message: str) -> None:
    status, output, errors = shell("run", dive, "-o", "out", *options)
    assert (status, output) == (1, "")
    assert is_one_line(errors)
    assert message in errors


def test_a_run_of_a_single_ping_says_what_is_wrong_with_it(shell: Shell, dive: Path) -> None:
    write_netcdf(read(dive)[:1], dive)
    status, output, errors = shell("run", dive, "-o", "out")
    assert (status, errors) == (0, "")
    assert "! there is one ping only: a window of many pings is wanted\n" in output
    assert "<strong>there is one ping only</strong>" in Path("out/report.html").read_text()


def test_an_unknown_scene_is_refused_with_the_known_ones(shell: Shell) -> None:
    status, _, errors = shell("simulate", "moon", "-o", "moon.nc")
    assert status == 1
    assert is_one_line(errors)
    assert "demo" in errors


def test_a_simulation_needs_a_name_of_a_known_format(shell: Shell) -> None:
    status, _, errors = shell("simulate", "demo", "-o", "demo.wav")
    assert status == 1
    assert "a name that ends in .nc or .xtf is wanted" in errors


def test_the_scenes_are_listed_a_line_each(shell: Shell) -> None:
    status, output, _ = shell("simulate", "--list")
    assert status == 0
    assert [line.split()[0] for line in output.splitlines()] == sssslam.simulation.scene_names()  # type: ignore[attr-defined]


@pytest.mark.parametrize("option", [["--terrain"], ["--reference"]])
def test_evaluating_against_a_pipe_that_never_ends_is_refused_at_once(
    shell: Shell, tmp_path: Path, option: list[str]
) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "out").mkdir()
    (tmp_path / "ref.tum").write_text("0 0 0 0 0 0 0 1\n")
    (tmp_path / "out" / "run.json").write_text("{}")
    reference = [] if option == ["--reference"] else ["--reference", "ref.tum"]
    status, _, errors = shell("evaluate", "out", *reference, *option, "pipe")
    assert status == 1
    assert is_one_line(errors)


def test_decisions_from_a_pipe_are_refused_at_once(shell: Shell, dive: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    status, _, errors = shell("run", dive, "-o", "out", "--closures", "pipe")
    assert status == 1
    assert is_one_line(errors)
    assert "no regular file; a table target,source,decision is wanted" in errors


@pytest.mark.parametrize("reference", ["missing.tum", "text.tum", "folder"])
def test_evaluating_nothing_is_one_line(shell: Shell, tmp_path: Path, reference: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "text.tum").write_text("no numbers here\n")
    status, _, errors = shell("evaluate", "folder", "--reference", reference)
    assert status == 1
    assert is_one_line(errors)


def test_a_container_without_truth_is_no_reference(shell: Shell, dive: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    status, _, errors = shell("evaluate", "out", "--reference", dive)
    assert status == 1
    assert "holds no truth; a simulated recording or a TUM file is wanted" in errors


def test_info_says_what_is_in_a_recording(shell: Shell, dive: Path) -> None:
    status, output, errors = shell("info", dive)
    assert (status, errors) == (0, "")
    assert "20 of 900 samples a side" in output
    assert "! roll is 0 in every ping" in output


def test_converting_gives_the_same_recording(shell: Shell, dive: Path, tmp_path: Path) -> None:
    status, output, _ = shell("convert", dive, "again.nc")
    assert status == 0
    assert "20 pings of 900 samples a side" in output
    one, other = read(dive), read(tmp_path / "again.nc")
    np.testing.assert_array_equal(one.port, other.port)
    np.testing.assert_array_equal(one.ping_time, other.ping_time)


def test_the_printed_configuration_is_the_default(shell: Shell, tmp_path: Path) -> None:
    status, output, _ = shell("config")
    assert status == 0
    (tmp_path / "my.toml").write_text(output)
    assert load_config(tmp_path / "my.toml") == load_config()


def test_an_interrupt_is_said_in_a_line(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("sssslam.commands.show_config", interrupted)
    status, _, errors = shell("config")
    assert status in (1, 130)
    assert "Traceback" not in errors


def test_a_fault_of_the_program_can_be_traced(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSSSLAM_DEBUG", "1")
    with pytest.raises(ValueError, match=r"nowhere\.xtf"):
        shell("info", "nowhere.xtf")


def test_all_passes_together_by_a_method_of_single_passes_is_refused(shell: Shell, dive: Path) -> None:
    status, _, errors = shell("reconstruct", dive, "-o", "out", "--method", "coiras", "--together")
    assert (status, errors.count("\n")) == (1, 1)
    assert "joint is wanted" in errors
    assert not Path("out").exists()


def test_an_unknown_method_of_reconstruction_is_refused(shell: Shell, dive: Path) -> None:
    status, _, errors = shell("reconstruct", dive, "-o", "out", "--method", "guess")
    assert status == 1
    assert is_one_line(errors)
    assert "reconstruction.method" in errors
    assert "'guess'" in errors


def sssslam_process(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    code = "from sssslam.cli import main; main()"
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_a_process_of_its_own_ends_with_one_line_and_status_one(tmp_path: Path) -> None:
    done = sssslam_process("info", "dive.xtf", folder=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert is_one_line(done.stderr)


def test_nothing_is_drawn_into_a_pipe(tmp_path: Path, dive: Path) -> None:
    done = sssslam_process(
        "reconstruct", str(dive), "-o", "out", "-s", "reconstruction.joint.n_levels=1", folder=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.strip() == ""
    assert "\x1b" not in done.stdout
    assert "1 submaps in out/submaps" in done.stdout
    assert (tmp_path / "out" / "submaps" / "0000.ply").is_file()


@pytest.fixture
def track(tmp_path: Path) -> Path:
    """Navigation of the dive, one row a second, on the clock of the sonar."""
    path = tmp_path / "track.csv"
    rows = [f"{t},{2.0 * t},{0.5 * t},{90 - 14.036},1.5" for t in range(6)]
    path.write_text("\n".join(["time,x,y,heading,speed", *rows]) + "\n")
    return path


def test_navigation_beside_the_sonar_is_joined_and_reported(shell: Shell, dive: Path, track: Path) -> None:
    status, output, _ = shell("convert", dive, "joined.nc", "--nav", track)
    assert status == 0
    assert "track.csv: position, speed, yaw taken at up to 1 Hz, clock offset +0.000 s, 100.0% of 20 pings" in output
    recording = read("joined.nc")
    np.testing.assert_allclose(recording.trajectory_dr.y, 0.5 * recording.ping_time, atol=1e-9)
    status, output, _ = shell("info", dive, "--nav", track, "--clock-offset", "0.5")
    assert "clock offset +0.500 s" in output


def test_dead_reckoned_positions_keep_the_recorded_ones_as_truth(shell: Shell, dive: Path, track: Path) -> None:
    status, output, _ = shell("convert", dive, "dr.nc", "--nav", track, "--navigation", "dead-reckoned")
    assert status == 0
    assert "positions are rebuilt from heading and speed" in output
    recording = read("dr.nc")
    np.testing.assert_allclose(recording.truth.trajectory.x, 2.0 * recording.ping_time, atol=1e-9)
    assert recording.trajectory_dr.distance[-1] == pytest.approx(1.5 * recording.ping_time[-1], rel=1e-6)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--nav", "nowhere.csv"], "nowhere.csv: there is no such file"),
        (["--clock-offset", "3"], "without --nav"),
        (["--nav", "track.csv", "--clock-offset", "soon"], "seconds or 'estimate' is wanted"),
        (["--nav", "track.csv", "--clock-offset", "9999"], "track.csv: covers no ping"),
        (["--nav", "dive.nc"], "this is no text"),
        (["--navigation", "dead-reckoned"], "has no speed"),
    ],
)
@pytest.mark.parametrize("command", ["run", "info", "convert", "reconstruct"])
@pytest.mark.usefixtures("track")
def test_navigation_that_cannot_be_used_is_one_line(
    shell: Shell, dive: Path, command: str, options: list[str], words: str
) -> None:
    target = {"run": ["-o", "out"], "reconstruct": ["-o", "out"], "convert": ["x.nc"], "info": []}[command]
    status, _, errors = shell(command, dive, *target, *options)
    assert status == 1
    assert is_one_line(errors)
    assert words in errors


@pytest.mark.parametrize("command", ["run", "reconstruct"])
def test_a_vehicle_that_never_moves_is_one_line_that_names_the_way_out(
    shell: Shell, tmp_path: Path, command: str
) -> None:
    recording = FlatFloor(np.full(20, 12.0)).record(np.random.default_rng(1))
    still = replace(recording.trajectory_dr, x=np.zeros(20))
    write_netcdf(replace(recording, trajectory_dr=still), tmp_path / "still.nc")
    status, _, errors = shell(command, "still.nc", "-o", "out")
    assert status == 1
    assert is_one_line(errors)
    assert "in all 20 pings; --nav FILE, or --navigation dead-reckoned" in errors
    assert shell("info", "still.nc")[0] == 0


def test_info_draws_a_waterfall_only_where_it_is_asked_to(shell: Shell, dive: Path, tmp_path: Path) -> None:
    before = set(tmp_path.iterdir())
    assert shell("info", dive)[0] == 0
    assert set(tmp_path.iterdir()) == before
    status, output, _ = shell("info", dive, "--figure", "pictures/[a].png")
    assert status == 0
    assert "waterfall: pictures/[a].png" in output
    assert (tmp_path / "pictures" / "[a].png").read_bytes()[:4] == b"\x89PNG"
    assert is_one_line(shell("info", dive, "--figure", "waterfall.txt")[2])


def test_too_little_memory_is_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def fill(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("sssslam.dive.read", fill)
    status, _, errors = shell("info", "dive.xtf")
    assert status == 1
    assert is_one_line(errors)
    assert "too little memory" in errors


def test_the_program_is_called_sssslam_however_it_is_started(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["/opt/other/name.py", "--help"])
    with pytest.raises(SystemExit):
        main()
    assert capsys.readouterr().out.split()[:2] == ["Usage:", "sssslam"]
