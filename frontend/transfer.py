"""What the numbers of a recording are: amplitude, intensity or logarithm, judged by their speckle where nobody says."""

from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from frontend.arrays import AnyArray, FloatArray
from frontend.recording import Quantity, Recording
from frontend.speckle import Speckle, asymmetry_of_looks, looks_of_spread, measure_speckle, spread_of_looks

DECIBEL = float(np.log(10.0) / 10.0)  # natural logarithm of intensity in a decibel

_POWER = {Quantity.INTENSITY: 1.0, Quantity.AMPLITUDE: 0.5}  # the number is intensity to this power
_SURE, _LIKELY = 0.9, 0.7
# Standard deviations of what the models leave out: exponent, asymmetry, and asymmetry that texture takes away.
_EXPONENT_SIGMA, _ASYMMETRY_SIGMA, _TEXTURE_SIGMA = 0.2, 0.025, 0.3
_PURE_SPREAD = 0.1  # logarithm of the upper to the lower quartile of spread, of speckle alone
_LOOKS = (0.8, 30.0)  # what recorders give: a rough floor makes one less, much averaging makes many
_LOOKS_SIGMA = 0.25
_WHOLE_ODDS = 3.0  # whole numbers are amplitudes so many times as often as intensities
_RANGE, _RANGE_SIGMA = 70.0, 0.5  # dynamic range of logarithmic recorders [dB], and its spread as a logarithm
_STEP_SIGMA = 0.1  # spread of the unit of logarithms that are no whole numbers: decibels
_CLIPPED, _HEAP = 1e-3, 5.0  # share of samples at the greatest number, and how many times that of the next ones


@dataclass(frozen=True)
class Transfer:
    """How recorded numbers come from intensities.

    Parameters
    ----------
    quantity : Quantity
        What they are: amplitude, intensity or logarithm.
    step : float
        Natural logarithm of intensity in one recorded unit, where they are logarithms; a decibel elsewhere.
    confidence : float
        Probability that the quantity is right, 1 where the recording says it.
    saturation : float
        Greatest number, where echoes were clipped to it; infinite where none were.
    words : str
        The same for people, a sentence or two.
    """

    quantity: Quantity
    step: float = DECIBEL
    confidence: float = 1.0
    saturation: float = np.inf
    words: str = ""

    def intensity(self, echoes: AnyArray) -> FloatArray:
        """Intensities of recorded numbers, of any unit; NaN where a number is not finite."""
        return to_intensity(echoes, self.quantity, self.step)


def to_intensity(echoes: AnyArray, quantity: Quantity, step: float = DECIBEL) -> FloatArray:
    """Intensities of recorded numbers.

    Parameters
    ----------
    echoes : ndarray
        Recorded numbers.
    quantity : Quantity
        What they are.
    step : float
        Natural logarithm of intensity in one unit of a logarithm; a decibel if nothing is said.

    Returns
    -------
    intensity : ndarray of float64
        Squared amplitudes, or powers, or the numbers themselves; NaN where that is not finite.
    """
    values = np.array(echoes, dtype=np.float64)
    if quantity == Quantity.AMPLITUDE:
        values = values**2
    elif quantity == Quantity.LOG:
        with np.errstate(over="ignore"):
            values = np.exp(values * step)
    values[~np.isfinite(values)] = np.nan
    return values


def estimate_transfer(recording: Recording) -> Transfer:
    """Judge what the numbers of a recording are.

    Parameters
    ----------
    recording : Recording
        The dive; what it says itself is believed.

    Returns
    -------
    transfer : Transfer
        Never of unknown quantity.

    Notes
    -----
    In small patches of even floor, numbers differ by speckle alone: a gamma distribution of L looks. The spread of
    amplitudes and intensities grows with their mean, that of logarithms does not. Between the former decides the
    asymmetry of their logarithms, which depends on L alone, while spread depends on L and the power; texture makes it
    less. One unit of a logarithm is what gives speckle the variance that it must have, trigamma(L).
    """
    said, speckle, saturation = recording.sonar.quantity, measure_speckle(recording), _saturation(recording)
    if speckle is None:
        return _without_speckle(said, saturation)
    odds = _odds(speckle)
    quantity = _decide(odds) if said == Quantity.UNKNOWN else said
    step = _log_law(speckle)[1] if quantity == Quantity.LOG else DECIBEL
    words = _sentence(said, quantity, odds)
    if quantity == Quantity.LOG:
        words += f" One unit is {step / DECIBEL:.2g} dB."
    if np.isfinite(saturation):
        words += f" Echoes above {saturation:.6g} were clipped."
    confidence = odds[quantity] if said == Quantity.UNKNOWN else 1.0
    return Transfer(quantity, step, confidence, saturation, words)


