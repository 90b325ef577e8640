"""Joint estimate of height and reflectivity of a window by analysis by synthesis in the slant-range domain."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import binary_closing, gaussian_filter

from frontend.arrays import BoolArray, FloatArray
from frontend.bottom import Bottom
from frontend.heightfield import Heightfield
from frontend.radiometry import Radiometry
from frontend.reconstruction.forward import Raster, coverage
from frontend.reconstruction.measured_heights import below_track
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.priors import PriorConfig, make_prior
from frontend.reconstruction.roughness import RoughnessConfig, believing, learn_roughness
from frontend.reconstruction.shadow_ends import ShadowEnds, ShadowEndsConfig, find_shadow_ends, hear
from frontend.reconstruction.solver import Solution, SolverConfig, minimise
from frontend.reconstruction.uncertainty import SigmaConfig, height_sigma, resample
from frontend.reconstruction.unknowns import Unknowns
from frontend.reconstruction.window_data import BinModel, WindowData, beams_and_bins, join, raster_of, window_data
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.windows import Window


class JointConfig(BaseModel):
    """The joint method."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    spacing: float | None = Field(
        default=None,
        gt=0,
        description="Cells of the finest grid [m]; unset: slant range / 55, as fine as speckle lets it be.",
    )
    n_levels: int = Field(
        default=3,
        ge=1,
        le=6,
        description="Resolutions [1], each twice as fine as the one before; the coarse find the long waves.",
    )
    bins_per_cell: float = Field(
        default=2.0, gt=0, description="Slant-range bins a cell [1]; a coarse grid with fine bins aliases."
    )
    looks_most: float = Field(
        default=6.0, gt=0, description="Looks [1] that a bin may count; relief below a cell makes the rest."
    )
    blur: float = Field(
        default=0.02, ge=0, description="Share [1] of the mean echo added to echo and model; softens dark bins."
    )
    tail: float = Field(
        default=20.0, gt=0, description="Deviance [1] at which a bin counts half; tames echoes of fish and wreckage."
    )
    altimeter_sigma: float = Field(
        default=0.3, gt=0, description="Altimeter against the surface of a cell [m]; a cell is not its middle."
    )
    altimeter_length: float = Field(
        default=4.0, gt=0, description="Track over which altimeter errors repeat [m]: its footprint, and more."
    )
    held_out: int = Field(
        default=12, ge=2, description="Every so many-th line [1] is kept aside to say when a solution fits only noise."
    )
    prior: PriorConfig = PriorConfig()
    shadow_ends: ShadowEndsConfig = ShadowEndsConfig()
    roughness: RoughnessConfig = RoughnessConfig()
    sigma: SigmaConfig = SigmaConfig()
    solver: SolverConfig = SolverConfig()


def cell_spacing(slant_range_max: float) -> float:
    """Cells of the finest grid that go with a range: 1 m for 55 m, rounded to 1, 2 or 5 times a power of ten.

    Parameters
    ----------
    slant_range_max : float
        Longest slant range [m].

    Returns
    -------
    spacing : float
        Cell spacing [m].
    """
    wanted = slant_range_max / 55.0
    decade = 10.0 ** np.floor(np.log10(wanted))
    steps = decade * np.array([0.5, 1.0, 2.0, 5.0, 10.0])
    return float(steps[np.argmin(np.abs(np.log(steps / wanted)))])


def reconstruct(
    recording: Recording, window: Window, bottom: Bottom, radiometry: Radiometry, config: JointConfig
) -> Submap:
    """Reconstruct the seafloor of one window.

    Parameters
    ----------
    recording : Recording
        The dive.
    window : Window
        Which pings.
    bottom : Bottom
        First bottom returns and altitude of the dive.
    radiometry : Radiometry
        Calibrated for the dive; a window may stray from it by little.
    config : JointConfig
        The method's settings.

    Returns
    -------
    submap : Submap
        Heights, sigma, log-reflectivity and shadow on a grid in the level frame of the anchor ping.
    """
    return reconstruct_together(recording, [window], bottom, radiometry, config)


