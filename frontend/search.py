"""Search: where inside the gate of a prior two submaps correlate, by relief or by relief and reflectivity."""

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.chance import pooled, significance
from frontend.correlation import Shifts, common_size, correlate
from frontend.frames import planar_pose, wrap_angle
from frontend.priors import Prior
from frontend.relief import Relief
from frontend.turning import Turned, TurnedRelief
from frontend.verification import joint_area, joint_reflectivity_area


class SearchConfig(BaseModel):
    """How the gate of a prior is searched."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    search_spacing: float = Field(
        default=2.0, gt=0, description="Cell of the search over shifts [m]; half the shortest relief wave."
    )
    yaw_step: float = Field(
        default=0.035, gt=0, description="Step of the search over yaw [rad]: 2 m at the edge of a submap."
    )
    min_overlap: float = Field(
        default=0.25, gt=0, le=1, description="Share of the smaller submap [1] below which chance correlates well."
    )
    separation: float = Field(
        default=8.0, gt=0, description="Peaks closer than this [m] are one: the width of a peak of correlation."
    )
    n_peaks: int = Field(default=3, ge=2, description="Peaks handed on [1]; two show whether the first is alone.")


@dataclass(frozen=True)
class Peak:
    """A place where two reliefs correlate.

    Parameters
    ----------
    T_target_source : ndarray, shape (4, 4)
        Level: yaw and shift, to a search cell.
    significance : float
        Standard deviations above chance [1].
    correlation : float
        Masked normalised cross-correlation [1].
    """

    T_target_source: FloatArray
    significance: float
    correlation: float


def propose(target: Relief, source: Relief, prior: Prior, config: SearchConfig | None = None) -> list[Peak]:
    """Search the gate of a prior for places where two reliefs correlate.

    Parameters
    ----------
    target, source : Relief
        The two submaps.
    prior : Prior
        Predicted transform with covariance.
    config : SearchConfig, optional
        Steps of the search.

    Returns
    -------
    peaks : list of Peak
        Distinct maxima inside the gate whose overlap suffices, the most significant first.
    """
    config = config or SearchConfig()
    step, spacing = config.yaw_step, config.search_spacing
    return search(TurnedRelief(target, 0.0, step, spacing), TurnedRelief(source, 0.0, step, spacing), prior, config)


def search(target: TurnedRelief, source: TurnedRelief, prior: Prior, config: SearchConfig | None = None) -> list[Peak]:
    """Search as `propose` does, with reliefs whose turned copies are kept from one partner to the next.

    Parameters
    ----------
    target, source : TurnedRelief
        The two submaps, turned by steps of `SearchConfig.yaw_step` to cells of `SearchConfig.search_spacing`.
    prior : Prior
        Predicted transform with covariance.
    config : SearchConfig, optional
        Steps of the search.

    Returns
    -------
    peaks : list of Peak
        As `propose` gives them.
    """
    config = config or SearchConfig()
    least = config.min_overlap * min(target.relief.area, source.relief.area)
    gate, steps = _gate(prior, target.yaw(0)), _steps(target, source, prior)
    found = np.concatenate([np.empty((6, 0)), *(_found(target, source, k, gate, least) for k in steps)], axis=1)
    areas = [area(target.relief, source.relief) for area in (joint_area, joint_reflectivity_area)]
    by_shape, by_echo = (significance(found[k], found[2], areas[k]) for k in (0, 1))
    return _peaks(pooled(by_shape, by_echo), found, config)


def _steps(target: TurnedRelief, source: TurnedRelief, prior: Prior) -> range:
    """Turns of the source, in steps from its heading, that cover the gate."""
    middle = float(wrap_angle(prior.planar[2] + target.yaw(0) - source.yaw(0)))
    reach = _yaw_reach(prior)
    return range(round((middle - reach) / source.step), round((middle + reach) / source.step) + 1)


def _yaw_reach(prior: Prior) -> float:
    """Half-width of the gate in yaw [rad]."""
    return float(min(prior.n_sigmas * prior.sigma_yaw, np.pi))


def _held(yaw: FloatArray, prior: Prior) -> FloatArray:
    """Yaws held inside the gate, which the outermost turns leave by half a step."""
    reach = _yaw_reach(prior)
    return np.asarray(prior.planar[2] + np.clip(wrap_angle(yaw - prior.planar[2]), -reach, reach))


class _Gate(NamedTuple):
    """A prior's gate: its information, the turn to the axes of shifts, and the box it fills along these [m]."""

    prior: Prior
    information: FloatArray
    R: FloatArray
    low: FloatArray
    high: FloatArray


