"""How a seafloor scatters: the exponent of the cosine of incidence under which lines kept aside are foretold best."""

from collections.abc import Callable

import numpy as np

from frontend.arrays import FloatArray

_STEP = 0.5 * np.log(2.0)  # between exponents tried, in their logarithm: nearer ones bend no shape
_FARTHEST = 3  # steps above the usual exponent: a factor of 2.8
_FEWEST = 3  # windows that can show how much they differ
_HELD = 0.05  # spread at which the first step away costs 24 in log-likelihood: not worth the trial


def likeliest_exponent(misfit: Callable[[float], FloatArray], usual: float, spread: float) -> float:
    """The exponent that foretells best what was kept aside; the usual one unless windows agree on a larger one.

    Parameters
    ----------
    misfit : callable
        Gives the negative log-likelihood of each window's lines kept aside, shape (K,), under an exponent.
    usual : float
        What is expected [1].
    spread : float
        Standard deviation of the logarithm of exponents about it [1].

    Returns
    -------
    exponent : float
        The usual one, or the vertex of the parabola through the best of those tried and its neighbours.

    Notes
    -----
    In shading, an exponent and the height of relief make up for one another (SCIENCE 7.1, v). What tells them apart is
    what is not linear: shadows, layover, faces that look back at the sonar, roll. Lines that a solution is fitted to
    prefer whatever bends most easily; lines kept aside do not. What all windows gain together must exceed its own
    standard error. Only larger exponents are tried: a floor of exponent 4 taken for 2 is reconstructed with up to a
    third more error, one of exponent 1 taken for 2 with no more (experiments/reconstruction).
    """
    if spread <= _HELD:
        return usual
    at_usual = misfit(usual)
    if len(at_usual) < _FEWEST:
        return usual
    scores = [0.0]
    while len(scores) <= _FARTHEST and scores[-1] <= min(scores):
        worse = misfit(float(usual * np.exp(_STEP * len(scores)))) - at_usual
        prior = 0.5 * (_STEP * len(scores) / spread) ** 2
        scores.append(float(worse.sum() + np.sqrt(len(worse)) * worse.std(ddof=1)) + prior)
    best = int(np.argmin(scores))
    return float(usual * np.exp(_STEP * _vertex(scores, best))) if best else usual


def _vertex(scores: list[float], best: int) -> float:
    """Where a parabola through the best and its neighbours is lowest; the best where the next was not tried."""
    if best + 1 == len(scores):
        return float(best)
    left, right = scores[best - 1] - scores[best], scores[best + 1] - scores[best]
    return best + 0.5 * (left - right) / max(left + right, 1e-12)
