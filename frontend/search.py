"""Search: where inside the gate of a prior two submaps correlate, by relief or by relief and reflectivity."""

from dataclasses import dataclass

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
    R = planar_pose(0.0, 0.0, target.yaw(0))[:2, :2]  # to the axes of the target's turned copy: shifts are along these
    box = _gate_box(prior, R)
    found = np.concatenate(
        [np.empty((0, 6)), *(_found(target, source, k, box, least) for k in _steps(target, source, prior))]
    )
    found[:, 3:5] = found[:, 3:5] @ R
    found[:, 5] = _held(found[:, 5] - target.yaw(0), prior)
    found = found[prior.squared_distance(*found[:, 3:].T) <= prior.limit]
    areas = [area(target.relief, source.relief) for area in (joint_area, joint_reflectivity_area)]
    by_shape, by_echo = (significance(found[:, k], found[:, 2], areas[k]) for k in (0, 1))
    return _peaks(np.column_stack([pooled(by_shape, by_echo), found[:, [0, 2, 3, 4, 5]]]), config)


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


def _gate_box(prior: Prior, R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least and largest x, y of the gate along other axes [m]."""
    middle = R @ np.array(prior.planar[:2])
    reach = np.sqrt(prior.limit * np.diag(R @ prior.planar_covariance[:2, :2] @ R.T))
    return middle - reach, middle + reach


def _found(
    target: TurnedRelief, source: TurnedRelief, k: int, box: tuple[FloatArray, FloatArray], least: float
) -> FloatArray:
    """Both correlations, overlap [m^2], x, y [m] and yaw of the source along the target's axes, shape (S, 6)."""
    a, b = target.at(0), source.at(k)
    shifts = _shifts(a, b, *box)
    if shifts is None:
        return np.empty((0, 6))
    rows, columns = (common_size(n) for n in shifts.needs(a.shape, b.shape))
    surface = correlate(target.spectra(0, (rows, columns)), source.spectra(k, (rows, columns)), shifts)
    area = surface.overlap * a.spacing**2
    i, j = np.nonzero(area >= least)
    x = a.origin[0] - b.origin[0] + a.spacing * surface.shift_x[j]
    y = a.origin[1] - b.origin[1] + a.spacing * surface.shift_y[i]
    return np.column_stack([*surface.correlation[:, i, j], area[i, j], x, y, np.full(len(i), source.yaw(k))])


def _shifts(target: Turned, source: Turned, low: FloatArray, high: FloatArray) -> Shifts | None:
    """Shifts of the source's first cell over a box of poses [m]; None where no cells meet."""
    between = np.array(source.origin) - np.array(target.origin)
    first = np.floor((low + between) / target.spacing).astype(int)
    end = np.ceil((high + between) / target.spacing).astype(int) + 1
    shifts = Shifts(int(first[1]), int(end[1]), int(first[0]), int(end[0])).within(target.shape, source.shape)
    return shifts if shifts.end_y > shifts.first_y and shifts.end_x > shifts.first_x else None


def _peaks(rows: FloatArray, config: SearchConfig) -> list[Peak]:
    """The highest rows that lie apart from all higher ones."""
    peaks: list[Peak] = []
    while len(rows) and len(peaks) < config.n_peaks:
        best = rows[np.argmax(rows[:, 0])]
        peaks.append(Peak(planar_pose(*best[3:]), float(best[0]), float(best[1])))
        rows = rows[np.hypot(rows[:, 3] - best[3], rows[:, 4] - best[4]) > config.separation]
    return peaks
