"""Seafloor shape from sonar lines registered in three dimensions, after Woock 2011.

The lines of a window are put into space with the vehicle's pose; slopes across the track are taken on the line, slopes
along it from the local normal over the nearest cells of other lines. Coarse to fine, each registration from the relief
found so far: echoes are ground-range corrected onto it and neighbours searched anew.

References
----------
.. [1] Woock, "Deep-Sea Seafloor Shape Reconstruction from Side-Scan Sonar Data for AUV Navigation", OCEANS 2011.
.. [2] Coiras, Petillot, Lane, "Multiresolution 3-D Reconstruction From Side-Scan Sonar Images", IEEE TIP 16(2), 2007.
"""

from dataclasses import dataclass, replace
from time import monotonic

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import gaussian_filter, map_coordinates

from frontend.arrays import BoolArray, FloatArray
from frontend.bottom import Bottom
from frontend.frames import attitude_from_rotation
from frontend.heightfield import Heightfield
from frontend.radiometry import Radiometry
from frontend.reconstruction.joint import cell_spacing
from frontend.reconstruction.line_cloud import LineCloud, rasterise, shadow_regions
from frontend.reconstruction.line_image import EchoModel, LineImage, inner_angle, see_lines
from frontend.reconstruction.line_model import make_model
from frontend.reconstruction.line_operators import beam_knots
from frontend.reconstruction.line_prior import LinePriorConfig, make_line_prior
from frontend.reconstruction.line_solver import (
    LineProblem,
    LineSolution,
    LineSolverConfig,
    draw_lines,
    minimise_lines,
)
from frontend.reconstruction.lines import LineFrames, frame_lines, with_heave
from frontend.reconstruction.neighbours import local_planes
from frontend.reconstruction.window_data import WindowData, raster_of, window_data
from frontend.recording import Recording, SonarGeometry
from frontend.shadows import ShadowConfig, expected_echo, label_shadows
from frontend.submaps import Submap
from frontend.windows import Window


class WoockConfig(BaseModel):
    """The method of Woock 2011."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    spacing: float | None = Field(
        default=None, gt=0, description="Cells of the finest lines and of the submap [m]; unset: slant range / 55."
    )
    n_levels: int = Field(
        default=3, ge=1, le=6, description="Resolutions [1], each twice as fine; the coarse find the long waves."
    )
    n_registrations: int = Field(
        default=2, ge=1, description="Times a resolution is registered anew [1]: ground ranges follow the relief found."
    )
    n_neighbours: int = Field(
        default=8, ge=3, description="Cells of other lines in a local normal [1]; three a side and some."
    )
    main_lobe: float = Field(
        default=1.0, gt=0, description="From the beams' axis to the edge of their main lobe, over the -3 dB width [1]."
    )
    looks_most: float = Field(
        default=6.0, gt=0, description="Looks [1] that a cell may count; relief below a cell makes the rest."
    )
    brightest: float = Field(
        default=4.0,
        gt=1,
        description="Amplitude over a flat floor's beyond which echoes are cut [1]; fish and wreckage.",
    )
    n_draws: int = Field(default=6, ge=2, description="Draws [1] from the posterior behind sigma; smoothed over cells.")
    sigma_factor: float = Field(
        default=5.0, gt=0, description="Sigma against that of the posterior [1]; by simulation: errors are long waves."
    )
    shadows: ShadowConfig = ShadowConfig()
    prior: LinePriorConfig = LinePriorConfig()
    solver: LineSolverConfig = LineSolverConfig()


@dataclass(frozen=True)
class LineState:
    """Lines, what they saw and what was made of it at one resolution; shape (L, C) all arrays.

    Parameters
    ----------
    frames : LineFrames
        The lines.
    image : LineImage
        What they saw.
    relief : ndarray
        Above the flat floor of each line [m].
    log_reflectivity : ndarray
        As amplitude, shadow filled from the nearest lit cells of the line.
    costs : tuple of tuple of float
        Cost after every step of each registration so far, all resolutions.
    problem : LineProblem or None
        The last registration's cost; None before the first.
    solution : LineSolution or None
        Its solution.
    """

    frames: LineFrames
    image: LineImage
    relief: FloatArray
    log_reflectivity: FloatArray
    costs: tuple[tuple[float, ...], ...] = ()
    problem: LineProblem | None = None
    solution: LineSolution | None = None


def reconstruct(
    recording: Recording, window: Window, bottom: Bottom, radiometry: Radiometry, config: WoockConfig
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
        Of the dive; the beam pattern may move a little from it, slowly.
    config : WoockConfig
        The method's settings.

    Returns
    -------
    submap : Submap
        Heights, sigma, log-reflectivity and shadow on a grid in the level frame of the anchor ping. Sigma is that of
        the linearised posterior, times a factor found on simulated fractal seafloors: a posterior knows of speckle,
        reflectivity, slopes and the beam pattern's freedom, but most of the error is drift across the swath.
    """
    data = with_heave(window_data(recording, window, bottom, radiometry))
    state = invert_lines(data, radiometry, recording.sonar, config)
    rng = np.random.default_rng([window.first_ping, window.end_ping])
    raster = raster_of(data, config.spacing or cell_spacing(data.slant_range_max))
    z, sigma, log_reflectivity, is_shadow = rasterise(line_cloud(state, config, rng), raster)
    return Submap(
        window.number,
        window.first_ping,
        window.end_ping,
        window.anchor_ping,
        float(recording.ping_time[window.anchor_ping]),
        data.T_world_submap,
        data.T_submap_body,
        Heightfield(z, raster.spacing, raster.origin),
        sigma,
        log_reflectivity,
        is_shadow,
    )


