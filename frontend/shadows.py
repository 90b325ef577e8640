"""Acoustic shadows: samples of a line that are silent although the seafloor should have answered."""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import label, percentile_filter, uniform_filter1d

from frontend.arrays import BoolArray, FloatArray
from frontend.geometry import off_nadir_angle
from frontend.radiometry import Tables


class ShadowConfig(BaseModel):
    """How dark is a shadow, and against what."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    length: float = Field(
        default=0.5, gt=0, description="Slant range averaged before a sample is judged [m]; hides speckle."
    )
    shortest: float = Field(
        default=0.5, ge=0, description="Shortest shadow [m slant range]; shorter ones are fades of the speckle."
    )
    core: float = Field(
        default=0.15,
        gt=0,
        lt=1,
        description="Share [1] of the expected intensity below which a shadow begins to be one.",
    )
    edge: float = Field(
        default=0.35, gt=0, lt=1, description="Share [1] up to which it reaches from there; half way down is 0.5."
    )
    neighbourhood: float = Field(
        default=15.0,
        gt=0,
        description="Slant range that says how bright the floor is about a sample [m]; mud is no shadow.",
    )
    brightness: float = Field(
        default=70.0, gt=0, lt=100, description="Percentile [%] of that range taken for lit; shadows may fill the rest."
    )
    audible: float = Field(
        default=2.0,
        ge=0,
        description="Noise standard deviations [1] that a lit floor must stand out by, for silence to be shadow.",
    )
    steepest: float = Field(
        default=1.1, gt=0, description="Grazing angle beyond which nothing casts a shadow [rad]; near nadir all is lit."
    )


def expected_echo(
    slant_range: FloatArray, altitude: FloatArray, attitude: tuple[FloatArray, FloatArray], tables: Tables
) -> FloatArray:
    """Intensity above the noise floor that a flat, level seafloor would return.

    Parameters
    ----------
    slant_range : ndarray, shape (P, M)
        Middles of the samples [m].
    altitude : ndarray, shape (P,)
        Height of the sonar above the seafloor [m].
    attitude : tuple of ndarray, shapes (P,)
        Roll (starboard down) and pitch (nose down) [rad].
    tables : Tables
        Radiometry of the dive.

    Returns
    -------
    expected : ndarray, shape (P, 2, M)
        Port and starboard; NaN in the water column.

    Notes
    -----
    Beam pattern times range law times ``cos(incidence)**n`` times the ground that a metre of slant range covers,
    ``1 / sin(incidence)``.
    """
    angle = off_nadir_angle(slant_range, altitude, attitude)
    knots = tables.angle_first + tables.angle_step * np.arange(tables.log_beam.shape[1])
    beam = np.stack([np.interp(angle[:, k], knots, tables.log_beam[k]) for k in range(2)], axis=1)
    law = np.interp(slant_range, tables.range_step * np.arange(tables.log_range.size), tables.log_range)
    cosine = altitude[:, None] / slant_range
    sine = np.sqrt(np.where(cosine < 1, 1 - cosine**2, np.nan))
    return np.asarray(np.exp(beam + law[:, None]) * (cosine**tables.exponent / sine)[:, None])


def label_shadows(
    intensity: FloatArray, expected: FloatArray, sample_spacing: FloatArray, noise: FloatArray, config: ShadowConfig
) -> BoolArray:
    """Which samples lie in shadow, each line judged by itself.

    Parameters
    ----------
    intensity : ndarray, shape (P, 2, M)
        Echo intensities, port and starboard; NaN where there is none.
    expected : ndarray, shape (P, 2, M)
        What a flat floor would return above the noise floor, as `expected_echo` has it; only its shape along a line
        matters. NaN in the water column.
    sample_spacing : ndarray, shape (P,)
        Slant range between samples [m].
    noise : ndarray, shape (2,)
        Noise floor of each side, as intensity.
    config : ShadowConfig
        How dark is dark.

    Returns
    -------
    is_shadow : ndarray of bool, shape (P, 2, M)
        True in shadow. Never in the water column, near nadir, or where a lit floor would not stand out of the noise.

    Raises
    ------
    ValueError
        If the shapes do not agree.

    Notes
    -----
    The mean excess over the noise is compared with ``share * level * expected``, where ``level`` is a high percentile
    of the same quotient in the neighbourhood on the line, at least half of its median over the line. A run below the
    edge's share is a shadow if it falls below the core's share somewhere and is long enough (hysteresis).
    """
    if intensity.shape != expected.shape or intensity.ndim != 3 or intensity.shape[1] != 2:
        raise ValueError(
            f"intensity and expected must both be (pings, 2, samples), got {intensity.shape} and {expected.shape}"
        )
    spacing = float(np.median(sample_spacing))
    width = max(1, round(config.length / spacing))
    usable = np.isfinite(intensity) & np.isfinite(expected) & (expected > 0)
    excess = _running_mean(intensity - noise[None, :, None], usable, width)
    lit = _running_mean(expected, usable, width)
    ratio = np.where(usable, excess / np.where(usable, lit, 1.0), np.nan)
    level = _level(ratio, max(1, round(config.length / spacing)), config)
    is_audible = config.edge * level * lit > config.audible * noise[None, :, None] / np.sqrt(width)
    candidates = usable & is_audible & _is_oblique(expected, config.steepest)
    dark = candidates & (ratio < config.edge * level)
    return _grown(dark, dark & (ratio < config.core * level), sample_spacing, config.shortest)


def _running_mean(values: FloatArray, usable: BoolArray, width: int) -> FloatArray:
    """Mean of the usable samples in a window about each sample; 0 where there is none."""
    total = uniform_filter1d(np.where(usable, values, 0.0), width, axis=-1, mode="constant")
    share = uniform_filter1d(usable.astype(np.float64), width, axis=-1, mode="constant")
    return np.asarray(np.where(share > 1e-9, total / np.maximum(share, 1e-9), 0.0))


def _level(ratio: FloatArray, step: int, config: ShadowConfig) -> FloatArray:
    """Brightness of the lit floor about each sample, from every step-th sample."""
    thin = ratio[..., ::step]
    filled = np.where(np.isfinite(thin), thin, _median(thin))
    size = max(1, round(config.neighbourhood / config.length))
    local = percentile_filter(filled, config.brightness, size=(1, 1, size), mode="nearest")
    local = np.maximum(local, 0.5 * _median(thin))
    return np.repeat(local, step, axis=-1)[..., : ratio.shape[-1]]


def _median(ratio: FloatArray) -> FloatArray:
    """Shape (P, 2, 1): median of what is known on each line and side, 0 where nothing is."""
    known = np.isfinite(ratio)
    ordered = np.sort(np.where(known, ratio, np.inf), axis=-1)
    middle = np.maximum(known.sum(axis=-1, keepdims=True) - 1, 0) // 2
    median = np.take_along_axis(ordered, middle, axis=-1)
    return np.where(np.isfinite(median), np.maximum(median, 0.0), 0.0)


def _is_oblique(expected: FloatArray, steepest: float) -> BoolArray:
    """Samples beyond the range at which rays graze the floor at the steepest angle that may cast a shadow."""
    sample = np.arange(expected.shape[-1]) + 0.5
    first = np.where(np.isfinite(expected), sample, np.inf).min(axis=-1, keepdims=True)
    return np.asarray(first < sample * np.sin(min(steepest, np.pi / 2)))


def _grown(dark: BoolArray, core: BoolArray, sample_spacing: FloatArray, shortest: float) -> BoolArray:
    """Runs of dark samples on a line that hold a core and are long enough."""
    along_line = np.zeros((3, 3, 3), dtype=bool)
    along_line[1, 1] = True
    runs, n_runs = label(dark, structure=along_line)
    length = np.bincount(runs.ravel(), np.broadcast_to(sample_spacing[:, None, None], runs.shape).ravel(), n_runs + 1)
    has_core = np.bincount(runs[core], minlength=n_runs + 1) > 0
    keep = has_core & (length >= shortest)
    keep[0] = False
    return np.asarray(keep[runs])
