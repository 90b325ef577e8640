"""Probability: that a verified alignment shows the same place, learnt from alignments whose truth is known."""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.special import expit, logit


class ProbabilityConfig(BaseModel):
    """What an alignment's numbers say of its truth."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    offset: float = Field(
        default=-3.09,
        description="Log odds [1] of an alignment without lead that one pair of unrelated floors shows; as the two "
        "below, fitted on simulated dives.",
    )
    lead: float = Field(
        default=1.6,
        gt=0,
        description="Log odds a standard deviation [1] by which the best alignment leads the next best one: what "
        "chance and likeness give on this very floor.",
    )
    chance: float = Field(
        default=1.0,
        gt=0,
        description="Log odds a power of ten [1] of the chance that unrelated floors align as well; two fifths of "
        "what an exact one would be worth.",
    )
    share: float = Field(
        default=0.45,
        gt=0,
        lt=1,
        description="Share of all compared pairs [1] that show the same place and are found; that of the fit. A wide "
        "gate lets in fewer.",
    )


_FITTED_SHARE = 0.45  # of true alignments among those that the offset was fitted to
_LEAST, _MOST = 1e-12, 1e2  # chances between which the fit has seen enough of both kinds


def log_odds(lead: float, chance: float, config: ProbabilityConfig | None = None) -> float:
    """Logarithm of how much likelier it is that an alignment is true than that it is false.

    Parameters
    ----------
    lead : float
        Significance of the best alignment less that of the best one elsewhere [standard deviations].
    chance : float
        Expected number of alignments inside the gate at which unrelated floors are as significant.
    config : ProbabilityConfig, optional
        Weights, and how many of the compared pairs are true.

    Returns
    -------
    log_odds : float
        Natural logarithm; 0 is undecided.

    Raises
    ------
    ValueError
        If the lead is not finite, or the chance no number or negative.

    Notes
    -----
    A logistic model. The chance is a theory's, of Gaussian floors; the lead is measured on the pair itself, where
    floors are sparse or repeat themselves. Another share of true pairs changes the odds by Bayes' rule.
    """
    config = config or ProbabilityConfig()
    if not np.isfinite(lead):
        raise ValueError(f"a lead must be finite, got {lead}")
    if not chance >= 0:
        raise ValueError(f"a chance must not be negative, got {chance}")
    decades = -float(np.log10(min(max(chance, _LEAST), _MOST)))
    prior = float(logit(config.share) - logit(_FITTED_SHARE))
    return config.offset + prior + config.lead * lead + config.chance * decades


def probability(lead: float, chance: float, config: ProbabilityConfig | None = None) -> float:
    """Probability that an alignment is true: within 3 m and 5 degrees.

    Parameters
    ----------
    lead, chance : float
        As in `log_odds`.
    config : ProbabilityConfig, optional
        Weights, and how many of the compared pairs are true.

    Returns
    -------
    probability : float
        In [0, 1]. Beyond about 0.999 it extrapolates: no fit has seen enough alignments to tell.

    Examples
    --------
    >>> round(probability(3.0, 1e-3), 2)
    0.99
    >>> round(probability(0.5, 0.1), 2)
    0.15
    """
    return float(expit(log_odds(lead, chance, config)))
