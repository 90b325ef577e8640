"""What a run gives back."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from backend.pose_graph import PoseGraphSolution
from frontend.arrays import FloatArray
from frontend.loop_closures import LoopClosure
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.trajectory import Trajectory

if TYPE_CHECKING:
    from sssslam.products.manifest import Measured


@dataclass(frozen=True)
class Result:
    """The corrected track, the map and how they came about.

    Parameters
    ----------
    recording : Recording
        What went in.
    config : dict
        The resolved configuration, sections of keys.
    trajectory : Trajectory
        The corrected body poses, one a ping.
    sigmas : ndarray, shape (N, 4)
        Standard deviations of x, y, z [m] and yaw [rad], one row a ping.
    submaps : tuple of Submap
        The submaps, numbered from 0.
    T_world_submap : ndarray, shape (S, 4, 4)
        Their level frames in the world after correction.
    loop_closures : tuple of LoopClosure
        Every candidate, accepted or not.
    solution : PoseGraphSolution
        The pose graph behind the trajectory.
    timings : dict of str to float
        Seconds of wall time, one entry a stage in running order.
    notes : tuple of str
        What was chosen or found suspicious, a sentence each.
    counts : dict of str to int
        What else was counted, for ``run.json``.
    patches : tuple of Submap
        The map as it was made of all passes together, in frames of the corrected track; none where it is to be blended
        of the submaps.
    """

    recording: Recording
    config: dict[str, object]
    trajectory: Trajectory
    sigmas: FloatArray
    submaps: tuple[Submap, ...]
    T_world_submap: FloatArray
    loop_closures: tuple[LoopClosure, ...]
    solution: PoseGraphSolution
    timings: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    counts: dict[str, int] = field(default_factory=dict)
    patches: tuple[Submap, ...] = ()

    def write(self, out: str | os.PathLike[str], metrics: "Sequence[Measured]" = ()) -> None:
        """Write every product of the run.

        Parameters
        ----------
        out : path-like
            The folder; see `sssslam.products.write.write_products`.
        metrics : sequence of Measured
            Metrics against a reference, where there is one.
        """
        from sssslam.products.write import write_products  # drawing is imported where it is needed: it is slow to load

        write_products(self, out, metrics)
