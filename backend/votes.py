"""Votes: which loop closures are independent witnesses, and how many of them it takes."""

from math import ceil

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from backend.arrays import IntArray
from backend.innovations import Innovations

_WINDOWS_A_STRETCH = 2.0  # nearer, submaps were compared with much the same surroundings
_USUAL_OVERLAP = 0.5  # of windows of which nothing is known
_SCALE_STEP = np.sqrt(2.0)  # from one scale of the odometry to the next; finer than any few closures can tell


class ConsistencyConfig(BaseModel):
    """Which sets of loop closures are believed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    pair_probability: float = Field(
        default=0.999,
        gt=0,
        lt=1,
        description="Share of pairs of true closures [1] that pass as consistent; high, as one failure splits a set.",
    )
    stretch: int | None = Field(
        default=None,
        ge=1,
        description="Closures nearer at both ends [anchors] share a vote and maybe an error; unset: two window "
        "lengths, 4 anchors where windows overlap by half and 10 where by 0.8.",
    )
    repeat_vote: float = Field(
        default=0.1,
        ge=0,
        le=1,
        description="Worth of a further closure between the same stretches [votes]; little in it is new.",
    )
    min_votes: int = Field(
        default=2,
        ge=1,
        description="Independent closures [votes] that must agree before any is believed; 1 believes a single one.",
    )
    false_cost: float = Field(
        default=2.0,
        gt=0,
        description="How much worse a false closure is than a missing one [1]; true ones repeat each other.",
    )
    max_lone_chance: float = Field(
        default=1e-6,
        ge=0,
        description="Expected false closures of a dive [1] as good as one that is believed alone; 0 believes none.",
    )
    max_lone_reach: float = Field(
        default=5.0,
        gt=0,
        description="Standard deviation of dead reckoning [m] up to which one is believed alone; beyond, a like "
        "structure may lie inside the gate.",
    )
    max_set_chance: float = Field(
        default=0.1,
        gt=0,
        description="Expected sets of independent false closures [1] that agree as well as the one believed: of many "
        "closures some few agree by chance.",
    )
    alias_odds: float = Field(
        default=0.1,
        gt=0,
        description="How likely closures that are all wrong by one offset are, beside closures that are all true [1].",
    )
    max_odometry_scale: float = Field(
        default=4.0,
        ge=1,
        description="Largest factor [1] by which odometry may be worse than its model; beyond, the model is wrong.",
    )
    n_hypotheses: int = Field(
        default=5,
        ge=1,
        description="Sets [1] looked at closely; the one that explains most at first sight need not be true.",
    )
    max_closures: int = Field(
        default=150,
        ge=2,
        description="Closures [1] compared with one another; more are thinned, and the rest judged by those.",
    )
    max_steps: int = Field(
        default=3_000, ge=0, description="Vertices [1] that a clique search may look at; exact up to some 50 closures."
    )


def suit_overlap(config: ConsistencyConfig, overlap: float) -> ConsistencyConfig:
    """Choose how many anchors apart closures have a vote of their own.

    Parameters
    ----------
    config : ConsistencyConfig
        Which sets are believed; a stretch that is set is kept.
    overlap : float
        Share of a window that the next one repeats [1].

    Returns
    -------
    config : ConsistencyConfig
        With the stretch of two window lengths: there are ``1 / (1 - overlap)`` anchors in one.

    Examples
    --------
    >>> [suit_overlap(ConsistencyConfig(), overlap).stretch for overlap in (0.0, 0.5, 0.8)]
    [2, 4, 10]
    """
    if config.stretch is not None:
        return config
    return config.model_copy(update={"stretch": ceil(_WINDOWS_A_STRETCH / (1.0 - overlap) - 1e-9)})


def group_closures(first: IntArray, last: IntArray, stretch: int) -> IntArray:
    """Group closures between the same two stretches of the track.

    Parameters
    ----------
    first, last : ndarray of int, shape (C,)
        The anchors that each closure joins.
    stretch : int
        A closure joins the group whose founder is fewer anchors away at both ends.

    Returns
    -------
    group : ndarray of int, shape (C,)
        Number of each closure's group.
    """
    group = np.full(len(first), -1, dtype=np.int64)
    n_groups = 0
    for closure in np.lexsort((last, first)):
        if group[closure] < 0:
            is_near = (np.abs(first - first[closure]) < stretch) & (np.abs(last - last[closure]) < stretch)
            group[is_near & (group < 0)] = n_groups
            n_groups += 1
    return group


def stretch_of(config: ConsistencyConfig) -> int:
    """How many anchors apart closures have a vote of their own.

    Parameters
    ----------
    config : ConsistencyConfig
        Which closures share a vote.

    Returns
    -------
    stretch : int
        As set; else that of windows that overlap by half.
    """
    stretch = suit_overlap(config, _USUAL_OVERLAP).stretch
    assert stretch is not None
    return stretch


def count_votes(members: Innovations, config: ConsistencyConfig) -> int:
    """Count the independent closures of a set.

    Parameters
    ----------
    members : Innovations
        The set.
    config : ConsistencyConfig
        Which closures share a vote.

    Returns
    -------
    n_votes : int
        Number of groups.
    """
    return len(founders(members, config))


def founders(members: Innovations, config: ConsistencyConfig) -> IntArray:
    """Pick one closure of each group.

    Parameters
    ----------
    members : Innovations
        Some closures.
    config : ConsistencyConfig
        Which of them share a vote.

    Returns
    -------
    founders : ndarray of int, shape (V,)
        Positions of the first of each group, ascending.
    """
    return np.sort(np.unique(group_closures(members.first, members.last, stretch_of(config)), return_index=True)[1])


def scales_of(config: ConsistencyConfig) -> list[float]:
    """List the factors by which odometry may be worse than its model.

    Parameters
    ----------
    config : ConsistencyConfig
        The largest of them.

    Returns
    -------
    scales : list of float
        From one.
    """
    n_steps = int(np.floor(np.log(config.max_odometry_scale) / np.log(_SCALE_STEP) + 1e-9))
    return [float(_SCALE_STEP**step) for step in range(n_steps + 1)]
