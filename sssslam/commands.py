"""What the commands do: read, run, write, and tell the person at the terminal."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from frontend.recording import Recording, Truth
from sssslam.dive import Dive
from sssslam.places import check_file, check_folder
from sssslam.terminal import Shown, out_console, progress_console

if TYPE_CHECKING:
    from sssslam.config import Config
    from sssslam.overrides import Overrides
    from sssslam.products.result import Result

# What takes seconds to load (the optimiser, compiled kernels, figures) is imported by the command that needs it.


def configuration(path: Path | None, settings: Sequence[str] | None) -> "Config":
    """The configuration that the options ask for.

    Parameters
    ----------
    path : Path or None
        A TOML file.
    settings : sequence of str or None
        ``section.key=value``.

    Returns
    -------
    config : Config
        Checked.
    """
    from sssslam.config import load_config

    return load_config(path, settings or ())


def run(dive: Dive, out: Path, config: "Config", closures: Path | None = None) -> None:
    """Correct the track of a dive and write every product.

    Parameters
    ----------
    dive : Dive
        What to read.
    out : Path
        Folder for the products.
    config : Config
        Settings.
    closures : Path or None
        A table of loop closures that the user accepts or rejects.
    """
    from sssslam.overrides import Overrides, read_overrides

    check_folder(out)
    overrides = Overrides() if closures is None else read_overrides(closures)
    result = _slam(dive.read_track(), config, overrides)
    result.write(out)
    if dive.positions == "dead-reckoned" and result.recording.truth is not None:
        _judge(out, result.recording.truth)
    _say_result(result, out)


def demo(out: Path, seed: int | None, config: "Config") -> None:
    """Simulate a survey, run on it, compare with the truth.

    Parameters
    ----------
    out : Path
        Folder for the products.
    seed : int or None
        Another seed than the scene's.
    config : Config
        Settings.
    """
    from sssslam.simulation import load_scene, simulate, with_seed

    check_folder(out)
    scene = load_scene("demo")
    with progress_console.status("simulating the survey"):
        recording = simulate(scene if seed is None else with_seed(scene, seed))
    result = _slam(recording, config)
    result.write(out)
    assert recording.truth is not None
    _judge(out, recording.truth)
    _say_result(result, out)


def simulate_scene(scene: str, out: Path, seed: int | None) -> None:
    """Simulate a recording and write it, with truth to the open container or as a sonar would to XTF.

    Parameters
    ----------
    scene : str
        Name of a shipped scene, or a TOML file.
    out : Path
        The file, .nc or .xtf.
    seed : int or None
        Another seed than the scene's.
    """
    from sssslam.readers.netcdf_writing import write_netcdf_chunks
    from sssslam.simulation import load_scene, simulate_chunks, with_seed, write_xtf

    check_file(out, (".nc", ".xtf"))
    chosen = load_scene(scene)
    chosen = chosen if seed is None else with_seed(chosen, seed)
    with progress_console.status("simulating"):
        if out.suffix == ".xtf":
            write_xtf(simulate_chunks(chosen), out, chosen.recorder.sample_type)
        else:
            write_netcdf_chunks(simulate_chunks(chosen), out)
    out_console.print(f"{out}: {chosen.description}")


def list_scenes() -> None:
    """Show the shipped scenes, a line each."""
    from sssslam.simulation import load_scene, scene_names

    for name in scene_names():
        out_console.print(f"{name:16s} {load_scene(name).description}")


def reconstruct(dive: Dive, out: Path, config: "Config") -> None:
    """Reconstruct the seafloor window by window, or patch by patch.

    Parameters
    ----------
    dive : Dive
        What to read.
    out : Path
        Folder for the submaps and their figure.
    config : Config
        Settings.
    """
    from frontend.bottom import find_bottom
    from frontend.reconstruction import calibrate
    from sssslam.config import resolve
    from sssslam.mapping import check_shape_method, map_notes, reconstruct_patches
    from sssslam.products.shape import write_shape
    from sssslam.stages import choose_windows, notes, reconstruct_windows

    check_folder(out)
    check_shape_method(config.map, config.reconstruction)
    recording = dive.read_track()
    config, watch = resolve(config, recording), Shown()
    bottom = find_bottom(recording, config.bottom)
    windows, skipped = choose_windows(recording, bottom, config)
    radiometry = calibrate(recording, windows, bottom, config.radiometry, config.reconstruction.joint)
    _say((*notes(recording, bottom, radiometry, config), *skipped.notes))
    known, how = (bottom, radiometry), (config.map, config.reconstruction.joint)
    submaps = reconstruct_patches(recording, windows, known, how, watch)
    _say(map_notes(submaps))
    submaps = submaps or reconstruct_windows(recording, windows, known, config, watch)
    write_shape(recording, submaps, bottom.first_bottom_return, out)
    out_console.print(f"{len(submaps)} submaps in {out / 'submaps'}; look at {out / 'figures' / 'submaps.png'}")


def evaluate(out: Path, reference: Path, terrain: Path | None) -> None:
    """Compare a finished run with a reference and add the metrics to its report.

    Parameters
    ----------
    out : Path
        Folder of the run.
    reference : Path
        A TUM file, or a recording in the open container with truth.
    terrain : Path or None
        True heights; None takes those of the reference, if it has any.
    """
    from sssslam.products.grids import read_terrain
    from sssslam.products.run import read_run

    truth = _read_truth(reference)
    if terrain is not None:
        truth = Truth(truth.trajectory, read_terrain(terrain, read_run(out).crs))
    _judge(out, truth)
    out_console.print(f"report: {out / 'report.html'}")


def info(dive: Dive, figure: Path | None) -> None:
    """Say what is in a recording and what looks wrong.

    Parameters
    ----------
    dive : Dive
        What to read.
    figure : Path or None
        Where to draw the waterfall with the bottom that was found.
    """
    from sssslam.health import examine

    if figure is not None:
        check_file(figure, (".png",))
    recording = dive.read()
    health = examine(recording)
    for what, value in health.rows:
        out_console.print(f"{what:24s} {value}")
    suspicious = {finding.what for finding in health.findings}
    _say([note for note in recording.notes if note not in suspicious])
    for finding in health.findings:
        out_console.print(f"! {finding.what}: {finding.advice}")
    if figure is not None:
        from sssslam.health.figure import draw_health

        draw_health(recording, figure)
        out_console.print(f"waterfall: {figure}")


def convert(dive: Dive, file: Path) -> None:
    """Convert recordings to the open container.

    Parameters
    ----------
    dive : Dive
        What to read.
    file : Path
        The file to write.
    """
    from sssslam.readers.netcdf import write_netcdf

    check_file(file, (".nc",))
    recording = dive.read()
    write_netcdf(recording, file)
    _say(recording.notes)
    out_console.print(f"{file}: {recording.n_pings} pings of {recording.n_samples} samples a side")


def view(out: Path, show: bool) -> None:
    """Draw a run in three dimensions, and show it.

    Parameters
    ----------
    out : Path
        Folder of a finished run, or of a reconstruction by itself.
    show : bool
        Whether to open the page in the browser, where there is one and a display.
    """
    from sssslam.browser import open_page
    from sssslam.products.viewer import write_view

    page = write_view(out)
    out_console.print(f"view: {page}")
    if show and not open_page(page):
        out_console.print("no display or browser to show it; open it in any browser")


def show_config() -> None:
    """Print the default configuration."""
    from sssslam.config import default_toml

    print(default_toml(), end="")


def _slam(recording: Recording, config: "Config", overrides: "Overrides | None" = None) -> "Result":
    from sssslam.pipeline import slam

    result = slam(recording, config, Shown(), overrides)
    _say(result.notes)
    return result


def _read_truth(reference: Path) -> Truth:
    """A track from a TUM file, or the truth of a container; the content tells which."""
    from sssslam.products.tum import read_tum
    from sssslam.readers.netcdf import read_netcdf
    from sssslam.regular_files import read_head

    if read_head(reference, 8, "a TUM file or a recording with truth") != b"\x89HDF\r\n\x1a\n":
        return Truth(read_tum(reference))
    truth = read_netcdf(reference).truth
    if truth is None:
        raise ValueError(f"{reference} holds no truth; a simulated recording or a TUM file is wanted")
    return truth


def _judge(out: Path, truth: Truth) -> None:
    """Measure a run against the truth, add the metrics to it, and print them."""
    from sssslam.evaluation.run import evaluate_run
    from sssslam.products.run import read_run
    from sssslam.products.write import add_metrics

    metrics = evaluate_run(read_run(out), truth)
    add_metrics(out, metrics, truth.trajectory)
    width = max(len(metric.name) for metric in metrics)
    for metric in metrics:
        out_console.print(f"{metric.name:{width}}  {metric.value:9.4g} {metric.unit:14s} {metric.how}")


def _say(lines: Sequence[str]) -> None:
    for line in lines:
        out_console.print(f"- {line}")


def _say_result(result: "Result", out: Path) -> None:
    from sssslam.products.manifest import read_manifest

    for finding in read_manifest(out / "run.json")["findings"]:
        out_console.print(f"! {finding['what']}: {finding['advice']}")
    accepted = sum(closure.accepted for closure in result.loop_closures)
    moved = result.trajectory.positions - result.recording.trajectory_dr.positions
    out_console.print(
        f"{len(result.submaps)} submaps, {len(result.loop_closures)} candidates, {accepted} loop closures; "
        f"track moved by up to {((moved**2).sum(axis=1) ** 0.5).max():.1f} m"
    )
    out_console.print(f"report: {out / 'report.html'}")
