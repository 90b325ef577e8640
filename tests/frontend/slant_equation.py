"""Equation 3 of Woock 2011: the slant range of places on a flat floor, the judge of its inverse."""

import numpy as np
from numpy.typing import ArrayLike

from frontend.arrays import FloatArray
from frontend.geometry import first_ray_angle


def extended_slant_range(
    ground_range: ArrayLike, first_return: ArrayLike, roll: ArrayLike, inner_angle: float
) -> FloatArray:
    """Slant range (N, 2, M) at distances from nadir, NaN nearer than the foot of the first usable ray [m].

    ``r_s**2 = b**2 + r_g**2 - 2 b r_g cos(phi)``, with r_g counted from that foot.
    """
    b = np.asarray(first_return, dtype=np.float64)[..., None]
    angle = first_ray_angle(roll, inner_angle)[..., None]
    beyond = np.asarray(ground_range, dtype=np.float64) - b * np.sin(angle)
    square = b**2 + beyond**2 - 2 * b * beyond * np.cos(np.pi / 2 + angle)
    return np.sqrt(np.where(beyond >= -1e-9 * b, square, np.nan))
