"""Calibration of a dive's beam pattern from windows all over it, before it is held fixed in each of them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frontend.arrays import FloatArray
from frontend.bottom import Bottom
from frontend.radiometry import Radiometry, RadiometryConfig, estimate_radiometry, refine
from frontend.reconstruction.forward import angles
from frontend.reconstruction.joint import JointConfig, descend
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.solver import Solution
from frontend.reconstruction.window_data import window_data
from frontend.recording import Recording
from frontend.windows import Window


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
        Beam pattern, range law and noise floor for every window of the dive.

    Notes
    -----
    A slope profile across track that all windows share and a beam pattern cannot be told apart (SCIENCE 7.1); over many
    places true slopes average out, so what is left in the mean is the beam pattern.
    """
    estimate = estimate_radiometry(recording, bottom, radiometry)
    chosen = np.unique(np.linspace(0, len(windows) - 1, min(radiometry.n_windows, len(windows))).astype(int))
    data = [window_data(recording, windows[k], bottom, estimate) for k in chosen]
    for _ in range(radiometry.n_rounds if data else 0):
        solved = [descend(part, estimate, joint, max(1, joint.n_levels - 1))[-1] for part in data]
        evidence = [_evidence(*pair) for pair in solved]
        angle, measured, modelled = (np.concatenate([e[k] for e in evidence], axis=1) for k in range(3))
        estimate = replace(estimate, tables=refine(estimate.tables, angle, measured, modelled, radiometry.smoothness))
    return estimate


def _evidence(posterior: Posterior, solution: Solution) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Shape (2, K): angle, weighted measured and modelled energy above the floor of every bin of a side."""
    bins = posterior.bins
    weight = posterior.data_weight(solution.mu) / solution.mu
    angle = angles(solution.x[0], posterior.raster, posterior.beams, bins)
    parts = (angle, weight * (bins.intensity - bins.floor), weight * (solution.mu - bins.floor))
    first, second, third = (np.swapaxes(part, 0, 1).reshape(2, -1) for part in parts)
    return first, second, third