def _without_speckle(said: Quantity, saturation: float) -> Transfer:
    if said != Quantity.UNKNOWN:
        return Transfer(said, DECIBEL, 1.0, saturation, f"Samples taken for {said}, as the recording says.")
    words = "Samples taken for amplitude, as most recorders give: there is too little to judge by."
    return Transfer(Quantity.AMPLITUDE, DECIBEL, 1 / 3, saturation, words)


def _odds(speckle: Speckle) -> dict[Quantity, float]:
    """Probability of each quantity."""
    scores = {quantity: _power_law(speckle, power) for quantity, power in _POWER.items()}
    if speckle.full_scale is not None:
        scores[Quantity.INTENSITY] += float(np.log(_WHOLE_ODDS))
    scores[Quantity.LOG] = _log_law(speckle)[0] + _exponent_misfit(speckle, 0.0)
    if speckle.has_negative:
        scores[Quantity.LOG] = min(scores.values()) - 20.0
    shares = softmax([-score for score in scores.values()])
    return {quantity: float(share) for quantity, share in zip(scores, shares, strict=True)}


def _decide(odds: dict[Quantity, float]) -> Quantity:
    """The most probable; amplitude, which most recorders give, where it cannot be told from intensity."""
    best = max(odds, key=lambda quantity: odds[quantity])
    return best if odds[best] >= _LIKELY or best == Quantity.LOG else Quantity.AMPLITUDE


def _exponent_misfit(speckle: Speckle, exponent: float) -> float:
    sigma = np.hypot(speckle.exponent_sigma, _EXPONENT_SIGMA)
    return float(0.5 * ((speckle.exponent - exponent) / sigma) ** 2)


def _asymmetry_misfit(measured: float, looks: float, spread_range: float) -> float:
    """Texture only makes logarithms more symmetric; how much there is shows in how the spread differs."""
    difference = measured - asymmetry_of_looks(looks)
    texture = _TEXTURE_SIGMA * max(0.0, spread_range - _PURE_SPREAD) if difference > 0 else 0.0
    return float(0.5 * (difference / (_ASYMMETRY_SIGMA + texture)) ** 2)


def _power_law(speckle: Speckle, power: float) -> float:
    """Misfit of a power of intensity."""
    looks = looks_of_spread(speckle.log_spread / power)
    beyond = max(0.0, np.log(_LOOKS[0] / looks), np.log(looks / _LOOKS[1]))
    shape = _asymmetry_misfit(speckle.log_asymmetry, looks, speckle.log_spread_range)
    return _exponent_misfit(speckle, 1.0) + shape + float(0.5 * (beyond / _LOOKS_SIGMA) ** 2)


def _log_law(speckle: Speckle) -> tuple[float, float]:
    """Misfit of a logarithm and its unit in nepers of intensity, for the looks that explain it best."""
    best = (np.inf, DECIBEL)
    for looks in np.geomspace(0.7, 30.0, 60):
        step = spread_of_looks(looks) / speckle.spread
        usual, sigma = (1.0, _STEP_SIGMA) if speckle.full_scale is None else (_RANGE / speckle.full_scale, _RANGE_SIGMA)
        misfit = _asymmetry_misfit(speckle.asymmetry, looks, speckle.spread_range)
        misfit += 0.5 * (np.log(step / DECIBEL / usual) / sigma) ** 2
        best = min(best, (float(misfit), float(step)))
    return best


def _sentence(said: Quantity, quantity: Quantity, odds: dict[Quantity, float]) -> str:
    best = max(odds, key=lambda key: odds[key])
    if said != Quantity.UNKNOWN:
        doubt = "" if best == said or odds[best] < _SURE else f", though their speckle is that of {best}"
        return f"Samples taken for {quantity}, as the recording says{doubt}."
    if odds[quantity] >= _SURE:
        return f"Samples taken for {quantity} by their speckle."
    if odds[quantity] >= _LIKELY:
        return f"Samples taken for {quantity} by their speckle, with a probability of {odds[quantity]:.0%} only."
    other = max(odds.keys() - {quantity}, key=lambda key: odds[key])
    return (
        f"Samples taken for {quantity} ({odds[quantity]:.0%}; {other} {odds[other]:.0%}): their speckle does not tell, "
        "say it in the recording if you know."
    )


def _saturation(recording: Recording) -> float:
    """The greatest number, if far more samples have it than those just below."""
    some = slice(None, None, max(1, recording.n_pings // 300))
    values = np.concatenate([recording.port[some].ravel(), recording.starboard[some].ravel()])
    values = values[np.isfinite(values)]
    if not values.size or values.max() == values.min():
        return np.inf
    top = float(values.max())
    at_top = float(np.mean(values == top))
    width = max(1.0, 0.01 * (top - float(np.median(values))))
    below = float(np.mean((values >= top - width) & (values < top))) / (width if top == round(top) else 1.0)
    return top if at_top > _CLIPPED and at_top > _HEAP * below else np.inf