def invert_lines(data: WindowData, radiometry: Radiometry, sonar: SonarGeometry, config: WoockConfig) -> LineState:
    """Find the relief of every line, from coarse to fine.

    Parameters
    ----------
    data : WindowData
        The window.
    radiometry : Radiometry
        Of the dive.
    sonar : SonarGeometry
        Where the beams end.
    config : WoockConfig
        The method's settings.

    Returns
    -------
    state : LineState
        The finest resolution; meaningful wherever the time limit stopped it.
    """
    deadline = monotonic() + config.solver.time_limit
    finest = config.spacing or cell_spacing(data.slant_range_max)
    edge = inner_angle(sonar, config.main_lobe)
    echoes = EchoModel(radiometry, edge, config.looks_most, config.brightest)
    dark = _shadows(data, radiometry, config.shadows)
    state: LineState | None = None
    for level in reversed(range(config.n_levels)):
        frames = frame_lines(data, finest * 2**level)
        state = (
            _first_state(data, dark, frames, echoes) if state is None else _refined(data, dark, frames, echoes, state)
        )
        for k in range(config.n_registrations):
            if k:
                state = replace(state, image=_weighed(see_lines(data, dark, frames, state.relief, echoes), state))
            state = _registered(state, radiometry, config, deadline)
    assert state is not None
    return state


def line_cloud(state: LineState, config: WoockConfig, rng: np.random.Generator) -> LineCloud:
    """The reconstructed lines as points, the first and the last line left out.

    Parameters
    ----------
    state : LineState
        Reconstructed lines.
    config : WoockConfig
        How sigma is found.
    rng : Generator
        For draws from the posterior.

    Returns
    -------
    cloud : LineCloud
        Points up to the farthest echo of each line. Their neighbours lie on one side only at a window's ends, so those
        lines are dropped, where three or more are left of five.
    """
    frames, image = state.frames, state.image
    n_lines, n_cells = frames.shape
    points = frames.points(state.relief)
    sigma = _sigma(state, config, rng)
    farthest = np.where(image.weight > 0, np.abs(frames.cell), 0.0).max(axis=1, keepdims=True)
    keep = np.abs(frames.cell)[None, :] <= farthest
    if n_lines >= 5:
        keep[[0, -1]] = False
    line = np.repeat(np.arange(n_lines), n_cells).reshape(n_lines, n_cells)
    place, row, dark = points[keep], line[keep], image.is_shadow[keep]
    region = shadow_regions(place, row, dark, frames.spacing)
    return LineCloud(place, row, sigma[keep], 2 * state.log_reflectivity[keep], dark, region)