def reconstruct_together(
    recording: Recording, windows: Sequence[Window], bottom: Bottom, radiometry: Radiometry, config: JointConfig
) -> Submap:
    """Reconstruct the seafloor that several windows saw, as one surface that explains the echoes of all.

    Parameters
    ----------
    recording : Recording
        The dive; the windows are taken to lie to each other as its track says.
    windows : sequence of Window
        Which pings; at least one window.
    bottom : Bottom
        First bottom returns and altitude of the dive.
    radiometry : Radiometry
        Calibrated for the dive.
    config : JointConfig
        The method's settings.

    Returns
    -------
    submap : Submap
        Over the swaths of all windows, in the level frame of the first one's anchor ping, under its number and pings.

    Notes
    -----
    Two passes that look at a slope from either side tell it from a change of reflectivity, which one pass cannot.
    """
    until = time.monotonic() + config.solver.deadline
    window = windows[0]
    data = join([window_data(recording, each, bottom, radiometry) for each in windows])
    posteriors = coarse_to_fine(data, radiometry, config)
    second_finest = posteriors[-2:][0]
    roughness = learn_roughness(second_finest, config.roughness, config.solver, until)
    ends = find_shadow_ends(posteriors[-1], config.shadow_ends)
    levels = descend([believing(posterior, roughness) for posterior in posteriors], config.solver, until, ends)
    posterior, solution = levels[-1]
    rng = np.random.default_rng([window.first_ping, window.end_ping])
    sigma = height_sigma(levels, config.sigma, config.solver, rng)
    return _submap(recording, window, data, posterior, solution, sigma)


def coarse_to_fine(
    data: WindowData, radiometry: Radiometry, config: JointConfig, n_left_out: int = 0
) -> list[Posterior]:
    """The posteriors of a window, one a resolution.

    Parameters
    ----------
    data : WindowData
        The window.
    radiometry : Radiometry
        Calibration.
    config : JointConfig
        The method's settings.
    n_left_out : int
        How many of the finest to leave out; the coarsest is always there.

    Returns
    -------
    posteriors : list of Posterior
        With the dive's belief; the finest last.
    """
    finest = min(n_left_out, config.n_levels - 1)
    return [make_posterior(data, radiometry, config, coarser) for coarser in reversed(range(finest, config.n_levels))]


def descend(
    posteriors: Sequence[Posterior], config: SolverConfig, until: float = np.inf, ends: ShadowEnds | None = None
) -> list[tuple[Posterior, Solution]]:
    """Solve from the coarsest resolution down.

    Parameters
    ----------
    posteriors : sequence of Posterior
        Of one window, each finer than the one before.
    config : SolverConfig
        When to stop.
    until : float
        Time of the monotonic clock at which to stop [s].
    ends : ShadowEnds or None
        Shadows that tell heights; they are heard from the second resolution on, where the first one's surface says
        which cells cast them.

    Returns
    -------
    levels : list of (Posterior, Solution)
        One pair a resolution, the finest last.
    """
    levels: list[tuple[Posterior, Solution]] = []
    for posterior in posteriors:
        start = _refined(*levels[-1], posterior) if levels else posterior.origin()
        if levels and ends:
            posterior = hear(ends, posterior, posterior.height(start))
        levels.append((posterior, minimise(posterior, start, config, until)))
    return levels


def _refined(coarse: Posterior, solution: Solution, fine: Posterior) -> Unknowns:
    """What a coarser resolution found, on a finer one."""
    x, grids = solution.x, (coarse.raster, fine.raster)
    smooth = resample(coarse.expected + x.background, *grids) - fine.expected
    objects, reflectivity = resample(x.objects, *grids), resample(x.log_reflectivity, *grids)
    gain = x.gain if len(x.gain) == len(fine.beams.sensor) else fine.origin().gain
    return Unknowns(smooth, objects, reflectivity, x.beam, gain)


