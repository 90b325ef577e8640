"""Figures of the map: shaded seafloor, its sigma, and the reflectivity mosaic."""

from typing import Any

import numpy as np

from frontend.heightfield import Heightfield
from frontend.trajectory import Trajectory
from sssslam.products import figure_style as look
from sssslam.products.maps import SeafloorMap
from sssslam.products.relief import exaggeration


def draw_map(seafloor: SeafloorMap, trajectory: Trajectory) -> bytes:
    """The seafloor as shaded relief with the corrected track.

    Parameters
    ----------
    seafloor : SeafloorMap
        The map.
    trajectory : Trajectory
        The corrected track.

    Returns
    -------
    content : bytes
        A PNG.
    """
    surface = look.thin(seafloor.height)
    factor = exaggeration(surface)
    with look.style():
        figure = look.new_figure(11, 7.6)
        axes = figure.subplots()
        scale = look.draw_relief(axes, surface, look.percentile_limits(surface.z), factor)
        axes.plot(trajectory.x, trajectory.y, color="white", lw=2.4, alpha=0.75)
        axes.plot(trajectory.x, trajectory.y, color=look.INK, lw=0.9, label="corrected track")
        figure.colorbar(scale, ax=axes, label="height [m]", shrink=0.8, extend="both", pad=0.02)
        _finish(axes, f"Seafloor; the shading steepens it {factor:.1f} times")
        axes.legend(loc="upper left")
        return look.png(figure)


def draw_mosaic(seafloor: SeafloorMap) -> bytes:
    """The reflectivity in decibels against the mean of the dive.

    Parameters
    ----------
    seafloor : SeafloorMap
        The map.

    Returns
    -------
    content : bytes
        A PNG.
    """
    with np.errstate(divide="ignore"):
        decibel = 10.0 * np.log10(seafloor.reflectivity)
    layer = Heightfield(
        np.where(np.isfinite(decibel), decibel, np.nan), seafloor.height.spacing, seafloor.height.origin
    )
    return _draw_layer(layer, "gray", "reflectivity [dB]", "Mosaic")


def draw_sigma(seafloor: SeafloorMap) -> bytes:
    """The standard deviation of the heights.

    Parameters
    ----------
    seafloor : SeafloorMap
        The map.

    Returns
    -------
    content : bytes
        A PNG.
    """
    layer = Heightfield(seafloor.sigma, seafloor.height.spacing, seafloor.height.origin)
    return _draw_layer(layer, "magma_r", "sigma of the height [m]", "How sure the map is")


def _draw_layer(layer: Heightfield, colours: str, label: str, title: str) -> bytes:
    thinned = look.thin(layer)
    low, high = look.percentile_limits(thinned.z)
    with look.style():
        figure = look.new_figure(7.2, 6.0)
        axes = figure.subplots()
        image = axes.imshow(thinned.z, origin="lower", extent=look.extent(thinned), cmap=colours, vmin=low, vmax=high)
        figure.colorbar(image, ax=axes, label=label, shrink=0.8, extend="both", pad=0.02)
        _finish(axes, title)
        return look.png(figure)


def _finish(axes: Any, title: str) -> None:
    axes.set_facecolor(look.UNKNOWN)
    axes.grid(False)
    axes.set(aspect="equal", xlabel="x, east [m]", ylabel="y, north [m]", title=title)
