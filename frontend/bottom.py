"""First bottom return: the slant range of the first echo from the seafloor, tracked from ping to ping."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import uniform_filter

from frontend.arrays import AnyArray, FloatArray
from frontend.recording import Recording


class BottomConfig(BaseModel):
    """How the first bottom return is found."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    blanking: float = Field(
        default=1.0, ge=0, description="Slant range that is never bottom [m]; transducers ring that long."
    )
    step_length: float = Field(default=0.75, gt=0, description="Slant range compared before and after an edge [m].")
    n_pings: int = Field(
        default=5, ge=1, description="Pings [1] averaged before the search; speckle hides single edges."
    )
    threshold: float = Field(
        default=0.6,
        gt=0,
        lt=1,
        description="Edge wanted, as a share [1] of the ping's strongest: the bottom rises less than what lies beyond.",
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
    """

    first_bottom_return: FloatArray
    altitude: FloatArray
    altimeter_scale: float


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
    """
    guide = _filled(recording.altitude)
    both = (recording.port, recording.starboard)
    sides = [_track(_edges(echoes, recording, guide, config), recording) for echoes in both]
    returns = np.stack(sides, axis=1)
    nearest = _nearest(returns)
    if guide is None and not np.isfinite(nearest).any():
        raise ValueError("no first bottom return found on either side and no altitude recorded: one of them is wanted")
    echo_altitude = nearest * np.cos(recording.trajectory_dr.pitch) * np.cos(recording.trajectory_dr.roll)
    scale = _altimeter_scale(echo_altitude, guide, config)
    altitude = echo_altitude if guide is None else guide * scale
    altitude = np.where(np.isfinite(altitude), altitude, np.nanmedian(altitude))
    returns = np.where(np.isfinite(returns), returns, altitude[:, None])
    return Bottom(returns, altitude, float("nan") if guide is None else scale)


def _nearest(returns: FloatArray) -> FloatArray:
    return np.fmin(returns[:, 0], returns[:, 1])


def _filled(altitude: FloatArray) -> FloatArray | None:
    """Recorded altitude with gaps bridged; None if there is none."""
    good = np.isfinite(altitude) & (altitude > 0)
    if good.sum() < 2 or good.mean() < 0.2:
        return None
    return np.interp(np.arange(len(altitude)), np.flatnonzero(good), altitude[good])


def _altimeter_scale(echo_altitude: FloatArray, guide: FloatArray | None, config: BottomConfig) -> float:
    if guide is None or not np.isfinite(echo_altitude).any():
        return 1.0
    ratio = float(np.nanmedian(echo_altitude / guide))
    return ratio if abs(ratio - 1) > config.scale_tolerance else 1.0


def _edges(echoes: AnyArray, recording: Recording, guide: FloatArray | None, config: BottomConfig) -> FloatArray:
    """Shape (N,): range of the first strong rise of each ping, NaN where none stands out."""
    spacing = float(np.median(recording.sample_spacing))
    width = max(2, round(config.step_length / spacing))
    floor = _floor(echoes)
    # a running mean cannot get over a number so large that all others vanish beside it
    bounded = np.clip(np.nan_to_num(echoes, posinf=0.0).astype(np.float64), 0.0, 1e9 * floor)
    log_echo = np.log(uniform_filter(bounded, (config.n_pings, 3)) + floor)
    mean = np.cumsum(np.pad(log_echo, ((0, 0), (1, 0))), axis=1)
    n = echoes.shape[1]
    rise = np.full(echoes.shape, -np.inf)
    k = np.arange(width, n - width)
    rise[:, k] = (mean[:, k + width] - 2 * mean[:, k] + mean[:, k - width]) / width
    slant_range = np.arange(n)[None, :] * recording.sample_spacing[:, None]
    allowed = slant_range >= config.blanking
    if guide is not None:
        allowed &= (slant_range > 0.6 * guide[:, None]) & (slant_range < 1.5 * guide[:, None])
    rise = np.where(allowed, rise, -np.inf)
    return _first_peak(rise, slant_range, width, config.threshold)


def _floor(echoes: AnyArray) -> float:
    """A small positive number, so that silence has a logarithm."""
    positive = echoes[(echoes > 0) & np.isfinite(echoes)]
    return float(np.percentile(positive, 1)) if positive.size else 1.0


def _first_peak(rise: FloatArray, slant_range: FloatArray, width: int, threshold: float) -> FloatArray:
    best = rise.max(axis=1)
    strong = rise >= threshold * best[:, None]
    first = strong.argmax(axis=1)
    window = np.clip(first[:, None] + np.arange(width)[None, :], 0, rise.shape[1] - 1)
    rows = np.arange(len(rise))[:, None]
    peak = window[rows[:, 0], rise[rows, window].argmax(axis=1)]
    found = np.isfinite(best) & (best > 0.3)
    return np.where(found, slant_range[rows[:, 0], peak], np.nan)


def _track(measured: FloatArray, recording: Recording) -> FloatArray:
    """Smooth the detections with a Kalman filter over range and its rate; what lies off the track is left out."""
    good = np.isfinite(measured)
    if good.sum() < 2:
        return np.full(len(measured), np.nan)
    kalman = _kalman(float(np.median(measured[good][:9])), recording)
    means, covariances = np.empty((len(measured), 2)), np.empty((len(measured), 2, 2))
    missed = 0
    for i, z in enumerate(measured):
        kalman.predict()
        gate = 4 * np.sqrt(kalman.P[0, 0] + kalman.R[0, 0])
        if good[i] and (abs(z - kalman.x[0]) < gate or missed > 20):
            kalman.update(z)
            missed = 0
        else:
            missed += 1
        means[i], covariances[i] = kalman.x, kalman.P
    smooth, *_ = kalman.rts_smoother(means, covariances)
    return np.asarray(smooth[:, 0])


def _kalman(start: float, recording: Recording) -> Any:
    """A filter over the range of the bottom and its change a ping."""
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=2, dim_z=1)
    kalman.x = np.array([start, 0.0])
    kalman.F, kalman.H = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    sigma = max(0.05, 2 * float(np.median(recording.sample_spacing)))
    kalman.P, kalman.R = np.diag([1.0, 0.01]), np.array([[sigma**2]])
    rate = max(0.02, recording.ping_spacing * 0.1)  # a seafloor changes its slope by about a tenth from ping to ping
    kalman.Q = rate**2 * np.array([[0.25, 0.5], [0.5, 1.0]])
    return kalman
