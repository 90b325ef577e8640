"""The page of the 3D viewer: surface, tracks and loop closures as plotly draws them, with its controls."""

from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.io import to_html

from frontend.arrays import Float32Array, FloatArray
from sssslam.products import figure_style as look
from sssslam.products.relief import exaggeration

if TYPE_CHECKING:
    from sssslam.products.viewer import View

EXAGGERATIONS = (1, 2, 3, 5, 8, 12, 20)  # the steps of the control
_DOMAIN = {"x": [0.0, 1.0], "y": [0.14, 1.0]}  # of the scene on the page; the control stands below
_MARGIN = 0.02  # of the box, beyond what lies in it
_TRACK_LOOKS = {
    "dead-reckoned track": {"color": look.DEAD_RECKONED, "width": 3},
    "corrected track": {"color": look.CORRECTED, "width": 5},
}
# low light, as on the maps; little of it from everywhere, or relief drowns
_LIGHT = {"lighting": {"ambient": 0.45, "diffuse": 0.9, "specular": 0.05, "roughness": 0.9, "fresnel": 0.05}}


def render_view(view: "View") -> str:
    """A view as a page.

    Parameters
    ----------
    view : View
        What is drawn.

    Returns
    -------
    html : str
        A page that needs no other file; the same view gives the same page.
    """
    config = {"displaylogo": False, "responsive": True}
    page = to_html(draw_view(view), config=config, include_plotlyjs=True, div_id="view", default_height="100vh")
    return page.replace("<head>", "<head><title>sssslam view</title><style>body{margin:0}</style>", 1)


def draw_view(view: "View") -> go.Figure:
    """A view as a plotly figure.

    Parameters
    ----------
    view : View
        What is drawn.

    Returns
    -------
    figure : plotly Figure
        The surface by height and by reflectivity, the tracks, the loop closures as one line, and the controls.
    """
    return go.Figure(data=[*_surfaces(view), *_tracks(view), *_closures(view)], layout=_layout(view))


def _surfaces(view: "View") -> list[Any]:
    """The seafloor twice, coloured by height and by reflectivity; a button shows one of them."""
    with np.errstate(divide="ignore", invalid="ignore"):
        decibel = 10.0 * np.log10(view.reflectivity)
    known = np.where(np.isfinite(decibel), decibel, np.nan)
    height = _surface(view, view.surface.z, "height [m]", look.HEIGHT_COLOURS)
    return [height, _surface(view, known, "reflectivity [dB]", "gray").update(visible=False)]


def _surface(view: "View", values: FloatArray, name: str, colours: str) -> Any:
    low, high = look.percentile_limits(values)
    grid, scale = view.surface, {"title": {"text": name}, "len": 0.6, "thickness": 14, "x": 1.0}
    label = f"x %{{x:.1f}} m, y %{{y:.1f}} m<br>z %{{z:.2f}} m<br>{name} %{{surfacecolor:.2f}}<extra></extra>"
    return go.Surface(
        x=_short(grid.x),
        y=_short(grid.y),
        z=_short(grid.z),
        surfacecolor=_short(values),
        cmin=low,
        cmax=high,
        colorscale=colours,
        colorbar=scale,
        name="seafloor",
        hovertemplate=label,
        contours={axis: {"highlight": False} for axis in "xyz"},
        **_LIGHT,
    )


def _tracks(view: "View") -> list[Any]:
    return [_line(name, positions, _TRACK_LOOKS[name]) for name, positions in view.tracks.items()]


def _closures(view: "View") -> list[Any]:
    """All loop closures as one line that is lifted between them."""
    n = len(view.loop_closures)
    if n == 0:
        return []
    lifted = np.concatenate([view.loop_closures, np.full((n, 1, 3), np.nan)], axis=1).reshape(-1, 3)
    return [_line(f"loop closures ({n})", lifted, {"color": look.ACCEPTED, "width": 4})]


def _line(name: str, positions: FloatArray, line: dict[str, Any]) -> Any:
    x, y, z = (_short(axis) for axis in positions.T)
    label = f"{name}<br>x %{{x:.1f}} m, y %{{y:.1f}} m, z %{{z:.1f}} m<extra></extra>"
    return go.Scatter3d(x=x, y=y, z=z, mode="lines", name=name, line=line, hovertemplate=label, showlegend=True)


def _layout(view: "View") -> dict[str, Any]:
    low, high = _box(view)
    typical = exaggeration(view.surface)
    first = int(np.argmin([abs(np.log(step / typical)) for step in EXAGGERATIONS]))
    shape = (high - low) / (high - low)[:2].max()
    axes = {
        f"{axis}axis": {"range": [float(low[k]), float(high[k])], "title": {"text": f"{name} [m]"}}
        for k, (axis, name) in enumerate(zip("xyz", ("east", "north", "up"), strict=True))
    }
    ratio = {"x": float(shape[0]), "y": float(shape[1]), "z": float(shape[2] * EXAGGERATIONS[first])}
    # seen from the south, north up
    camera = {"eye": {"x": 0.0, "y": -0.95, "z": 0.9}, "projection": {"type": "perspective"}}
    return {
        "title": {"text": _plain(view.title), "x": 0.5},
        "scene": {**axes, "aspectmode": "manual", "aspectratio": ratio, "camera": camera, "domain": _DOMAIN},
        "margin": {"l": 0, "r": 0, "t": 48, "b": 0},
        "legend": {"x": 0.01, "y": 0.85},
        "updatemenus": [_colour_buttons()],
        "sliders": [_exaggeration_slider(float(shape[2]), first)],
        "template": "plotly_white",
    }


def _box(view: "View") -> tuple[FloatArray, FloatArray]:
    """Corners of the box around all that is drawn, with a margin."""
    x, y = np.meshgrid(view.surface.x[[0, -1]], view.surface.y[[0, -1]])
    known = view.surface.z[np.isfinite(view.surface.z)]
    z = [known.min(), known.max()] if known.size else [0.0, 0.0]
    corners = np.stack([x.ravel(), y.ravel(), np.tile(z, 2)], axis=-1)
    points = np.concatenate([corners, *view.tracks.values(), view.loop_closures.reshape(-1, 3)])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = np.maximum(_MARGIN * (high - low), 0.5)
    return low - margin, high + margin


def _colour_buttons() -> dict[str, Any]:
    labels = {"height": [True, False], "reflectivity": [False, True]}
    buttons = [
        {"label": label, "method": "restyle", "args": [{"visible": visible}, [0, 1]]}
        for label, visible in labels.items()
    ]
    return {"type": "buttons", "direction": "right", "x": 0.01, "xanchor": "left", "y": 1.0, "buttons": buttons}


def _exaggeration_slider(height: float, first: int) -> dict[str, Any]:
    steps = [
        {"label": f"{step}", "method": "relayout", "args": [{"scene.aspectratio.z": height * step}]}
        for step in EXAGGERATIONS
    ]
    shown = {"prefix": "heights drawn ", "suffix": " times", "font": {"size": 13}}
    return {"active": first, "steps": steps, "currentvalue": shown, "x": 0.01, "len": 0.4, "y": 0.12, "yanchor": "top"}


def _short(values: FloatArray) -> Float32Array:
    """Half the size; millimetres at 10 km."""
    return np.asarray(values, dtype=np.float32)


def _plain(text: str) -> str:
    """Text that plotly takes for no markup."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
