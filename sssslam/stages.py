"""The stages of the method as `sssslam.pipeline` strings them together: the two halves hand over plain values here."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from backend.correction import spread_correction, spread_sigmas
from backend.dead_reckoning import DeadReckoning
from backend.pose_graph import PoseGraphSolution
from frontend.arrays import FloatArray
from frontend.bottom import Bottom
from frontend.comparison import Places
from frontend.features import Features, describe
from frontend.loop_closures import LoopClosure, compare_pairs, recognise_pairs
from frontend.pairs import all_pairs
from frontend.radiometry import Radiometry
from frontend.reconstruction import method_of
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.threads import in_order
from frontend.trajectory import Trajectory
from frontend.window_checks import usable_windows
from frontend.window_defaults import suit_track
from frontend.windows import Window, WindowConfig, sliding_windows
from sssslam.config import Config
from sssslam.graph import anchor_pings, anchor_poses, prior_covariance
from sssslam.watch import Watch

_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Skipped:
    """Windows that cannot be reconstructed.

    Parameters
    ----------
    n_windows : int
        Of how many, those that can among them.
    reasons : mapping of str to int
        How many cannot, by reason.
    """

    n_windows: int = 0
    reasons: Mapping[str, int] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """How many for which reason."""
        return "; ".join(f"{count} for {reason}" for reason, count in self.reasons.items())

    @property
    def counts(self) -> dict[str, int]:
        """For ``run.json``."""
        return {"windows_skipped": sum(self.reasons.values())}

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence for log and report; none where no window was skipped."""
        n = sum(self.reasons.values())
        return (f"Skipped {n} of {self.n_windows} windows: {self.words}.",) if n else ()


def choose_windows(recording: Recording, bottom: Bottom, config: Config) -> tuple[list[Window], Skipped]:
    """Cut a dive into the windows that can be reconstructed.

    Parameters
    ----------
    recording : Recording
        The dive.
    bottom : Bottom
        What was found of the bottom.
    config : Config
        How it is cut.

    Returns
    -------
    windows : list of Window
        At least one, numbered from 0.
    skipped : Skipped
        The others.

    Raises
    ------
    ValueError
        If none can be reconstructed.
    """
    reach = float(recording.slant_range_max.max())
    windows = sliding_windows(recording.trajectory_dr, reach, config.windows)
    usable, reasons = usable_windows(recording, windows, bottom, config.windows)
    skipped = Skipped(len(windows), reasons)
    if not usable:
        raise ValueError(
            f"{recording.source or 'the recording'}: none of {len(windows)} windows can be reconstructed "
            f"({skipped.words}); a moving vehicle in range of the bottom is wanted"
        )
    for note in skipped.notes:
        _logger.warning(note)
    return usable, skipped


def reconstruct_windows(
    recording: Recording,
    windows: Sequence[Window],
    known: tuple[Bottom, Radiometry],
    config: Config,
    watch: Watch,
) -> list[Submap]:
    """Submaps of windows.

    Parameters
    ----------
    recording : Recording
        The dive.
    windows : sequence of Window
        Which pings.
    known : tuple of Bottom and Radiometry
        What was found for the whole dive.
    config : Config
        Names the method.
    watch : Watch
        Told of progress.

    Returns
    -------
    submaps : list of Submap
        One a window.
    """
    reconstruct = method_of(config.reconstruction)
    submaps = in_order(lambda window: reconstruct(recording, window, *known), windows)
    return [next(submaps) for _ in watch.track("reconstruction", windows)]


def describe_submaps(submaps: Sequence[Submap], config: Config, watch: Watch) -> list[Features]:
    """Features of submaps.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps.
    config : Config
        Spacing and radius.
    watch : Watch
        Told of progress.

    Returns
    -------
    features : list of Features
        One set a submap.
    """
    features = in_order(lambda submap: describe(submap, config.features), submaps)
    return [next(features) for _ in watch.track("features", submaps)]


def close_loops(
    submaps: Sequence[Submap],
    features: Sequence[Features],
    track: tuple[Trajectory, DeadReckoning],
    config: Config,
    watch: Watch,
    places: Places | None = None,
) -> list[LoopClosure]:
    """Compare the submaps that may show the same place.

    Parameters
    ----------
    submaps, features : sequence
        The submaps and their features.
    track : tuple of Trajectory and DeadReckoning
        The dead-reckoned track and its uncertainty.
    config : Config
        Gates and thresholds.
    watch : Watch
        Told of progress.
    places : Places, optional
        Made ready for comparing; they can be used again afterwards.

    Returns
    -------
    closures : list of LoopClosure
        One a pair that reached matching.
    """
    trajectory_dr, dead_reckoning = track
    prior = prior_covariance(submaps, dead_reckoning)
    in_gate, anywhere = all_pairs(submaps, features, trajectory_dr, prior, config.loop_closures.pairs)
    compared = chain(
        compare_pairs(in_gate, submaps, features, prior, config.loop_closures, places),
        recognise_pairs(anywhere, submaps, features, prior, config.loop_closures),
    )
    return [next(compared) for _ in watch.track("loop closures", [*in_gate, *anywhere])]


