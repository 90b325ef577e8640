"""``view.html``: a run in three dimensions, made from its other products; one page that needs no other file."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frontend.arrays import FloatArray
from frontend.heightfield import Heightfield
from frontend.trajectory import Trajectory
from sssslam.products.figure_style import block_mean
from sssslam.products.files import atomic_write
from sssslam.products.grids import read_geotiff
from sssslam.products.maps import blend_submaps
from sssslam.products.ply import read_ply
from sssslam.products.run import Run, read_run
from sssslam.products.verdict import format_metric

_MAX_CELLS = 250_000  # of the drawn surface: 7 MB of the page, and what a laptop turns smoothly
_MAX_POINTS = 5_000  # of a drawn track
_MAX_CLOSURES = 5_000


@dataclass(frozen=True)
class View:
    """What is drawn.

    Parameters
    ----------
    title : str
        What it shows.
    surface : Heightfield
        Heights of the seafloor in the world frame [m]; NaN where unknown.
    reflectivity : ndarray, shape (n_y, n_x)
        Reflectivity of the same cells relative to the mean of the dive (linear); NaN where unknown.
    tracks : mapping of str to ndarray, shape (N, 3)
        Positions by what the track is [m].
    loop_closures : ndarray, shape (L, 2, 3)
        Where the two anchors of each accepted loop closure are [m].
    """

    title: str
    surface: Heightfield
    reflectivity: FloatArray
    tracks: Mapping[str, FloatArray]
    loop_closures: FloatArray


def write_view(out: str | os.PathLike[str]) -> Path:
    """Draw what lies in a folder into its ``view.html``.

    Parameters
    ----------
    out : path-like
        The folder of a finished run, or of a reconstruction by itself.

    Returns
    -------
    path : Path
        The page.

    Raises
    ------
    ValueError
        If the folder is not there, holds nothing to draw or only a part of a run, or cannot be written.
    """
    from sssslam.products.viewer_page import render_view  # the library that draws is slow to load

    view, path = read_view(out), Path(out) / "view.html"
    try:
        atomic_write(path, render_view(view))
    except OSError as error:
        raise ValueError(f"{path}: a folder that can be written is wanted ({error.strerror})") from None
    return path


def read_view(out: str | os.PathLike[str]) -> View:
    """Read what there is to see in a folder, thinned to what a page can show.

    Parameters
    ----------
    out : path-like
        The folder of a finished run, or of a reconstruction by itself.

    Returns
    -------
    view : View
        The seafloor, the tracks and the accepted loop closures; of a reconstruction the seafloor alone.

    Raises
    ------
    ValueError
        If the folder is not there, holds nothing to draw or only a part of a run, or a product is damaged.
    """
    out = Path(out)
    if not out.is_dir():
        raise ValueError(
            f"{out} is {'a file' if out.exists() else 'not there'}; the folder of a finished run is wanted"
        )
    if (out / "run.json").is_file():
        return _view_of_run(read_run(out))
    if any((out / name).exists() for name in ("trajectory.tum", "trajectory.csv", "loop_closures.csv")):
        raise ValueError(
            f"{out} holds a part of a run: its run.json, written last, is missing; a finished run is wanted"
        )
    return _view_of_shape(out)


def thin_grid(surface: Heightfield, values: FloatArray, max_cells: int) -> tuple[Heightfield, FloatArray]:
    """Average a grid and what goes with it down to some number of cells.

    Parameters
    ----------
    surface : Heightfield
        The grid [m].
    values : ndarray, shape (n_y, n_x)
        Something else of the same cells.
    max_cells : int
        The most cells wanted.

    Returns
    -------
    surface, values : Heightfield, ndarray
        Means over square blocks, of the known cells only.
    """
    n = 1
    while np.prod([-(-size // n) for size in surface.z.shape]) > max_cells:
        n += 1
    x, y = (corner + (n - 1) / 2 * surface.spacing for corner in surface.origin)
    z, values = block_mean(surface.z, (n, n)), block_mean(values, (n, n))
    return Heightfield(z, n * surface.spacing, (x, y)), values


def _view_of_run(run: Run) -> View:
    bands, _ = read_geotiff(run.out / "mosaic.tif")
    if bands[0].z.shape != run.seafloor.z.shape:
        wanted, given = run.seafloor.z.shape, bands[0].z.shape
        raise ValueError(f"{run.out / 'mosaic.tif'}: a grid like seafloor.tif, {wanted}, is wanted, got {given}")
    surface, reflectivity = thin_grid(run.seafloor, bands[0].z, _MAX_CELLS)
    tracks = {"dead-reckoned track": run.trajectory_dr, "corrected track": run.trajectory}
    return View(
        _title_of_run(run),
        surface,
        reflectivity,
        {name: _thin_track(track) for name, track in tracks.items()},
        _closure_ends(run),
    )


def _title_of_run(run: Run) -> str:
    counts, distance = run.manifest["counts"], format_metric(run.manifest["track"]["distance"], "m")
    source = run.manifest["input"]["source"] or run.out.resolve().name
    n = counts["loop_closures"]
    return f"{source}: {distance} run, {n} loop closure{'' if n == 1 else 's'}"


def _thin_track(track: Trajectory) -> FloatArray:
    """Positions of evenly chosen pings, the first and the last among them."""
    chosen = np.unique(np.linspace(0, len(track) - 1, min(len(track), _MAX_POINTS)).round().astype(np.int64))
    return track.positions[chosen]


def _closure_ends(run: Run) -> FloatArray:
    """Corrected positions of both anchors of the accepted closures; of too many, those that were most alike."""
    accepted = [closure for closure in run.loop_closures if closure.accepted]
    chosen = sorted(accepted, key=lambda closure: -np.nan_to_num(closure.correlation))[:_MAX_CLOSURES]
    times = [[run.anchor_time[closure.target], run.anchor_time[closure.source]] for closure in chosen]
    pings = np.searchsorted(run.trajectory.time, np.reshape(times, (-1, 2)) - 1e-4)  # written to the microsecond
    return run.trajectory.positions[np.minimum(pings, len(run.trajectory) - 1)]


def _view_of_shape(out: Path) -> View:
    paths = sorted(out.glob("submaps/[0-9]*.ply"))
    if not paths:
        raise ValueError(f"{out} holds no run.json and no submaps; the folder of a finished run is wanted")
    read = [read_ply(path) for path in paths]
    seafloor = blend_submaps([submap for submap, _ in read], np.stack([T for _, T in read]))
    surface, reflectivity = thin_grid(seafloor.height, seafloor.reflectivity, _MAX_CELLS)
    noun = "submap" if len(read) == 1 else "submaps"
    title = f"{out.resolve().name}: {len(read)} {noun} at their dead-reckoned poses"
    return View(title, surface, reflectivity, {}, np.zeros((0, 2, 3)))