def _gate(prior: Prior, yaw: float) -> _Gate:
    """The gate for shifts along the axes of a target turned by a yaw."""
    R = planar_pose(0.0, 0.0, yaw)[:2, :2]
    middle = R @ np.array(prior.planar[:2])
    reach = np.sqrt(prior.limit * np.diag(R @ prior.planar_covariance[:2, :2] @ R.T))
    return _Gate(
        prior, np.asarray(np.linalg.inv(prior.planar_covariance), dtype=np.float64), R, middle - reach, middle + reach
    )


def _found(target: TurnedRelief, source: TurnedRelief, k: int, gate: _Gate, least: float) -> FloatArray:
    """Both correlations, overlap [m^2], x, y [m] and yaw of the source where it may lie, shape (6, S)."""
    a, b = target.at(0), source.at(k)
    shifts = _shifts(a, b, gate.low, gate.high)
    if shifts is None:
        return np.empty((6, 0))
    rows, columns = (common_size(n) for n in shifts.needs(a.shape, b.shape))
    surface = correlate(target.spectra(0, (rows, columns)), source.spectra(k, (rows, columns)), shifts)
    yaw = float(_held(np.array(source.yaw(k) - target.yaw(0)), gate.prior))
    x, y = (a.origin[n] - b.origin[n] + a.spacing * s for n, s in enumerate((surface.shift_x, surface.shift_y)))
    turn = float(wrap_angle(yaw - gate.prior.planar[2]))
    found = np.empty((6, surface.overlap.size))
    limits = np.array([*gate.prior.planar[:2], turn, gate.prior.limit, least])
    n = _admitted(surface.correlation, surface.overlap * a.spacing**2, x, y, gate.R, gate.information, limits, found)
    found[5, :n] = yaw
    return found[:, :n]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc]
def _admitted(correlation, area, along_x, along_y, R, P, limits, found):  # type: ignore[no-untyped-def]
    """Both correlations, overlap, x and y of the shifts inside the gate that overlap enough, filled in; how many."""
    n, turn = 0, limits[2]
    for i in range(len(along_y)):
        for j in range(len(along_x)):
            if area[i, j] < limits[4]:
                continue
            x = R[0, 0] * along_x[j] + R[1, 0] * along_y[i]
            y = R[0, 1] * along_x[j] + R[1, 1] * along_y[i]
            u, v = x - limits[0], y - limits[1]
            inside = u * (P[0, 0] * u + 2 * P[0, 1] * v + 2 * P[0, 2] * turn)
            inside += v * (P[1, 1] * v + 2 * P[1, 2] * turn) + P[2, 2] * turn * turn
            if inside <= limits[3]:
                found[0, n], found[1, n] = correlation[0, i, j], correlation[1, i, j]
                found[2, n], found[3, n], found[4, n] = area[i, j], x, y
                n += 1
    return n


def _shifts(target: Turned, source: Turned, low: FloatArray, high: FloatArray) -> Shifts | None:
    """Shifts of the source's first cell over a box of poses [m]; None where no cells meet."""
    between = np.array(source.origin) - np.array(target.origin)
    first = np.floor((low + between) / target.spacing).astype(int)
    end = np.ceil((high + between) / target.spacing).astype(int) + 1
    shifts = Shifts(int(first[1]), int(end[1]), int(first[0]), int(end[0])).within(target.shape, source.shape)
    return shifts if shifts.end_y > shifts.first_y and shifts.end_x > shifts.first_x else None


def _peaks(level: FloatArray, found: FloatArray, config: SearchConfig) -> list[Peak]:
    """The highest of what was found that lie apart from all higher ones."""
    peaks: list[Peak] = []
    x, y, left = found[3], found[4], level.copy()
    while len(peaks) < config.n_peaks and left.max(initial=-np.inf) > -np.inf:
        best = int(np.argmax(left))
        peaks.append(Peak(planar_pose(*found[3:, best]), float(level[best]), float(found[0, best])))
        left[(x - x[best]) ** 2 + (y - y[best]) ** 2 <= config.separation**2] = -np.inf
    return peaks