def correct(
    trajectory_dr: Trajectory, submaps: Sequence[Submap], solution: PoseGraphSolution, dead_reckoning: DeadReckoning
) -> tuple[Trajectory, FloatArray]:
    """Spread the correction of the anchors over every ping.

    Parameters
    ----------
    trajectory_dr : Trajectory
        The dead-reckoned track.
    submaps : sequence of Submap
        Their anchors were corrected.
    solution : PoseGraphSolution
        Where they are now.
    dead_reckoning : DeadReckoning
        How uncertainty grows between them.

    Returns
    -------
    trajectory : Trajectory
        The corrected track; the very same where neither closure nor fix holds.
    sigmas : ndarray, shape (N, 4)
        Standard deviations of x, y, z [m] and yaw [rad].
    """
    anchors = anchor_pings(submaps)
    sigmas = spread_sigmas(dead_reckoning, anchors, solution.sigmas)
    if np.array_equal(solution.T_world_anchor, anchor_poses(submaps)):
        return trajectory_dr, sigmas
    T = spread_correction(trajectory_dr.time, trajectory_dr.poses, anchors, solution.T_world_anchor)
    return Trajectory.from_poses(trajectory_dr.time, T), sigmas


def decided(closures: Sequence[LoopClosure], solution: PoseGraphSolution) -> list[LoopClosure]:
    """The closures after the back end's verdict.

    Parameters
    ----------
    closures : sequence of LoopClosure
        As the front end left them.
    solution : PoseGraphSolution
        Its verdict, on the accepted ones in their order.

    Returns
    -------
    closures : list of LoopClosure
        Those that do not hold the graph are no longer accepted, with a reason.
    """
    reasons = iter(solution.reasons)
    judged = ((closure, next(reasons) if closure.accepted else "") for closure in closures)
    return [replace(closure, accepted=False, reason=reason) if reason else closure for closure, reason in judged]


def notes(recording: Recording, bottom: Bottom, radiometry: Radiometry, config: Config) -> tuple[str, ...]:
    """What was chosen from the data, a sentence each.

    Parameters
    ----------
    recording : Recording
        The dive, with the notes of its reader.
    bottom : Bottom
        What was found of the bottom.
    radiometry : Radiometry
        What the echoes were taken for.
    config : Config
        The resolved configuration.

    Returns
    -------
    notes : tuple of str
        For the report and the terminal.
    """
    windows, spacing = config.windows, getattr(config.reconstruction, config.reconstruction.method).spacing
    size = f"{windows.n_lines} pings" if windows.method == "lines" else f"{windows.length:.0f} m"
    cut = ", cut at turns," if windows.method == "adaptive" else ""
    chosen = [
        f"Windows of {size}{cut} that overlap by {windows.overlap:.0%}, cells of {spacing:.2g} m: from a slant range "
        f"of {recording.slant_range_max.max():.0f} m{_short_track(recording, windows)}.",
        f"Loop closures fewer than {config.consistency.stretch} windows apart at both ends share a vote.",
        radiometry.words,
    ]
    if config.reconstruction.method == "joint":
        floor = radiometry.seafloor
        chosen.append(
            f"Belief from the echoes: relief of spectrum {floor.roughness:.2g} k^-4, "
            f"log-reflectivity varying by {floor.reflectivity:.2g} over {floor.length:.2g} m."
        )
    if np.isfinite(bottom.altimeter_scale) and bottom.altimeter_scale != 1:
        scale = f"{bottom.altimeter_scale:.3f}"
        chosen.append(f"The altimeter was multiplied by {scale} to agree with the first bottom return.")
    if np.isnan(bottom.altimeter_scale):
        chosen.append("No altitude recorded: taken from the first bottom return.")
    return (*recording.notes, *chosen)


def _short_track(recording: Recording, windows: WindowConfig) -> str:
    """Why windows are shorter than the range asks for, where that was not the user's wish."""
    track = recording.trajectory_dr
    chosen = suit_track(WindowConfig(), float(recording.slant_range_max.max()), track).length
    has_chosen = chosen is not None and chosen == windows.length
    return f" and a track of {track.distance[-1]:.0f} m that turns back" if has_chosen else ""
