"""Figures of the experiment: maps of every method beside the truth, the paper's figures 1, 5 and 6, a summary."""

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from fusion import Fused, Target
from matplotlib.axes import Axes
from scenes import Dive

from frontend.arrays import FloatArray
from frontend.heightfield import Heightfield
from frontend.reconstruction.ground_image import GroundImage, ImageConfig, ground_image
from frontend.reconstruction.joint import cell_spacing
from frontend.reconstruction.window_data import window_data
from sssslam.evaluation.reconstruction import high_pass

_DPI = 90


def draw_case(dive: Dive, wanted: Target, maps: Mapping[str, Fused], to: tuple[str, Path]) -> None:
    """Maps of a case, under its title in a folder; of the groove also the paper's figures."""
    title, out = to
    name = title.replace(" ", "-")
    grids = {"truth": wanted.surface, **{method: fused.surface for method, fused in maps.items()}}
    seen = {method: replace(grid, z=np.where(wanted.count > 0, grid.z, np.nan)) for method, grid in grids.items()}
    draw_maps(title, seen, out / f"{name}.jpg")
    if title.startswith("groove"):
        draw_images(dive, out / f"{name}-images.jpg")
        draw_surfaces(grids, out / f"{name}-surfaces.jpg")  # shadows as well: tangent to the beam


def draw_maps(title: str, grids: Mapping[str, Heightfield], path: Path) -> None:
    """Heights of the truth and of each method, whole and without what is smoother than 20 m."""
    figure, axes = plt.subplots(2, len(grids), figsize=(2.9 * len(grids), 5.4), squeeze=False)
    wanted = _both(grids["truth"])
    limits = [float(np.nanpercentile(np.abs(values), 98)) for values in wanted]
    for column, (name, surface) in enumerate(grids.items()):
        for row, values in enumerate(_both(surface)):
            _draw_heights(axes[row, column], values, surface, limits[row])
        axes[0, column].set_title(name)
    axes[0, 0].set_ylabel("heights")
    axes[1, 0].set_ylabel("without waves over 20 m")
    figure.suptitle(title)
    _save(figure, path)


def _both(surface: Heightfield) -> tuple[FloatArray, FloatArray]:
    return surface.z - np.nanmedian(surface.z), high_pass(surface.z, 20.0 / surface.spacing)


def draw_images(dive: Dive, path: Path) -> None:
    """The paper's figures 1 and 5: the lines as recorded, and corrected to ground range."""
    window = dive.windows[0]
    some = dive.recording[window.pings]
    figure, axes = plt.subplots(2, 1, figsize=(9, 7))
    waterfall = np.hstack([some.port[:, ::-1], some.starboard])
    reach = float(some.slant_range_max.max())
    _draw_image(axes[0], np.sqrt(waterfall), (-reach, reach, 0, window.n_pings))
    axes[0].set(title="lines as recorded (figure 1)", xlabel="slant range, starboard positive [m]", ylabel="ping")
    image = _ground_image(dive)
    stacked = np.hstack([image.level[0][:, ::-1], image.level[1]])
    ground = image.level.shape[2] * image.spacing[1]
    _draw_image(axes[1], stacked, (-ground, ground, 0, image.level.shape[1] * image.spacing[0]))
    axes[1].set(title="over a flat floor, in ground range (figure 5)", xlabel="ground range [m]", ylabel="along [m]")
    _save(figure, path)


