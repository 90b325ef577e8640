"""The whole method on one screen: `slam` for a finished dive, `Slam` for pings as they come."""

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from backend.dead_reckoning import DeadReckoning
from backend.pose_graph import PoseGraphSolution
from frontend.bottom import find_bottom
from frontend.features import Features
from frontend.features import describe as describe_submap
from frontend.frames import invert
from frontend.loop_closures import LoopClosure, compare_pairs, recognise_pairs
from frontend.pairs import PairFinder
from frontend.radiometry import Radiometry
from frontend.reconstruction import calibrate
from frontend.recording import Recording, SonarGeometry
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from frontend.window_checks import Unusable, usable_windows
from frontend.windows import Window, finished_windows
from sssslam.config import Config, resolve, resolve_pings
from sssslam.dead_reckoning import dead_reckon
from sssslam.fixes import fixes_at_anchors
from sssslam.graph import anchor_pings, make_graph, prior_covariance, solve_at_fixes, solve_graph
from sssslam.overrides import Overrides, override, override_notes
from sssslam.products.result import Result
from sssslam.readers.joining import join
from sssslam.stages import (
    Skipped,
    choose_windows,
    close_loops,
    correct,
    decided,
    describe_submaps,
    notes,
    reconstruct_windows,
)
from sssslam.watch import Watch

_logger = logging.getLogger(__name__)

N_FIRST_WINDOWS = 4  # that Slam waits for before it calibrates the sonar


def slam(
    recording: Recording,
    config: Config | None = None,
    watch: Watch | None = None,
    overrides: Overrides | None = None,
) -> Result:
    """Correct the track of a dive with what its side-scan sonar saw again.

    Parameters
    ----------
    recording : Recording
        The dive.
    config : Config, optional
        Settings; what they leave open is taken from the recording.
    watch : Watch, optional
        Told of every stage and its progress, and keeps their times.
    overrides : Overrides, optional
        Loop closures that a user accepts or rejects, as `sssslam.read_overrides` reads them.

    Returns
    -------
    result : Result
        Corrected track, submaps, loop closures and all that a run writes.
    """
    watch, overrides = watch or Watch(), overrides or Overrides()
    config = resolve(config or Config(), recording)
    with watch.stage("dead reckoning"):
        recording, dead_reckoning = dead_reckon(recording, config.dead_reckoning)
    # echoes to shape
    with watch.stage("bottom"):
        bottom = find_bottom(recording, config.bottom)
    windows, skipped = choose_windows(recording, bottom, config)
    with watch.stage("radiometry"):
        radiometry = calibrate(recording, windows, bottom, config.radiometry, config.reconstruction.joint)
    submaps = reconstruct_windows(recording, windows, (bottom, radiometry), config, watch)
    # shape to loop closures
    features = describe_submaps(submaps, config, watch)
    found = close_loops(submaps, features, (recording.trajectory_dr, dead_reckoning), config, watch)
    closures = override(found, overrides)
    # loop closures to a trajectory
    with watch.stage("pose graph"):
        graph = make_graph(submaps, closures, dead_reckoning, config, overrides)
        seen = fixes_at_anchors(recording, anchor_pings(submaps), dead_reckoning, config.do_no_harm)
        solution, fixes = solve_at_fixes(graph, seen, dead_reckoning, config)
    closures = decided(closures, solution)
    with watch.stage("correction"):
        trajectory, sigmas = correct(recording.trajectory_dr, submaps, solution, dead_reckoning)
    said = notes(recording, bottom, radiometry, config)
    return Result(
        recording,
        config.model_dump(mode="json"),
        trajectory,
        sigmas,
        tuple(submaps),
        solution.T_world_anchor @ invert(np.stack([submap.T_submap_body for submap in submaps])),
        tuple(closures),
        solution,
        watch.seconds,
        (*said, *skipped.notes, *fixes.notes, *override_notes(found, closures, overrides)),
        {**skipped.counts, **fixes.counts},
    )


