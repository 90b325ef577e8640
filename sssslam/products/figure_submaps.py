"""Figure of a few submaps: shape, how sure it is, what was seen; and the truth where it is known."""

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.ticker import MaxNLocator

from frontend.arrays import AnyArray, BoolArray
from frontend.frames import level, transform
from frontend.heightfield import Heightfield
from frontend.loop_closures import LoopClosure
from frontend.recording import Truth
from frontend.submaps import Submap
from sssslam.products import figure_style as look
from sssslam.products.relief import exaggeration

N_DRAWN = 6
_MOST_STEPS = 4  # between the ticks of an axis: more of them run into the next axes, and drawing them takes the time
_SMALL = {"axes.titlesize": 9.0, "xtick.labelsize": 7.5, "ytick.labelsize": 7.5}


def choose_submaps(submaps: Sequence[Submap], loop_closures: Sequence[LoopClosure]) -> list[Submap]:
    """A few submaps worth looking at: those of the best loop closures, then evenly over the dive.

    Parameters
    ----------
    submaps : sequence of Submap
        All of them.
    loop_closures : sequence of LoopClosure
        The candidates.

    Returns
    -------
    chosen : list of Submap
        At most six, in the order of the dive.
    """
    accepted = (c for c in loop_closures if c.accepted)
    best = sorted(accepted, key=lambda c: (-c.n_inliers, -np.nan_to_num(c.correlation), c.target))
    closed = [number for c in best for number in (c.target, c.source)]
    spread = [submaps[i].number for i in np.linspace(0, len(submaps) - 1, min(N_DRAWN, len(submaps))).astype(int)]
    rest = [submap.number for submap in submaps]
    wanted = list(dict.fromkeys([*closed[: N_DRAWN - 2], *spread, *closed, *rest]))[:N_DRAWN]
    return [submap for submap in submaps if submap.number in wanted]


def draw_submaps(submaps: Sequence[Submap], truth: Truth | None) -> bytes:
    """One row a submap: relief, sigma, shadow over reflectivity, and the true relief where it is known.

    Parameters
    ----------
    submaps : sequence of Submap
        Those to draw, at least one.
    truth : Truth or None
        Of a simulated recording.

    Returns
    -------
    content : bytes
        A PNG.
    """
    with look.style(), matplotlib.rc_context(_SMALL):
        figure, grid = _new_grid(len(submaps), 3 if truth is None or truth.terrain is None else 4)
        for row, submap in zip(grid, submaps, strict=True):
            surfaces = {f"submap {submap.number}: height [m]": submap.surface}
            if truth is not None and truth.terrain is not None:
                surfaces["true height [m]"] = true_surface(submap, truth, truth.terrain)
            _draw_heights(figure, [row[0], row[-1]], surfaces)
            _draw_sigma(figure, row[1], submap)
            _draw_reflectivity(figure, row[2], submap)
            for axes in row[1:]:
                axes.set(xticks=[], yticks=[])  # as in the first of the row
        return look.png(figure)


def _new_grid(n_submaps: int, n_columns: int) -> tuple[Any, AnyArray]:
    """A row of axes a submap; a submap that is alone gets large ones, two and two."""
    if n_submaps > 1:
        figure = look.new_figure(11, 2.7 * n_submaps + 0.4)
        places = {"wspace": 0.2, "hspace": 0.22}
        return figure, figure.subplots(n_submaps, n_columns, squeeze=False, gridspec_kw=places)
    figure = look.new_figure(11, 9.4)
    axes = figure.subplots(2, 2, gridspec_kw={"wspace": 0.12, "hspace": 0.14}).ravel()
    for axis in axes[n_columns:]:
        axis.remove()
    return figure, axes[None, :n_columns]


def true_surface(submap: Submap, truth: Truth, terrain: Heightfield) -> Heightfield:
    """The true heights below a submap's cells, in its frame.

    Parameters
    ----------
    submap : Submap
        The submap.
    truth : Truth
        True poses, one a ping.
    terrain : Heightfield
        True heights in the world frame [m].

    Returns
    -------
    surface : Heightfield
        True heights on the submap's grid [m]; NaN where the submap is unknown.
    """
    T_world_submap_ref = level(truth.trajectory.poses[submap.anchor_ping])
    points = np.stack([*np.meshgrid(submap.surface.x, submap.surface.y), np.zeros(submap.surface.z.shape)], axis=-1)
    x, y, _ = np.moveaxis(transform(T_world_submap_ref, points), -1, 0)
    z = np.where(submap.is_known, terrain.sample(x, y) - T_world_submap_ref[2, 3], np.nan)
    return Heightfield(z, submap.surface.spacing, submap.surface.origin)


def _draw_heights(figure: Any, axes: Sequence[Any], surfaces: dict[str, Heightfield]) -> None:
    """Draw the surfaces with the colours and the light of the first, so that they compare."""
    thinned = [look.thin(surface) for surface in surfaces.values()]
    limits, factor = look.percentile_limits(thinned[0].z), exaggeration(thinned[0])
    for axis, title, surface in zip(axes, surfaces, thinned, strict=False):
        _finish(figure, axis, look.draw_relief(axis, surface, limits, factor), title)


def _draw_sigma(figure: Any, axes: Any, submap: Submap) -> None:
    layer = look.thin(Heightfield(submap.sigma, submap.surface.spacing, submap.surface.origin))
    image = axes.imshow(
        layer.z,
        origin="lower",
        extent=look.extent(layer),
        cmap="magma_r",
        vmin=0.0,
        vmax=look.percentile_limits(layer.z)[1],
    )
    _finish(figure, axes, image, "sigma [m]")


def _draw_reflectivity(figure: Any, axes: Any, submap: Submap) -> None:
    decibel = 10.0 / np.log(10.0) * np.where(submap.is_known, submap.log_reflectivity, np.nan)
    layer = look.thin(Heightfield(decibel, submap.surface.spacing, submap.surface.origin))
    low, high = look.percentile_limits(layer.z)
    image = axes.imshow(layer.z, origin="lower", extent=look.extent(layer), cmap="gray", vmin=low, vmax=high)
    _tint(axes, submap, submap.is_shadow & submap.is_known)
    _finish(figure, axes, image, "reflectivity [dB], shadow tinted")


def _tint(axes: Any, submap: Submap, is_shadow: BoolArray) -> None:
    colours = np.zeros((*is_shadow.shape, 4))
    colours[is_shadow] = (0.84, 0.37, 0.0, 0.55)
    axes.imshow(colours, origin="lower", extent=look.extent(submap.surface))


def _finish(figure: Any, axes: Any, scale: Any, title: str) -> None:
    axes.set_facecolor(look.UNKNOWN)
    axes.grid(False)
    axes.set(aspect="equal")
    axes.set_title(title)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(_MOST_STEPS))
    # a narrow map stands at the left of its place, where its title has room
    ticks = MaxNLocator(_MOST_STEPS)
    bar = figure.colorbar(scale, ax=axes, shrink=0.85, pad=0.02, panchor=(0.0, 0.5), ticks=ticks)
    for axis in (axes.xaxis, axes.yaxis, bar.ax.xaxis, bar.ax.yaxis):
        axis.set_label_coords(0.0, 0.0)  # there is no label, and its place is not worth looking for