def draw_surfaces(grids: Mapping[str, Heightfield], path: Path) -> None:
    """The paper's figure 6: surfaces from the side, port blue and starboard red, and profiles across the track."""
    n, truth = len(grids), grids["truth"]
    figure = plt.figure(figsize=(3.2 * n, 6.5))
    for k, (name, surface) in enumerate(grids.items()):
        axes = figure.add_subplot(2, n, k + 1, projection="3d")
        x, y = np.meshgrid(surface.x, surface.y)
        colours = np.where(y[..., None] > 0, [0.3, 0.45, 0.9, 1.0], [0.9, 0.35, 0.3, 1.0])
        axes.plot_surface(x, y, surface.z, facecolors=colours, rstride=3, cstride=3, linewidth=0)
        axes.set(title=name, xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", zlim=_limits(truth.z))
        axes.set_box_aspect((1, 1, 0.3))
        axes.view_init(elev=35, azim=-20)
        profile = figure.add_subplot(2, n, n + k + 1)
        profile.plot(truth.y, _profile(truth), "k", lw=1)
        profile.plot(surface.y, _profile(surface), "C1", lw=1)
        profile.set(xlabel="y [m]", ylabel="z [m]", ylim=_limits(truth.z))
    _save(figure, path)


def draw_summary(rows: Sequence[Mapping[str, str | float]], path: Path) -> None:
    """Four columns of the table: a panel a scene, motions and passes beside each other, a mark a method."""
    scenes, courses, methods = (list(dict.fromkeys(name(row) for row in rows)) for name in (_scene, _course, _method))
    shown = {
        "rmse_over_relief": "RMSE without plane\n[% of relief]",
        "correlation_20m": "correlation\nbelow 20 m",
        "slope_correlation_across": "correlation of\nslopes across",
        "slope_correlation_along": "correlation of\nslopes along",
    }
    size = (2.0 + 0.3 * len(scenes) * (len(courses) + 1), 9)
    figure, axes = plt.subplots(len(shown), len(scenes), figsize=size, sharex=True, sharey="row", squeeze=False)
    for line, (name, label) in zip(axes, shown.items(), strict=True):
        for panel, scene in zip(line, scenes, strict=True):
            for mark, method in zip("_|v^so*", methods, strict=False):
                values = [_median(rows, (scene, course, method), name) for course in courses]
                panel.plot(range(len(courses)), values, mark, ms=6, label=method)
            panel.grid(axis="y", lw=0.3)
        line[0].set_ylabel(label)
    for panel, scene in zip(axes[0], scenes, strict=True):
        panel.set(title=scene, ylim=(0, 250))
        panel.axhline(100, color="k", lw=0.5)
    for panel in axes[-1]:
        panel.set_xticks(range(len(courses)), courses, rotation=70, ha="right", fontsize="small")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), ncols=len(methods), loc="lower center")
    figure.subplots_adjust(left=0.9 / size[0], right=1 - 0.2 / size[0], top=0.95, bottom=0.16, wspace=0.06, hspace=0.1)
    figure.savefig(path, dpi=_DPI, pil_kwargs={"quality": 85})
    plt.close(figure)


def _scene(row: Mapping[str, str | float]) -> str:
    return str(row["scene"])


def _course(row: Mapping[str, str | float]) -> str:
    return f"{row['motion']} {row['passes']}"


def _method(row: Mapping[str, str | float]) -> str:
    return str(row["method"])


def _median(rows: Sequence[Mapping[str, str | float]], key: tuple[str, str, str], name: str) -> float:
    chosen = [float(row[name]) for row in rows if (_scene(row), _course(row), _method(row)) == key]
    return statistics.median(chosen) if chosen else float("nan")


def _ground_image(dive: Dive) -> GroundImage:
    data = window_data(dive.recording, dive.windows[0], dive.bottom, dive.radiometry)
    return ground_image(data, dive.radiometry, 0.5 * cell_spacing(data.slant_range_max), ImageConfig())


def _draw_heights(axes: Axes, z: FloatArray, surface: Heightfield, limit: float) -> None:
    extent = (surface.x[0], surface.x[-1], surface.y[0], surface.y[-1])
    axes.imshow(z, origin="lower", extent=extent, cmap="RdBu_r", vmin=-limit, vmax=limit)
    axes.set(xticks=[], yticks=[])


def _draw_image(axes: Axes, image: FloatArray, extent: tuple[float, float, float, float]) -> None:
    low, high = np.nanpercentile(image, [1, 99])
    axes.imshow(image, cmap="copper", extent=extent, origin="lower", aspect="auto", vmin=low, vmax=high)


def _profile(surface: Heightfield) -> FloatArray:
    """Mean over the middle 40 m of the track."""
    chosen = (np.abs(surface.x) < 20)[None, :] & np.isfinite(surface.z)
    count = np.count_nonzero(chosen, axis=1)
    total = np.where(chosen, np.nan_to_num(surface.z), 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _limits(z: FloatArray) -> tuple[float, float]:
    low, high = np.nanpercentile(z, [0.5, 99.5])
    return float(low - 0.3 * (high - low) - 0.5), float(high + 0.3 * (high - low) + 0.5)


def _save(figure: plt.Figure, path: Path) -> None:
    figure.tight_layout()
    figure.savefig(path, dpi=_DPI, pil_kwargs={"quality": 85})
    plt.close(figure)
