"""The rows of the table: methods that make a submap of each pass, or one of all passes together."""

from collections.abc import Callable, Sequence

import numpy as np
import shading
from scenes import Dive

from frontend.arrays import FloatArray
from frontend.heightfield import Heightfield
from frontend.reconstruction import ReconstructionConfig, method_of
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.joint import JointConfig, cell_spacing, first_surface, reconstruct_together
from frontend.reconstruction.window_data import WindowData, raster_of, window_data
from frontend.submaps import Submap
from frontend.windows import Window

Row = Callable[[Dive], Sequence[Submap]]


def flat(dive: Dive) -> list[Submap]:
    """The mean height below each pass."""
    return [_simple(dive, window, _mean_height) for window in dive.windows]


def altimeter(dive: Dive) -> list[Submap]:
    """Heights below each pass, spread sideways."""
    return [_simple(dive, window, first_surface) for window in dive.windows]


def linear(dive: Dive) -> list[Submap]:
    """Linearised shape from shading."""
    known = dive.bottom, dive.radiometry
    return [shading.reconstruct(dive.recording, window, *known) for window in dive.windows]


def by_name(name: str) -> Row:
    """A method of the library, with its default settings."""
    method = method_of(ReconstructionConfig.model_validate({"method": name}))
    return lambda dive: [method(dive.recording, window, dive.bottom, dive.radiometry) for window in dive.windows]


def together(dive: Dive) -> list[Submap]:
    """The method `joint`, one surface for all passes."""
    known = dive.bottom, dive.radiometry
    return [reconstruct_together(dive.recording, dive.windows, *known, JointConfig())]


def library_methods() -> list[str]:
    """Names of the methods that the library has."""
    named = ReconstructionConfig.model_fields["method"].annotation
    return [str(name) for name in getattr(named, "__args__", ())]


ROWS: dict[str, Row] = {
    "flat": flat,
    "altimeter": altimeter,
    "linear": linear,
    **{name: by_name(name) for name in library_methods()},
    "together": together,
}


def _mean_height(data: WindowData, raster: Raster) -> FloatArray:
    return np.full(raster.shape, np.mean(data.sensors[:, :, 2].mean(axis=1) - data.altitude))


def _simple(dive: Dive, window: Window, surface: Callable[[WindowData, Raster], FloatArray]) -> Submap:
    """A submap without echoes; its sigma is how much the heights below the pass differ."""
    data = window_data(dive.recording, window, dive.bottom, dive.radiometry)
    raster = raster_of(data, cell_spacing(data.slant_range_max))
    spread = max(float(np.std(data.sensors[:, :, 2].mean(axis=1) - data.altitude)), 0.1)
    unseen = np.zeros(raster.shape)
    return Submap(
        window.number,
        window.first_ping,
        window.end_ping,
        window.anchor_ping,
        float(dive.recording.ping_time[window.anchor_ping]),
        data.T_world_submap,
        data.T_submap_body,
        Heightfield(np.where(_is_swept(data, raster), surface(data, raster), np.nan), raster.spacing, raster.origin),
        unseen + spread,
        unseen,
        unseen > 0,
    )


def _is_swept(data: WindowData, raster: Raster) -> FloatArray:
    """Cells beside the straight line from the first ping to the last, within range."""
    place = data.sensors[:, :, :2].mean(axis=1)
    length = float(np.hypot(*(place[-1] - place[0])))
    along = (place[-1] - place[0]) / max(length, 1e-9)
    x = raster.origin[0] + raster.spacing * np.arange(raster.n_x) - place[0, 0]
    y = raster.origin[1] + raster.spacing * np.arange(raster.n_y)[:, None] - place[0, 1]
    reach = np.sqrt(max(data.slant_range_max**2 - float(np.mean(data.altitude)) ** 2, 0.0))
    run, side = x * along[0] + y * along[1], y * along[0] - x * along[1]
    return np.asarray((run >= 0) & (run <= length) & (np.abs(side) <= reach))
