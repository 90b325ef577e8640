"""First bottom return: the slant range of the first echo from the seafloor, tracked from ping to ping."""

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.bottom_levels import Cells, level_cells
from frontend.bottom_tail import last_usable_samples
from frontend.bottom_tracking import Track, track_bottom
from frontend.recording import Recording

_CELLS_A_STEP = 5
_GUIDED = (0.6, 1.5)  # shares of the recorded altitude between which the bottom is looked for


class BottomConfig(BaseModel):
    """How the first bottom return is found."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    blanking: float = Field(
        default=1.0, ge=0, description="Slant range that is never bottom [m]; transducers ring that long."
    )
    step_length: float = Field(default=0.75, gt=0, description="Slant range compared before and after an edge [m].")
    n_pings: int = Field(
        default=5, ge=1, description="Most pings [1] averaged before the search; speckle hides single edges."
    )
    group_length: float = Field(
        default=1.2, gt=0, description="Most distance run [m] by pings averaged; a rough floor changes beyond."
    )
    threshold: float = Field(
        default=4.0,
        gt=0,
        description="Least edge, in standard deviations [1] of all level differences; pure noise reaches three.",
    )
    scale_tolerance: float = Field(
        default=0.03,
        gt=0,
        description="Share [1] that altimeter and first bottom return may differ by before the altimeter is scaled.",
    )


@dataclass(frozen=True)
class Bottom:
    """Where the bottom is.

    Parameters
    ----------
    first_bottom_return : ndarray, shape (N, 2)
        Slant range of the first echo from the seafloor, port and starboard [m].
    altitude : ndarray, shape (N,)
        Height of the vehicle above the seafloor: the altimeter where it is recorded, else from the echoes [m].
    altimeter_scale : float
        What the altimeter had to be multiplied with to agree with the echoes; 1 if nothing, NaN without altimeter.
    is_found : ndarray of bool, shape (N, 2), or None
        Whether the ping itself shows its first bottom return; elsewhere it is interpolated. None: not known.
    last_usable_sample : ndarray of int, shape (N, 2), or None
        Last sample before the silent tail that follows the last bottom return at low altitude. None: not known.
    """

    first_bottom_return: FloatArray
    altitude: FloatArray
    altimeter_scale: float
    is_found: BoolArray | None = None
    last_usable_sample: IntArray | None = None


def find_bottom(recording: Recording, config: BottomConfig) -> Bottom:
    """First bottom return of every ping and side, and the altitude that goes with it.

    Parameters
    ----------
    recording : Recording
        Any number of pings.
    config : BottomConfig
        How to search.

    Returns
    -------
    bottom : Bottom
        Finite everywhere.

    Raises
    ------
    ValueError
        If no echo on either side looks like a bottom and no altitude is recorded.

    Notes
    -----
    The first return comes from the nearest point of the seafloor that the beam reaches. Over a level floor that is
    ``altitude / cos(pitch)`` whatever the roll: a fan with its sidelobes reaches past nadir on both sides, and of a fan
    that does not, the side rolled inwards still comes nearest. So the altitude is the nearer side's range times the
    cosine of pitch.
    """
    guide = _filled(recording.altitude)
    cells = _cells(recording, config)
    track = _tracked(recording, cells, guide, config)
    nearest = np.fmin(track.slant_range[:, 0], track.slant_range[:, 1])
    if guide is None and not np.isfinite(nearest).any():
        raise ValueError("no first bottom return found on either side and no altitude recorded: one of them is wanted")
    cosine = np.cos(recording.trajectory_dr.pitch)
    scale = _altimeter_scale((nearest * cosine)[track.is_found.any(axis=1)], guide, track, config)
    altitude = nearest * cosine if guide is None else guide * scale
    nearest = np.where(np.isfinite(nearest), nearest, altitude / cosine)
    returns = np.where(np.isfinite(track.slant_range), track.slant_range, nearest[:, None])
    last = last_usable_samples(recording, cells, track.slant_range)
    return Bottom(returns, altitude, float("nan") if guide is None else scale, track.is_found, last)


def _cells(recording: Recording, config: BottomConfig) -> Cells:
    step = recording.ping_spacing
    group = config.n_pings if not step > 0 else int(np.clip(config.group_length / step, 1, config.n_pings))
    width = max(config.step_length / _CELLS_A_STEP, float(np.median(recording.sample_spacing)))
    return level_cells(recording, width, group)


def _tracked(recording: Recording, cells: Cells, guide: FloatArray | None, config: BottomConfig) -> Track:
    """The track near the recorded altitude, or anywhere if there is none."""
    step = (config.step_length, config.threshold)
    shape = cells.level.shape[1:]
    is_allowed = np.broadcast_to(cells.slant_range >= config.blanking, shape)
    if guide is not None:
        expected = np.interp(cells.middle_ping, np.arange(len(guide)), guide)[:, None]
        is_near = (cells.slant_range > _GUIDED[0] * expected) & (cells.slant_range < _GUIDED[1] * expected)
        track = track_bottom(recording, cells, is_allowed & is_near, step)
        if track.is_found.any():
            return track
    return track_bottom(recording, cells, is_allowed, step)


def _filled(altitude: FloatArray) -> FloatArray | None:
    """Recorded altitude with gaps bridged; None if there is none."""
    good = np.isfinite(altitude) & (altitude > 0)
    if good.sum() < 2 or good.mean() < 0.2:
        return None
    return np.interp(np.arange(len(altitude)), np.flatnonzero(good), altitude[good])


def _altimeter_scale(echo_altitude: FloatArray, guide: FloatArray | None, track: Track, config: BottomConfig) -> float:
    if guide is None or not echo_altitude.size:
        return 1.0
    ratio = float(np.median(echo_altitude / guide[track.is_found.any(axis=1)]))
    return ratio if abs(ratio - 1) > config.scale_tolerance else 1.0
