"""The method for pings as they come: what is known so far is always the best known."""

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from backend.dead_reckoning import DeadReckoning
from backend.pose_graph import PoseGraphSolution
from frontend.bottom import find_bottom
from frontend.features import Features
from frontend.features import describe as describe_submap
from frontend.loop_closures import LoopClosure, compare_pairs, recognise_pairs
from frontend.pairs import PairFinder
from frontend.radiometry import Radiometry
from frontend.reconstruction import calibrate
from frontend.recording import Recording, SonarGeometry
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from frontend.window_checks import Unusable, usable_windows
from frontend.windows import Window, finished_windows, sliding_windows
from sssslam.config import Config, resolve_pings
from sssslam.fix_log import FixLog
from sssslam.fixes import Fixes
from sssslam.graph import anchor_pings, make_graph, prior_covariance, solve_at_fixes
from sssslam.readers.joining import join
from sssslam.stages import Skipped, correct, decided, reconstruct_windows
from sssslam.watch import Watch

_logger = logging.getLogger(__name__)

N_FIRST_WINDOWS = 4  # that Slam waits for before it calibrates the sonar


class Slam:
    """The same method as `slam` for pings as they come; what is given back so far is always the best known.

    Echoes are kept only for windows that are not finished; submaps, fixes and the track are kept.

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
        self.fixes = Fixes()
        self._features: list[Features] = []
        self._finder = PairFinder(self.config.loop_closures.pairs)
        self._log = FixLog()
        self._n_fixes = 0  # that the solution has seen
        self._pings: Recording | None = None
        self._n_forgotten = 0
        self._n_windows = 0  # reconstructed or skipped
        self._track: Trajectory | None = None
        self._radiometry: Radiometry | None = None
        self._candidates: list[LoopClosure] = []
        self._solution: PoseGraphSolution | None = None
        self._is_finished = False

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
            Later than all before, in the same world frame, with as many samples. Fixes of a receiver among its sensors
            (``gnss``) hold the track from the ping on that is nearest in time; those that came before are not taken
            twice.
        """
        if self._is_finished:
            raise ValueError("the dive was finished; a new Slam is wanted for pings that come after finish()")
        chunk = replace(chunk, sonar=self.sonar or chunk.sonar)
        self.config = resolve_pings(self.config, chunk)
        self._log.take(chunk)
        chunk = replace(chunk, sensors={})
        self._pings = chunk if self._pings is None else join([self._pings, chunk])
        self._track = chunk.trajectory_dr if self._track is None else self._track.joined(chunk.trajectory_dr)
        # the last window may still grow, or be cut
        reach = float(chunk.slant_range_max.max())
        waiting = finished_windows(self._track, reach, self.config.windows)[self._n_windows :]
        is_early = self._radiometry is None and len(waiting) < N_FIRST_WINDOWS
        self._take_in([] if is_early else waiting)

    def finish(self) -> None:
        """Take in what waited for further pings: no more will come.

        The last window, which might have grown, and a dive too short to have had four windows.
        """
        if self._track is None or self._pings is None:
            raise ValueError("no ping has come yet: add some first")
        reach = float(self._pings.slant_range_max.max())
        if not self._is_finished:
            self._take_in(sliding_windows(self._track, reach, self.config.windows)[self._n_windows :])
        self._is_finished = True

    def _take_in(self, windows: Sequence[Window]) -> None:
        """Shape, loop closures and track with these windows, and with the fixes that have come."""
        n_known, self._n_windows = len(self.submaps), self._n_windows + len(windows)
        if windows:
            self._reconstruct([self._local(window) for window in windows])
        if len(self.submaps) > n_known:
            self._close_loops(len(self.submaps) - n_known)
        self._solve(len(self.submaps) > n_known)
        if windows:
            self._forget(windows[-1].first_ping)

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
        """Compare the new submaps with all before."""
        assert self._track is not None
        prior = prior_covariance(self.submaps, self._dead_reckoning())
        settings, distance, known = self.config.loop_closures, self._track.distance, (self.submaps, self._features)
        new = range(len(self.submaps) - n_new, len(self.submaps))
        partners = [(self._finder.add(self.submaps[k], self._features[k], distance, prior), k) for k in new]
        in_gate = [(int(target), k) for found, k in partners for target in found.in_gate]
        anywhere = [(int(target), k) for found, k in partners for target in found.anywhere]
        self._candidates.extend(compare_pairs(in_gate, *known, prior, settings))
        self._candidates.extend(recognise_pairs(anywhere, *known, prior, settings))

    def _solve(self, has_grown: bool) -> None:
        """Solve the graph again where it has grown or the receiver has seen the vehicle anew."""
        reckoning = self._dead_reckoning()
        n_fixes = self._log.n_near(reckoning.time)
        if not self.submaps or not (has_grown or n_fixes > self._n_fixes):
            return
        graph = make_graph(self.submaps, self._candidates, reckoning, self.config)
        seen = self._log.at_anchors(anchor_pings(self.submaps), reckoning, self.config.do_no_harm)
        self._solution, self.fixes = solve_at_fixes(graph, seen, reckoning, self.config)
        self._n_fixes = n_fixes
        self.loop_closures = decided(self._candidates, self._solution)

    def _forget(self, first_ping: int) -> None:
        assert self._pings is not None
        self._pings = self._pings[first_ping - self._n_forgotten :]
        self._n_forgotten = first_ping
