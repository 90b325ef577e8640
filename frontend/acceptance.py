"""Acceptance: whether a verified alignment is a loop closure, and if not, why."""

from enum import StrEnum

from pydantic import BaseModel, ConfigDict, Field

from frontend.chance import joint_chance
from frontend.priors import Prior
from frontend.probability import ProbabilityConfig, probability
from frontend.verification import Verification


class Rejection(StrEnum):
    """Why a candidate is no loop closure."""

    FLAT = "the relief is too faint against its uncertainty"
    NO_ALIGNMENT = "no alignment inside the gate overlaps enough"
    OUTSIDE_GATE = "the alignment left the gate of the dead reckoning"
    LITTLE_OVERLAP = "the overlap is too small"
    BY_CHANCE = "the correlation may be chance"
    AMBIGUOUS = "another alignment is nearly as good"
    HEIGHTS_DISAGREE = "the heights differ by more than their uncertainty"
    LOOSE = "the alignment is not fixed in every direction"
    OF_NEIGHBOURS = "neighbours of both have seen the floor compared"


class AcceptanceConfig(BaseModel):
    """What is accepted."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    min_overlap: float = Field(
        default=0.25,
        gt=0,
        le=1,
        description="Least overlap [share of the smaller submap]: small ones correlate by chance.",
    )
    probability: ProbabilityConfig = ProbabilityConfig()
    min_probability: float = Field(
        default=0.95,
        gt=0,
        lt=1,
        description="Least probability that the place is the same [1]; the back end asks for agreement on top.",
    )
    min_lead: float = Field(
        default=1.0, ge=0, description="Least lead in significance over the next best alignment [standard deviations]."
    )
    min_lead_anywhere: float = Field(
        default=2.5,
        ge=0,
        description="The same lead where nothing said where the place is or which heading it was seen from [standard "
        "deviations]: every wrong heading has a chance to come near.",
    )
    min_information: float = Field(
        default=0.045,
        ge=0,
        description="Least root-mean-square relief over the height sigma [1]; below, floor is too flat to recognise.",
    )
    max_height_residual: float = Field(
        default=4.0,
        gt=0,
        description="Largest height difference [its standard deviations, root mean square]; sigmas are rough.",
    )
    max_sigma: float = Field(
        default=2.0, gt=0, description="Largest standard deviation of x and y [m]: a ridge fixes one of them only."
    )

    def anywhere(self, n_places: int) -> "AcceptanceConfig":
        """What is accepted of a place that its appearance alone has chosen among many.

        Parameters
        ----------
        n_places : int
            Places it was chosen from, each of which might have been alike by chance.

        Returns
        -------
        config : AcceptanceConfig
            As this one, true pairs as much rarer as there are places, and the lead longer.
        """
        rare = self.probability.model_copy(update={"share": self.probability.share / max(n_places, 1)})
        return self.model_copy(update={"probability": rare, "min_lead": self.min_lead_anywhere})


def decide(verification: Verification, runner_up: float, prior: Prior, config: AcceptanceConfig) -> Rejection | None:
    """Accept a verified alignment, or say why not.

    Parameters
    ----------
    verification : Verification
        The best alignment of a pair.
    runner_up : float
        Significance of the best alignment elsewhere [standard deviations].
    prior : Prior
        Predicted transform with covariance.
    config : AcceptanceConfig
        Thresholds.

    Returns
    -------
    rejection : Rejection or None
        The first rule that is broken; None to accept.
    """
    v, lead = verification, lead_of(verification, runner_up)
    broken = {
        Rejection.OUTSIDE_GATE: not prior.admits(v.T_target_source),
        Rejection.LITTLE_OVERLAP: v.overlap < config.min_overlap,
        Rejection.AMBIGUOUS: lead < config.min_lead,
        Rejection.BY_CHANCE: probability(lead, chance_of(v, prior), config.probability) < config.min_probability,
        Rejection.HEIGHTS_DISAGREE: not v.height_residual <= config.max_height_residual,
        Rejection.LOOSE: not max(v.sigmas[3], v.sigmas[4]) <= config.max_sigma,
    }
    return next((rejection for rejection, is_broken in broken.items() if is_broken), None)


def lead_of(verification: Verification, runner_up: float) -> float:
    """Lead in significance over the best alignment elsewhere.

    Parameters
    ----------
    verification : Verification
        The best alignment of a pair.
    runner_up : float
        Significance of the best alignment elsewhere [standard deviations]; below chance it counts as none.

    Returns
    -------
    lead : float
        Standard deviations.
    """
    return verification.level - max(runner_up, 0.0)


def chance_of(verification: Verification, prior: Prior) -> float:
    """Chance that unrelated floors align as well as verified, their reflectivity heard as a second witness.

    Parameters
    ----------
    verification : Verification
        The best alignment of a pair.
    prior : Prior
        The gate that was searched.

    Returns
    -------
    chance : float
        A probability where it is small.
    """
    v = verification
    areas = (v.overlap_area, v.correlation_area, v.reflectivity_area)
    return joint_chance(v.significance, v.reflectivity_significance, areas, prior)
