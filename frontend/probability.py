"""Probability: that a verified alignment shows the same place, learnt from alignments whose truth is known."""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.special import expit, logit


class ProbabilityConfig(BaseModel):
    """What an alignment's numbers say of its truth."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    offset: float = Field(
        default=-6.3,
        description="Log odds [1] of an alignment without lead or correlation; as the two below, fitted on simulated "
        "dives.",
    )
    lead: float = Field(
        default=1.6,
        gt=0,
        description="Log odds a standard deviation [1] by which the best alignment leads the next best one.",
    )
    correlation: float = Field(
        default=15.0,
        gt=0,
        description="Log odds a unit of correlation of the heights [1]: sparse boulders lead by chance, but correlate "
        "little.",
    )
    share: float = Field(
        default=0.45,
        gt=0,
        lt=1,
        description="Share of all compared pairs [1] that show the same place and are found; that of the fit. A wide "
        "gate lets in fewer.",
    )


_FITTED_SHARE = 0.45  # of true alignments among those that the offset was fitted to


def log_odds(
    significance: float, runner_up: float, correlation: float, config: ProbabilityConfig | None = None
) -> float:
    """Logarithm of how much likelier it is that an alignment is true than that it is false.

    Parameters
    ----------
    significance : float
        Of the best alignment inside the gate [standard deviations above chance].
    runner_up : float
        The same of the best alignment elsewhere; below 0 it counts as none.
    correlation : float
        Of the heights over the overlap, in [-1, 1].
    config : ProbabilityConfig, optional
        Weights, and how many of the compared pairs are true.

    Returns
    -------
    log_odds : float
        Natural logarithm; 0 is undecided.

    Raises
    ------
    ValueError
        If a number is not finite, or the correlation is none.

    Notes
    -----
    A logistic model. The lead is that over the best of all other alignments that the same search found, so a wider
    gate, whose chance peaks are higher, needs no term of its own. Another share of true pairs changes the odds by
    Bayes' rule.
    """
    config = config or ProbabilityConfig()
    if not np.isfinite([significance, runner_up]).all():
        raise ValueError(f"significances must be finite, got {significance} and {runner_up}")
    if not -1 <= correlation <= 1:
        raise ValueError(f"a correlation lies between -1 and 1, got {correlation}")
    lead = significance - max(runner_up, 0.0)
    prior = logit(config.share) - logit(_FITTED_SHARE)
    return float(config.offset + prior + config.lead * lead + config.correlation * correlation)


def probability(
    significance: float, runner_up: float, correlation: float, config: ProbabilityConfig | None = None
) -> float:
    """Probability that an alignment is true: within 3 m and 5 degrees.

    Parameters
    ----------
    significance, runner_up, correlation : float
        As in `log_odds`.
    config : ProbabilityConfig, optional
        Weights, and how many of the compared pairs are true.

    Returns
    -------
    probability : float
        In [0, 1]. Beyond about 0.999 it extrapolates: no fit has seen enough alignments to tell.

    Examples
    --------
    >>> round(probability(7.0, 4.0, 0.4), 2)
    0.99
    >>> round(probability(5.0, 4.5, 0.2), 2)
    0.08
    """
    return float(expit(log_odds(significance, runner_up, correlation, config)))