class Slam:
    """The same method for pings as they come; what is given back so far is always the best known.

    Echoes are kept only for windows that are not finished; submaps and the track are kept.

    Parameters
    ----------
    config : Config, optional
        Settings, as for `slam`.
    sonar : SonarGeometry, optional
        The sonar, where the chunks do not say.
    """

    def __init__(self, config: Config | None = None, sonar: SonarGeometry | None = None) -> None:
        self.config = config or Config()
        if self.config.dead_reckoning.source == "sensors":
            raise ValueError(
                "dead_reckoning.source is 'sensors'; 'recorded' is wanted: smoothing raw sensors needs the whole dive"
            )
        self.sonar = sonar
        self.loop_closures: list[LoopClosure] = []
        self.submaps: list[Submap] = []
        self.skipped = Skipped()
        self._features: list[Features] = []
        self._finder = PairFinder(self.config.loop_closures.pairs)
        self._pings: Recording | None = None
        self._n_forgotten = 0
        self._n_windows = 0  # reconstructed or skipped
        self._track: Trajectory | None = None
        self._radiometry: Radiometry | None = None
        self._candidates: list[LoopClosure] = []
        self._solution: PoseGraphSolution | None = None

    @property
    def trajectory(self) -> Trajectory:
        """Corrected body poses of all pings so far."""
        if self._track is None:
            raise ValueError("no ping has come yet: add some first")
        if self._solution is None:
            return self._track
        return correct(self._track, self.submaps, self._solution, self._dead_reckoning())[0]

    @property
    def n_pings_kept(self) -> int:
        """Number of pings whose echoes are still held."""
        return self._pings.n_pings if self._pings is not None else 0

    def add(self, chunk: Recording) -> None:
        """Take the next pings.

        Parameters
        ----------
        chunk : Recording
            Later than all before, in the same world frame, with as many samples.
        """
        chunk = replace(chunk, sonar=self.sonar or chunk.sonar)
        self._pings = chunk if self._pings is None else join([self._pings, chunk])
        self._track = chunk.trajectory_dr if self._track is None else self._track.joined(chunk.trajectory_dr)
        self.config = resolve_pings(self.config, chunk)
        reach = float(chunk.slant_range_max.max())
        # the last window may still grow, or be cut
        waiting = finished_windows(self._track, reach, self.config.windows)[self._n_windows :]
        if not waiting or (self._radiometry is None and len(waiting) < N_FIRST_WINDOWS):
            return
        n_known, self._n_windows = len(self.submaps), self._n_windows + len(waiting)
        self._reconstruct([self._local(window) for window in waiting])
        if len(self.submaps) > n_known:
            self._close_loops(len(self.submaps) - n_known)
        self._forget(waiting[-1].first_ping)

    def _dead_reckoning(self) -> DeadReckoning:
        assert self._track is not None
        return DeadReckoning(self._track.time, self._track.poses, self.config.dead_reckoning)

    def _local(self, window: Window) -> Window:
        n = self._n_forgotten
        return Window(window.number, window.first_ping - n, window.end_ping - n, window.anchor_ping - n)

    def _reconstruct(self, windows: Sequence[Window]) -> None:
        """Submaps and features of finished windows, numbered in the pings of the whole dive."""
        assert self._pings is not None
        try:
            bottom = find_bottom(self._pings, self.config.bottom)
        except ValueError:  # nothing in these pings: it may come into range again
            self._skip({str(Unusable.BOTTOM_LOST): len(windows)})
            return
        windows, reasons = usable_windows(self._pings, windows, bottom, self.config.windows)
        self._skip(reasons)
        if not windows:
            return
        if self._radiometry is None:
            joint = self.config.reconstruction.joint
            self._radiometry = calibrate(self._pings, windows, bottom, self.config.radiometry, joint)
        n = self._n_forgotten
        for s in reconstruct_windows(self._pings, windows, (bottom, self._radiometry), self.config, Watch()):
            first, end, anchor = s.first_ping + n, s.end_ping + n, s.anchor_ping + n
            s = replace(s, number=len(self.submaps), first_ping=first, end_ping=end, anchor_ping=anchor)
            self.submaps.append(s)
            self._features.append(describe_submap(s, self.config.features))

    def _skip(self, reasons: Mapping[str, int]) -> None:
        """Count windows that cannot be reconstructed."""
        self.skipped = Skipped(self._n_windows, Counter(self.skipped.reasons) + Counter(reasons))
        for reason, count in reasons.items():
            _logger.warning("Skipped %d windows: %s.", count, reason)

    def _close_loops(self, n_new: int) -> None:
        """Compare the new submaps with all before, and solve the graph again."""
        assert self._track is not None
        reckoning = self._dead_reckoning()
        prior = prior_covariance(self.submaps, reckoning)
        settings, distance, known = self.config.loop_closures, self._track.distance, (self.submaps, self._features)
        new = range(len(self.submaps) - n_new, len(self.submaps))
        partners = [(self._finder.add(self.submaps[k], self._features[k], distance, prior), k) for k in new]
        in_gate = [(int(target), k) for found, k in partners for target in found.in_gate]
        anywhere = [(int(target), k) for found, k in partners for target in found.anywhere]
        self._candidates.extend(compare_pairs(in_gate, *known, prior, settings))
        self._candidates.extend(recognise_pairs(anywhere, *known, prior, settings))
        self._solution = solve_graph(self.submaps, self._candidates, reckoning, self.config)
        self.loop_closures = decided(self._candidates, self._solution)

    def _forget(self, first_ping: int) -> None:
        assert self._pings is not None
        self._pings = self._pings[first_ping - self._n_forgotten :]
        self._n_forgotten = first_ping
