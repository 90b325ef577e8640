"""What all figures share: size, colours that a colour-blind reader can tell apart, and deterministic bytes."""

import io
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from frontend.arrays import FloatArray
from frontend.heightfield import Heightfield
from sssslam.products.relief import hillshade

# Okabe and Ito's palette; each line also differs in dash or width.
DEAD_RECKONED, CORRECTED, REFERENCE, ACCEPTED, REJECTED = "#D55E00", "#0072B2", "#000000", "#009E73", "#999999"
REASON_COLOURS = ("#E69F00", "#CC79A7", "#56B4E9", "#D55E00", "#999999")
INK, UNKNOWN = "#1d2733", "#e9edf1"
HEIGHT_COLOURS = "YlGnBu_r"
MAX_PIXELS = 1600  # of a drawn grid along its longer side; more cannot be seen on a page
_LEVEL = 3  # of a PNG's compression: twice as fast as the usual 6, a tenth larger

_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.edgecolor": "#8b97a3",
    "axes.labelcolor": INK,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.titley": 1.0,  # where it would stand anyway; to find that out takes a sixth of the time of many axes
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dfe5ea",
    "grid.linewidth": 0.6,
    "xtick.color": "#4c5866",
    "ytick.color": "#4c5866",
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "#dfe5ea",
    "legend.fontsize": 8.5,
    "figure.facecolor": "white",
    "image.interpolation": "nearest",
    "path.simplify": True,
    "agg.path.chunksize": 0,
}


def style() -> Any:
    """A context in which matplotlib has our style, whatever the user's own settings are."""
    return matplotlib.rc_context({**_defaults(), **_STYLE})


def _defaults() -> dict[str, Any]:
    kept = ("backend", "backend_fallback", "interactive", "toolbar", "timezone", "webagg", "tk.", "macosx.")
    return {key: value for key, value in matplotlib.rcParamsDefault.items() if not key.startswith(kept)}


def new_figure(width: float, height: float, right: float = 0.2) -> Figure:
    """An empty figure without a window, with fixed margins: matplotlib's automatic layouts take seconds.

    Parameters
    ----------
    width, height : float
        Size [inch].
    right : float
        Margin at the right, for a legend beside the axes [inch].

    Returns
    -------
    figure : Figure
        The figure, on the Agg canvas.
    """
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    margins = {"left": 0.65 / width, "right": 1 - right / width, "bottom": 0.5 / height, "top": 1 - 0.35 / height}
    figure.subplots_adjust(**margins)
    return figure


def png(figure: Figure) -> bytes:
    """A figure as PNG; the same figure gives the same bytes.

    Parameters
    ----------
    figure : Figure
        The figure.

    Returns
    -------
    content : bytes
        A PNG without the name and version of the software that made it.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150, metadata={"Software": None}, pil_kwargs={"compress_level": _LEVEL})
    return buffer.getvalue()


def thin(surface: Heightfield) -> Heightfield:
    """Average a grid down to what a page can show.

    Parameters
    ----------
    surface : Heightfield
        The grid.

    Returns
    -------
    thinned : Heightfield
        Means over square blocks, of the known cells only; the grid itself where it is small enough.
    """
    n = -(-max(surface.z.shape) // MAX_PIXELS)
    if n == 1:
        return surface
    shift = (n - 1) / 2 * surface.spacing
    return Heightfield(
        block_mean(surface.z, (n, n)), n * surface.spacing, (surface.origin[0] + shift, surface.origin[1] + shift)
    )


def block_mean(image: FloatArray, block: tuple[int, int]) -> FloatArray:
    """Means of the known cells of each block; NaN where a block has none.

    Parameters
    ----------
    image : ndarray, shape (n_y, n_x)
        The cells.
    block : tuple of int
        Rows and columns of a block.

    Returns
    -------
    means : ndarray, shape (ceil(n_y / rows), ceil(n_x / columns))
        One value a block; blocks at the far rim may be smaller.
    """
    known = np.isfinite(image)
    starts = [np.arange(0, size, step) for size, step in zip(image.shape, block, strict=True)]
    sums = [np.where(known, image, 0.0), known.astype(np.float64)]
    total, count = (np.add.reduceat(np.add.reduceat(s, starts[0], axis=0), starts[1], axis=1) for s in sums)
    return np.where(count > 0, total / np.maximum(count, 1.0), np.nan)


def extent(surface: Heightfield) -> tuple[float, float, float, float]:
    """West, east, south and north edge of a grid [m], for ``imshow`` with the origin below.

    Parameters
    ----------
    surface : Heightfield
        The grid.

    Returns
    -------
    edges : tuple of float
        The four edges.
    """
    (x, y), half = surface.origin, surface.spacing / 2
    n_y, n_x = surface.z.shape
    return x - half, x + (n_x - 0.5) * surface.spacing, y - half, y + (n_y - 0.5) * surface.spacing


def percentile_limits(values: FloatArray, low: float = 1.0, high: float = 99.0) -> tuple[float, float]:
    """Colour limits that leave out the extremes.

    Parameters
    ----------
    values : ndarray
        The values; unknown ones do not count.
    low, high : float
        Percentiles.

    Returns
    -------
    limits : tuple of float
        Two different numbers, whatever the values are.
    """
    known = values[np.isfinite(values)]
    if known.size == 0:
        return 0.0, 1.0
    a, b = (float(v) for v in np.percentile(known, [low, high]))
    return (a, b) if b > a else (a - 0.5, a + 0.5)


def draw_relief(axes: Any, surface: Heightfield, limits: tuple[float, float], factor: float) -> Any:
    """Draw heights as colour under a shaded relief.

    Parameters
    ----------
    axes : matplotlib Axes
        Where to draw.
    surface : Heightfield
        Heights [m].
    limits : tuple of float
        Heights of the ends of the colour scale [m].
    factor : float
        Vertical exaggeration of the shading.

    Returns
    -------
    scale : matplotlib ScalarMappable
        For a colour bar.
    """
    scale = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(*limits), HEIGHT_COLOURS)
    colours = scale.to_rgba(np.where(np.isfinite(surface.z), surface.z, limits[0]))
    shade = hillshade(surface, factor)
    colours[..., :3] *= (0.25 + 0.95 * np.nan_to_num(shade))[..., None]
    colours[..., 3] = np.isfinite(surface.z)
    axes.imshow(np.clip(colours, 0.0, 1.0), origin="lower", extent=extent(surface))
    return scale