def _shadows(data: WindowData, radiometry: Radiometry, config: ShadowConfig) -> BoolArray:
    sample = np.arange(data.intensity.shape[2]) + 0.5
    roll, pitch, _ = attitude_from_rotation(data.T_submap_pings[:, :3, :3])
    slant_range = sample[None, :] * data.sample_spacing[:, None]
    expected = expected_echo(slant_range, data.altitude, (roll, pitch), radiometry.tables)
    return label_shadows(data.intensity, expected, data.sample_spacing, radiometry.tables.noise, config)


def _first_state(data: WindowData, dark: BoolArray, frames: LineFrames, echoes: EchoModel) -> LineState:
    flat = np.zeros(frames.shape)
    return LineState(frames, see_lines(data, dark, frames, flat, echoes), flat, flat)


def _refined(data: WindowData, dark: BoolArray, frames: LineFrames, echoes: EchoModel, coarse: LineState) -> LineState:
    """The start of a finer resolution: the coarse surface between its lines and cells."""
    row = (frames.pings.mean(axis=1) - coarse.frames.pings[0].mean()) / coarse.frames.pings.shape[1]
    column = (frames.cell - coarse.frames.cell[0]) / coarse.frames.spacing
    place = np.stack(np.meshgrid(row, column, indexing="ij"))
    z = coarse.frames.points(coarse.relief)[:, :, 2]
    relief = frames.relief(map_coordinates(z, place, order=1, mode="nearest"))
    log_reflectivity = map_coordinates(coarse.log_reflectivity, place, order=1, mode="nearest")
    image = see_lines(data, dark, frames, relief, echoes)
    return LineState(frames, image, relief, log_reflectivity, coarse.costs)


def _weighed(image: LineImage, state: LineState) -> LineImage:
    """Speckle grows with the echo: bright cells count less, as bright as the model has them."""
    assert state.solution is not None
    bright = np.maximum(state.solution.linear.amplitude.reshape(state.frames.shape), 1.0)
    return replace(image, weight=image.weight / bright**2)


def _registered(state: LineState, radiometry: Radiometry, config: WoockConfig, deadline: float) -> LineState:
    """Search neighbours, and descend with them frozen."""
    frames, image = state.frames, state.image
    neighbours = local_planes(frames, state.relief, config.n_neighbours)
    beam, n_angles = beam_knots(frames, image.angle, config.prior.beam_angle, config.prior.beam_track)
    model = make_model(frames, image, neighbours, beam, radiometry.tables.exponent)
    prior = make_line_prior(frames, image.is_shadow, neighbours, (beam.shape[1], n_angles), config.prior)
    problem = LineProblem(model, image, prior, frames.spacing)
    start = np.concatenate([state.relief.ravel(), state.log_reflectivity.ravel(), np.zeros(beam.shape[1])])
    solution = minimise_lines(problem, start, config.solver, deadline)
    relief, log_reflectivity, _ = model.split(solution.x)
    filled = (model.fill @ log_reflectivity).reshape(frames.shape)
    costs = (*state.costs, solution.costs)
    return LineState(frames, image, relief.reshape(frames.shape), filled, costs, problem, solution)


def _sigma(state: LineState, config: WoockConfig, rng: np.random.Generator) -> FloatArray:
    """Standard deviation of heights from draws of the posterior, smoothed over cells and inflated."""
    assert state.problem is not None
    assert state.solution is not None
    draws = [draw_lines(state.problem, state.solution.linear, config.solver, rng) for _ in range(config.n_draws)]
    relief = np.stack([state.problem.model.split(draw)[0].reshape(state.frames.shape) for draw in draws])
    variance = gaussian_filter(np.mean(relief**2, axis=0), 2.0, mode="nearest")
    return np.asarray(config.sigma_factor * np.sqrt(variance) * state.frames.up[:, 2:])
