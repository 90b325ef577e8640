"""Everything a run leaves in its folder, in one go."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomlkit

from frontend.arrays import FloatArray
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.products.figure_tracks import draw_tracks
from sssslam.products.figures import FIGURES, draw_figures
from sssslam.products.files import atomic_write, staged
from sssslam.products.grids import format_geotiff
from sssslam.products.loop_closures import format_loop_closures
from sssslam.products.manifest import Measured, describe_metrics, describe_run, format_manifest
from sssslam.products.maps import SeafloorMap, blend_submaps
from sssslam.products.ply import format_ply
from sssslam.products.report import render_report
from sssslam.products.run import read_run
from sssslam.products.tracks import format_geojson, format_trajectory_csv
from sssslam.products.tum import format_tum

if TYPE_CHECKING:
    from sssslam.products.result import Result

OWNED = (
    *("trajectory.tum", "trajectory_dr.tum", "trajectory_ref.tum", "trajectory.csv", "trajectory.geojson"),
    *("loop_closures.csv", "graph.g2o"),
    *("submaps/[0-9][0-9][0-9][0-9]*.ply", "seafloor.tif", "mosaic.tif", "report.html", "config.toml", "run.json"),
    "view.html",
    *(f"figures/{name}.png" for name in FIGURES),
)


def write_products(result: "Result", out: str | os.PathLike[str], metrics: Sequence[Measured] = ()) -> None:
    """Write the tracks, loop closures, submaps, map, figures and report of a run.

    Parameters
    ----------
    result : Result
        The run.
    out : path-like
        The folder; made if it does not exist. Products of an earlier run in it are replaced or removed, all at the
        end: an interrupted call leaves the folder as it was.
    metrics : sequence of Measured
        Metrics against a reference, where there is one.

    Raises
    ------
    ValueError
        If the folder cannot be made.
    """
    seafloor = blend_submaps(*_parts_of_the_map(result))
    with staged(Path(out), OWNED, last="run.json") as stage:
        _write_tracks(result, stage)
        _write_submaps(result, stage)
        _write_map(result, seafloor, stage)
        _write_text(stage / "graph.g2o", result.solution.g2o)
        _write_text(stage / "config.toml", format_config(result.config))
        _write_text(stage / "run.json", format_manifest(describe_run(result, metrics)))
        _write_figures(result, seafloor, stage)
        _write_text(stage / "report.html", render_report(stage))


def add_metrics(
    out: str | os.PathLike[str], metrics: Sequence[Measured], trajectory_ref: Trajectory | None = None
) -> None:
    """Add metrics to a finished run: to ``run.json``, the figure of the tracks, and the report.

    Parameters
    ----------
    out : path-like
        The folder of the run.
    metrics : sequence of Measured
        They replace those that the run has.
    trajectory_ref : Trajectory or None
        The reference that they were measured against, to be drawn.

    Raises
    ------
    ValueError
        If the folder is not one of a finished run.
    """
    run = read_run(out)
    if trajectory_ref is not None:
        (run.out / "figures").mkdir(exist_ok=True)
        atomic_write(run.out / "figures" / "tracks.png", draw_tracks(run, trajectory_ref))
    atomic_write(run.out / "run.json", format_manifest({**run.manifest, "metrics": describe_metrics(metrics)}))
    atomic_write(run.out / "report.html", render_report(run.out))


def format_config(config: Mapping[str, Any]) -> str:
    """A resolved configuration as TOML.

    Parameters
    ----------
    config : mapping
        Sections of keys; a key whose value is None has no TOML and is left out.

    Returns
    -------
    text : str
        The TOML, in the order of the mapping.
    """
    return tomlkit.dumps(_without_none(config))


def _without_none(config: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in config.items() if value is not None}
    return {key: _without_none(value) if isinstance(value, Mapping) else value for key, value in kept.items()}


def _write_text(path: Path, text: str) -> None:
    path.write_bytes(text.encode("utf-8"))


def _write_tracks(result: "Result", stage: Path) -> None:
    recording, closures = result.recording, result.loop_closures
    _write_text(stage / "trajectory.tum", format_tum(result.trajectory))
    _write_text(stage / "trajectory_dr.tum", format_tum(recording.trajectory_dr))
    if recording.truth is not None:
        _write_text(stage / "trajectory_ref.tum", format_tum(recording.truth.trajectory))
    table = format_trajectory_csv(result.trajectory, result.sigmas, recording.georeference)
    _write_text(stage / "trajectory.csv", table)
    times = {submap.number: submap.anchor_time for submap in result.submaps}
    _write_text(stage / "loop_closures.csv", format_loop_closures(closures, times))
    if recording.georeference is not None:
        pairs = zip(result.submaps, result.T_world_submap, strict=True)
        anchors = {submap.number: T[:2, 3] for submap, T in pairs}
        tracks = {"corrected": result.trajectory, "dead-reckoned": recording.trajectory_dr}
        _write_text(stage / "trajectory.geojson", format_geojson(tracks, closures, anchors, recording.georeference))


def _write_submaps(result: "Result", stage: Path) -> None:
    (stage / "submaps").mkdir()
    for submap, T_world_submap in zip(result.submaps, result.T_world_submap, strict=True):
        (stage / "submaps" / f"{submap.number:04d}.ply").write_bytes(format_ply(submap, T_world_submap))


def _parts_of_the_map(result: "Result") -> tuple[Sequence[Submap], FloatArray]:
    if result.patches:
        return result.patches, np.stack([patch.T_world_submap_dr for patch in result.patches])
    return result.submaps, result.T_world_submap


def _write_map(result: "Result", seafloor: SeafloorMap, stage: Path) -> None:
    grid = (seafloor.height.spacing, seafloor.height.origin, result.recording.georeference)
    heights = {"height [m]": seafloor.height.z, "sigma [m]": seafloor.sigma}
    (stage / "seafloor.tif").write_bytes(format_geotiff(heights, *grid))
    reflectivity = {"reflectivity relative to the mean of the dive": seafloor.reflectivity}
    (stage / "mosaic.tif").write_bytes(format_geotiff(reflectivity, *grid))


def _write_figures(result: "Result", seafloor: SeafloorMap, stage: Path) -> None:
    (stage / "figures").mkdir()
    for name, content in draw_figures(result, read_run(stage), seafloor).items():
        (stage / "figures" / f"{name}.png").write_bytes(content)