def make_posterior(data: WindowData, radiometry: Radiometry, config: JointConfig, coarser: int = 0) -> Posterior:
    """The posterior of a window at one resolution.

    Parameters
    ----------
    data : WindowData
        The window.
    radiometry : Radiometry
        Calibration.
    config : JointConfig
        The method's settings.
    coarser : int
        How many times cells are twice as large as the finest; bins and lines follow.

    Returns
    -------
    posterior : Posterior
        The cost to be made small.
    """
    raster = raster_of(data, (config.spacing or cell_spacing(data.slant_range_max)) * 2**coarser)
    step = np.median(np.hypot(*np.diff(data.sensors[:, 0, :2], axis=0).T)) if len(data.sensors) > 1 else raster.spacing
    group = int(np.clip(np.floor(raster.spacing / max(step, 1e-3)), 1, max(1, len(data.sensors) // 4)))
    model = BinModel(radiometry, config.looks_most, config.blur)
    beams, bins = beams_and_bins(data, raster.spacing / config.bins_per_cell, group, model)
    aside = _lines_aside(len(beams.sensor), config.held_out)
    seen = replace(bins, looks=np.where(aside, 0.0, bins.looks))
    prior = make_prior(raster, radiometry.tables, radiometry.seafloor, config.prior)
    below = below_track(data, raster, config.altimeter_sigma, config.altimeter_length)
    held_out = np.where(aside, bins.looks, 0.0)
    surface, nothing = first_surface(data, raster), np.zeros(raster.shape)
    return Posterior(raster, beams, radiometry.tables, seen, prior, surface, below, config.tail, held_out, nothing)


def _lines_aside(n_lines: int, every: int) -> BoolArray:
    """Shape (P, 1, 1): lines that only say when to stop; none in a short window."""
    if n_lines < 3 * every:
        return np.zeros((n_lines, 1, 1), dtype=np.bool_)
    return np.asarray(np.arange(n_lines) % every == every // 2)[:, None, None]


def first_surface(data: WindowData, raster: Raster) -> FloatArray:
    """Heights below the track, spread sideways.

    Parameters
    ----------
    data : WindowData
        The window.
    raster : Raster
        The grid.

    Returns
    -------
    z : ndarray, shape (n_y, n_x)
        A smooth surface [m]; far from the track the height of the nearest part of it.
    """
    height = data.sensors[:, :, 2].mean(axis=1) - data.altitude
    place = data.sensors[:, :, :2].mean(axis=1)
    sums, counts = np.zeros(raster.shape), np.full(raster.shape, 1e-12)
    column = np.clip(((place[:, 0] - raster.origin[0]) / raster.spacing).round().astype(int), 0, raster.n_x - 1)
    row = np.clip(((place[:, 1] - raster.origin[1]) / raster.spacing).round().astype(int), 0, raster.n_y - 1)
    np.add.at(sums, (row, column), height - height.mean())
    np.add.at(counts, (row, column), 1.0)
    length = 0.35 * data.slant_range_max / raster.spacing
    top, base = (gaussian_filter(a, length, truncate=6.0, mode="nearest") for a in (sums, counts))
    return np.asarray(height.mean() + top / base)


def _submap(
    recording: Recording, window: Window, data: WindowData, posterior: Posterior, solution: Solution, sigma: FloatArray
) -> Submap:
    raster, height = posterior.raster, posterior.height(solution.x)
    passed, seen = coverage(height, raster, posterior.beams, data.slant_range_max)
    covered = passed | binary_closing(np.pad(passed, 2), iterations=2)[2:-2, 2:-2]  # lines fan out in turns
    z, known_sigma, rho = (np.where(covered, values, np.nan) for values in (height, sigma, solution.x.log_reflectivity))
    return Submap(
        window.number,
        window.first_ping,
        window.end_ping,
        window.anchor_ping,
        float(recording.ping_time[window.anchor_ping]),
        data.T_world_submap,
        data.T_submap_body,
        Heightfield(z, raster.spacing, raster.origin),
        known_sigma,
        rho,
        passed & ~seen,
    )
