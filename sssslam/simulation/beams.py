"""Beam patterns as tables: power against angle, one way."""

import numpy as np

from frontend.arrays import FloatArray
from sssslam.simulation.sonar import SonarConfig

VERTICAL_STEP = float(np.radians(0.25))
_HALF_POWER_SINC = 0.442946  # sinc(x)^2 = 1/2


def vertical_pattern(sonar: SonarConfig) -> FloatArray:
    """Tabulate the vertical beam pattern.

    Parameters
    ----------
    sonar : SonarConfig
        Width, depression, shape of the main lobe, and sidelobe level.

    Returns
    -------
    pattern : ndarray, shape (1441,)
        Power re the axis, one way, at off-nadir angles from -pi to pi in steps of a quarter of a degree; positive
        angles lie on the array's own side.
    """
    off_nadir = np.radians(np.arange(-720, 721) * 0.25)
    off_axis = (off_nadir - 0.5 * np.pi + np.radians(sonar.depression_deg) + np.pi) % (2 * np.pi) - np.pi
    floor = 10 ** (0.1 * sonar.sidelobe_level)
    return np.asarray(floor + (1.0 - floor) * _main_lobe(sonar, off_axis))


def _main_lobe(sonar: SonarConfig, off_axis: FloatArray) -> FloatArray:
    half_width = 0.5 * np.radians(sonar.vertical_beamwidth_deg)
    if sonar.vertical_shape == "gaussian":
        return np.asarray(0.5 ** ((off_axis / half_width) ** 2))
    lobe = np.sinc(_HALF_POWER_SINC * np.sin(off_axis) / np.sin(half_width)) ** 2
    return np.where(np.abs(off_axis) < 0.5 * np.pi, lobe, 0.0)


def horizontal_pattern(offset: FloatArray) -> FloatArray:
    """Power of a uniform line array, one way.

    Parameters
    ----------
    offset : ndarray
        Along-track distance from the axis in units of the beam's -3 dB width.

    Returns
    -------
    pattern : ndarray
        Power re the axis.
    """
    return np.asarray(np.sinc(2 * _HALF_POWER_SINC * offset) ** 2)


def sub_beams(sonar: SonarConfig) -> FloatArray:
    """Offsets of the rays side by side over the horizontal beam.

    Parameters
    ----------
    sonar : SonarConfig
        Number of rays and how far they reach.

    Returns
    -------
    offset : ndarray, shape (n_sub_beams,)
        Middles of equal intervals over the beam, in units of its -3 dB width.
    """
    n = sonar.n_sub_beams
    return np.asarray(sonar.sub_beam_extent * ((2 * np.arange(n) + 1) / n - 1))
