"""Chance: how well unrelated seafloors correlate, and how often as well as a given pair."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.priors import Prior


def significance(correlation: FloatArray, overlap_area: FloatArray, correlation_area: float) -> FloatArray:
    """How many standard deviations a correlation lies above that of unrelated rasters.

    Parameters
    ----------
    correlation : ndarray, shape (...)
        Correlation coefficients [1].
    overlap_area : ndarray, shape (...)
        Area over which each was taken [m^2].
    correlation_area : float
        Area that tells one independent thing [m^2].

    Returns
    -------
    significance : ndarray, shape (...)
        Fisher's ``atanh(correlation) sqrt(n - 3)`` with ``n = overlap_area / correlation_area``; 0 where n <= 3.
    """
    n = np.asarray(overlap_area) / correlation_area
    return np.asarray(np.arctanh(np.clip(correlation, -0.999999, 0.999999)) * np.sqrt(np.maximum(n - 3.0, 0.0)))


def pooled(by_shape: FloatArray, by_echo: FloatArray) -> FloatArray:
    """Significance of two witnesses, of which the second may have nothing to say.

    Parameters
    ----------
    by_shape, by_echo : ndarray, shape (...)
        Significance of the reliefs' correlation and of the reflectivities' [standard deviations].

    Returns
    -------
    significance : ndarray, shape (...)
        The larger of ``by_shape`` and ``(by_shape + by_echo) / sqrt(2)``, both of unit variance by chance. A
        reflectivity that contradicts is not held against the relief: slopes leak into it, with another sign from
        another heading.
    """
    return np.asarray(np.maximum(by_shape, (by_shape + by_echo) / np.sqrt(2)))


def expected_by_chance(significance: float, overlap_area: float, correlation_area: float, prior: Prior) -> float:
    """Expected number of alignments inside a gate that are as significant though the floors are unrelated.

    Parameters
    ----------
    significance : float
        Of the best alignment found [standard deviations].
    overlap_area, correlation_area : float
        As in `significance` [m^2].
    prior : Prior
        Its gate is what was searched.

    Returns
    -------
    expected : float
        A probability where it is small.

    Notes
    -----
    The significance over x, y and yaw is taken as a smooth Gaussian random field of unit variance: it exceeds a high
    level u in ``V |L|^(1/2) (u^2 - 1) exp(-u^2 / 2) / (2 pi)^2`` places (Adler 1981), V being the searched volume and L
    the covariance of its gradient. A relief with a Gaussian autocorrelation of integral A (squared) gives
    ``pi / (2 A)`` along x and y, and that times the mean squared radius of the overlap, ``area / (2 pi)``, along yaw.
    """
    level = max(significance, np.sqrt(3.0))  # the formula's maximum: below, it counts hollows as well as peaks
    volume = 4 / 3 * np.pi * np.sqrt(np.linalg.det(prior.planar_covariance)) * prior.limit**1.5
    gradient = np.pi / (2 * correlation_area)
    density = gradient**1.5 * np.sqrt(overlap_area / (2 * np.pi)) / (2 * np.pi) ** 2
    return float(volume * density * (level**2 - 1) * np.exp(-(level**2) / 2))


def joint_chance(by_shape: float, by_echo: float, areas: tuple[float, float, float], prior: Prior) -> float:
    """Expected number of alignments inside a gate at which unrelated floors are as significant by either of two sums.

    Parameters
    ----------
    by_shape, by_echo : float
        Significance of the reliefs' correlation and of the reflectivities' [standard deviations].
    areas : tuple of float
        Area compared, and how much of it tells one independent thing of relief and of reflectivity [m^2].
    prior : Prior
        The gate that was searched.

    Returns
    -------
    expected : float
        A probability where it is small: that of `pooled`, which has two tries.
    """
    overlap, area, area_r = areas
    alone = expected_by_chance(by_shape, overlap, area, prior)
    both = expected_by_chance((by_shape + by_echo) / np.sqrt(2), overlap, float(np.sqrt(area * area_r)), prior)
    return 2 * min(alone, both)
