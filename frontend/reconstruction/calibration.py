"""Calibration of a dive's beam pattern from windows all over it, before it is held fixed in each of them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from frontend.arrays import FloatArray
from frontend.bottom import Bottom
from frontend.radiometry import Radiometry, RadiometryConfig, Tables, estimate_radiometry
from frontend.reconstruction.joint import JointConfig, coarse_to_fine, descend, make_posterior
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.scattering import likeliest_exponent
from frontend.reconstruction.seafloor import estimate_seafloor
from frontend.reconstruction.solver import Solution
from frontend.reconstruction.window_data import WindowData, window_data
from frontend.recording import Recording
from frontend.threads import in_order
from frontend.windows import Window

_FREE = 0.5  # standard deviation of a beam pattern of which nothing is known yet, against its first estimate


def calibrate(
    recording: Recording, windows: Sequence[Window], bottom: Bottom, radiometry: RadiometryConfig, joint: JointConfig
) -> Radiometry:
    """Radiometry of a dive.

    Parameters
    ----------
    recording : Recording
        The dive.
    windows : sequence of Window
        Its windows; a few are reconstructed coarsely.
    bottom : Bottom
        First bottom returns and altitude.
    radiometry : RadiometryConfig
        What is taken for known, and how many windows and rounds.
    joint : JointConfig
        The method that reconstructs them.

    Returns
    -------
    calibrated : Radiometry
        Beam pattern, range law, noise floor and scattering exponent for every window of the dive.

    Notes
    -----
    A slope profile across track that all windows share and a beam pattern cannot be told apart (SCIENCE 7.1); over many
    places true slopes average out, so what is left in the mean is the beam pattern. The scattering exponent comes
    first, for the pattern is what is left over a flat floor that scatters by it.
    """
    estimate = estimate_radiometry(recording, bottom, radiometry)
    chosen = np.unique(np.linspace(0, len(windows) - 1, min(radiometry.n_windows, len(windows))).astype(int))
    data = list(in_order(lambda k: window_data(recording, windows[k], bottom, estimate), chosen))
    if not data:
        return estimate
    altitudes = [float(np.median(part.altitude)) for part in data]
    estimate = _with_seafloor(estimate, data, altitudes, joint)
    if radiometry.n_rounds:
        estimate = _with_exponent(partial(_under, recording, bottom, (radiometry, estimate)), data, radiometry, joint)
    free = joint.model_copy(update={"prior": joint.prior.model_copy(update={"beam": _FREE})})
    for _ in range(radiometry.n_rounds):
        solved = list(in_order(partial(_coarsely, estimate, free), data))
        estimate = replace(estimate, tables=_with_common_beam(estimate.tables, solved))
    return _with_seafloor(estimate, data, altitudes, joint)


def _coarsely(radiometry: Radiometry, config: JointConfig, data: WindowData) -> tuple[Posterior, Solution]:
    """A window at the finest resolution but one, with the dive's belief: its own would take beam pattern for relief."""
    return descend(coarse_to_fine(data, radiometry, config, 1), config.solver)[-1]


def _with_seafloor(
    radiometry: Radiometry, data: Sequence[WindowData], altitudes: Sequence[float], config: JointConfig
) -> Radiometry:
    """The same radiometry with roughness and reflectivity as the echoes show them over a flat floor."""
    posteriors = list(in_order(lambda part: make_posterior(part, radiometry, config), data))
    return replace(radiometry, seafloor=estimate_seafloor(posteriors, altitudes, config.prior.longest))


def _under(
    recording: Recording, bottom: Bottom, known: tuple[RadiometryConfig, Radiometry], exponent: float
) -> Radiometry:
    """The first estimate as it would be under another scattering exponent."""
    config, estimate = known
    if exponent == config.exponent:
        return estimate
    other = estimate_radiometry(recording, bottom, config.model_copy(update={"exponent": exponent}))
    return replace(estimate, tables=other.tables)


def _with_exponent(
    under: Callable[[float], Radiometry], data: Sequence[WindowData], config: RadiometryConfig, joint: JointConfig
) -> Radiometry:
    """Radiometry under the scattering exponent that foretells lines kept aside, of all that ``under`` can give."""

    def misfit(exponent: float) -> FloatArray:
        solved = in_order(partial(_coarsely, under(exponent), joint), data)
        return np.array([posterior.held_out_costs(solution.mu).sum() for posterior, solution in solved])

    return under(likeliest_exponent(misfit, config.exponent, config.exponent_spread))


def _with_common_beam(tables: Tables, solved: Sequence[tuple[Posterior, Solution]]) -> Tables:
    """Move the beam pattern by what all windows' deviations have in common, each knot as far as it was seen."""
    evidence = [p.curvature(s.x, s.mu).beam_information for p, s in solved]
    towards = np.sum([e * s.x.beam for e, (_, s) in zip(evidence, solved, strict=True)], axis=0)
    belief = solved[0][0].prior.beam
    steps = [np.linalg.solve(belief + np.diag(e), t) for e, t in zip(np.sum(evidence, axis=0), towards, strict=True)]
    return replace(tables, log_beam=tables.log_beam + np.stack(steps))
