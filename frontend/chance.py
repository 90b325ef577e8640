"""Chance: how well unrelated seafloors correlate, and how often as well as a given pair."""

import numpy as np
from scipy.special import ndtr

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


def joint_chance(first: float, second_significance: float) -> float:
    """Chance that two independent witnesses agree as well as they do (Fisher's method).

    Parameters
    ----------
    first : float
        Chance of the first witness [1].
    second_significance : float
        Significance of the second at the place that the first has chosen [standard deviations].

    Returns
    -------
    chance : float
        ``x (1 - ln x)`` with x the product of both chances, at most 1.
    """
    product = min(first, 1.0) * float(ndtr(-second_significance))
    return product * (1 - np.log(product)) if product > 0 else 0.0
