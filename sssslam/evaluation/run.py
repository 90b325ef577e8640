"""All metrics of a run against a reference."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

from frontend.arrays import FloatArray
from frontend.heightfield import Heightfield
from frontend.loop_closures import LoopClosure
from frontend.recording import Truth
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.evaluation.legs import rpe_legs
from sssslam.evaluation.loop_closures import evaluate_loop_closures
from sssslam.evaluation.metric import Metric
from sssslam.evaluation.reconstruction import evaluate_map, evaluate_submaps
from sssslam.evaluation.trajectory import evaluate_tracks, track_coverage, track_nees


class FinishedRun(Protocol):
    """What of a run can be judged; `sssslam.products.run.Run` has it."""

    @property
    def trajectory(self) -> Trajectory:
        """The corrected track."""

    @property
    def trajectory_dr(self) -> Trajectory:
        """The dead-reckoned track."""

    @property
    def sigmas(self) -> FloatArray:
        """Shape (N, 4): standard deviations of the corrected x, y, z [m] and yaw [rad]."""

    @property
    def loop_closures(self) -> Sequence[LoopClosure]:
        """Every candidate."""

    @property
    def anchor_time(self) -> Mapping[int, float]:
        """Anchor times of the submaps that the candidates name [s]."""

    @property
    def submaps(self) -> Iterable[Submap]:
        """The submaps."""

    @property
    def seafloor(self) -> Heightfield:
        """Heights of the map [m]."""

    @property
    def seafloor_sigma(self) -> FloatArray:
        """Shape (n_y, n_x): standard deviations of the map's heights [m]."""


def evaluate_run(run: FinishedRun, truth: Truth) -> list[Metric]:
    """Judge the tracks and the loop closures of a run, and its shape where the terrain is known.

    Parameters
    ----------
    run : FinishedRun
        The run.
    truth : Truth
        The reference track, and perhaps the terrain; same clock and frame as the run.

    Returns
    -------
    metrics : list of Metric
        The corrected track's ``ate`` comes first.

    Raises
    ------
    ValueError
        If the reference does not overlap the run in time, or the terrain not in space.
    """
    metrics = evaluate_tracks(run.trajectory, run.trajectory_dr, truth.trajectory)
    metrics.append(track_coverage(run.trajectory, run.sigmas, truth.trajectory))
    metrics.append(track_nees(run.trajectory, run.sigmas, truth.trajectory))
    metrics += rpe_legs(run.trajectory, truth.trajectory)
    metrics += evaluate_loop_closures(run.loop_closures, run.anchor_time, truth.trajectory)
    if truth.terrain is not None:
        metrics += evaluate_submaps(run.submaps, truth.trajectory, truth.terrain)
        metrics += evaluate_map(run.seafloor, run.seafloor_sigma, truth.terrain)
    return metrics
