"""Anywhere: what to search where nothing is known of a relative pose but that the submaps overlap."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import planar_pose
from frontend.priors import Prior
from frontend.relief import Relief

_SHARE = 0.65  # of both radii: farther apart, rectangles share less than a quarter
_HALF_CIRCLE = 1.6  # half-width of the gate in yaw over half a circle: the ellipsoid's waist holds all headings
_WAIST = 1.3  # half-width in x and y over what is wanted at the opposite heading, where the ellipsoid is narrower


def anywhere(target: Relief, source: Relief, n_sigmas: float = 3.0) -> Prior:
    """Gate that holds every pose at which two submaps overlap by a quarter, heading unknown.

    Parameters
    ----------
    target, source : Relief
        The two submaps; both must know some floor.
    n_sigmas : float
        Half-width that the gate is to have [standard deviations].

    Returns
    -------
    prior : Prior
        Centred where the submaps' middles coincide. Its volume, by which chance is counted, is up to twice that of the
        poses wanted.
    """
    reach = _SHARE * (_radius(target) + _radius(source)) + float(np.hypot(*source.centre))
    limit = float(np.sqrt(Prior(np.eye(4), np.eye(6), n_sigmas).limit))
    shift, turn = (_WAIST * reach / limit) ** 2, (_HALF_CIRCLE * np.pi / limit) ** 2
    x, y = target.centre
    return Prior(planar_pose(float(x), float(y), 0.0), np.diag([1.0, 1.0, turn, shift, shift, 1.0]), n_sigmas)


def _radius(relief: Relief) -> float:
    """Distance of the farthest trusted cell from their middle [m]."""
    rows, columns = np.nonzero(relief.is_trusted)
    cells: FloatArray = np.column_stack([columns, rows]) * relief.spacing + np.array(relief.origin) - relief.centre
    return float(np.hypot(*cells.T).max())
