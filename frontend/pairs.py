"""Pairs: which submaps may show the same place, by dead reckoning."""

from collections.abc import Callable, Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.frames import invert
from frontend.priors import Prior
from frontend.submaps import Submap
from frontend.trajectory import Trajectory

PriorCovariance = Callable[[int, int], FloatArray]


class PairConfig(BaseModel):
    """Which submaps are compared."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    gate: float = Field(
        default=3.0, gt=0, description="Half-width of the gate around dead reckoning [standard deviations]."
    )
    min_separation: float = Field(
        default=2.0,
        gt=0,
        description="Distance along the track between two submaps [window lengths]; nearer ones are odometry.",
    )
    min_overlap: float = Field(
        default=0.2,
        gt=0,
        le=1,
        description="Overlap that must be possible inside the gate [share of the smaller submap].",
    )


_OUTLINE_STEP = 5.0  # [m] between the cells that stand for a submap's coverage


def pairs_to_compare(
    submaps: Sequence[Submap],
    trajectory_dr: Trajectory,
    prior_covariance: PriorCovariance,
    config: PairConfig | None = None,
) -> list[tuple[int, int]]:
    """Pairs of submaps that are no neighbours and may overlap inside the gate.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps of a dive, in order.
    trajectory_dr : Trajectory
        Dead-reckoned body poses of all pings of the recording.
    prior_covariance : callable
        Covariance (6, 6) of ``T_target_source`` by dead reckoning for two positions in ``submaps``.
    config : PairConfig, optional
        Gate and distances.

    Returns
    -------
    pairs : list of (int, int)
        Positions in ``submaps``, target before source.
    """
    config = config or PairConfig()
    distance = trajectory_dr.distance
    coverage = [_coverage(submap) for submap in submaps]
    pairs = []
    for source in range(len(submaps)):
        for target in range(source):
            if not _is_apart(submaps[target], submaps[source], distance, config.min_separation):
                continue
            T_dr = predicted_transform(submaps[target], submaps[source])
            prior = Prior(T_dr, prior_covariance(target, source), config.gate)
            if _possible_overlap(coverage[target], coverage[source], prior) >= config.min_overlap:
                pairs.append((target, source))
    return pairs


def predicted_transform(target: Submap, source: Submap) -> FloatArray:
    """Transform between two submaps by dead reckoning.

    Parameters
    ----------
    target, source : Submap
        The two submaps.

    Returns
    -------
    T_target_source : ndarray, shape (4, 4)
        Takes points of the source's level frame to the target's.
    """
    return np.asarray(invert(target.T_world_submap_dr) @ source.T_world_submap_dr)


def _is_apart(target: Submap, source: Submap, distance: FloatArray, n_windows: float) -> bool:
    """Whether two submaps share no ping and lie far enough apart along the track."""
    if target.end_ping > source.first_ping:
        return False
    length = max(distance[s.end_ping - 1] - distance[s.first_ping] for s in (target, source))
    return bool(distance[source.anchor_ping] - distance[target.anchor_ping] > n_windows * length)


def _coverage(submap: Submap) -> FloatArray:
    """Every few metres a known cell, shape (K, 2) [m]."""
    step = max(round(_OUTLINE_STEP / submap.surface.spacing), 1)
    x, y = np.meshgrid(submap.surface.x[::step], submap.surface.y[::step])
    return np.stack([x, y], axis=-1)[submap.is_known[::step, ::step]]


def _possible_overlap(target: FloatArray, source: FloatArray, prior: Prior) -> float:
    """Share of the smaller coverage that overlaps when the source is drawn to the target as far as the gate allows."""
    if not len(target) or not len(source):
        return 0.0
    T = prior.T_target_source
    moved = source @ T[:2, :2].T + T[:2, 3]
    towards = target.mean(axis=0) - moved.mean(axis=0)
    reach = np.sqrt(prior.limit / max(float(towards @ np.linalg.inv(prior.planar_covariance[:2, :2]) @ towards), 1e-12))
    moved = moved + min(float(reach), 1.0) * towards
    cells = {tuple(cell) for cell in np.rint(target / _OUTLINE_STEP).astype(int)}
    n_common = sum(tuple(cell) in cells for cell in np.rint(moved / _OUTLINE_STEP).astype(int))
    return float(n_common / min(len(target), len(source)))
