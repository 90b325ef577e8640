"""The whole method on one screen: `slam` for a finished dive, `Slam` for pings as they come."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backend.correction import spread_correction, spread_sigmas
from backend.dead_reckoning import DeadReckoning
from backend.pose_graph import PoseGraph, PoseGraphSolution
from frontend.arrays import FloatArray, IntArray
from frontend.bottom import Bottom, find_bottom
from frontend.features import Features
from frontend.features import describe as describe_submap
from frontend.frames import invert
from frontend.loop_closures import LoopClosure, compare_pairs
from frontend.pairs import PriorCovariance, pairs_to_compare
from frontend.radiometry import Radiometry
from frontend.reconstruction import calibrate, method_of
from frontend.recording import Recording, SonarGeometry
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from frontend.windows import Window, sliding_windows
from sssslam.config import Config, resolve
from sssslam.products.result import Result
from sssslam.readers.joining import join
from sssslam.watch import Watch

N_FIRST_WINDOWS = 4  # that Slam waits for before it calibrates the sonar
FIRST_POSE_SIGMAS = np.full(6, 1e-3)  # the first anchor is where dead reckoning has it: the gauge


def slam(recording: Recording, config: Config | None = None, watch: Watch | None = None) -> Result:
    """Correct the track of a dive with what its side-scan sonar saw again.

    Parameters
    ----------
    recording : Recording
        The dive.
    config : Config, optional
        Settings; what they leave open is taken from the recording.
    watch : Watch, optional
        Told of every stage and its progress, and keeps their times.

    Returns
    -------
    result : Result
        Corrected track, submaps, loop closures and all that a run writes.
    """
    watch = watch or Watch()
    config = resolve(config or Config(), recording)
    windows = sliding_windows(recording.trajectory_dr, float(recording.slant_range_max.max()), config.windows)
    # echoes to shape
    with watch.stage("bottom"):
        bottom = find_bottom(recording, config.bottom)
    with watch.stage("radiometry"):
        radiometry = calibrate(recording, windows, bottom, config.radiometry, config.reconstruction.joint)
    submaps = reconstruct_windows(recording, windows, (bottom, radiometry), config, watch)
    # shape to loop closures
    features = [describe_submap(submap, config.features) for submap in watch.track("features", submaps)]
    dead_reckoning = DeadReckoning(recording.ping_time, recording.trajectory_dr.poses, config.dead_reckoning)
    closures = close_loops(submaps, features, (recording.trajectory_dr, dead_reckoning), config, watch)
    # loop closures to a trajectory
    with watch.stage("pose graph"):
        solution = solve_graph(submaps, closures, dead_reckoning, config)
    with watch.stage("correction"):
        trajectory, sigmas = correct(recording.trajectory_dr, submaps, solution, dead_reckoning)
    return Result(
        recording,
        config.model_dump(mode="json"),
        trajectory,
        sigmas,
        tuple(submaps),
        solution.T_world_anchor @ invert(np.stack([submap.T_submap_body for submap in submaps])),
        tuple(decided(closures, solution)),
        solution,
        watch.seconds,
        notes(recording, bottom, radiometry, config),
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
        self.sonar = sonar
        self.loop_closures: list[LoopClosure] = []
        self.submaps: list[Submap] = []
        self._features: list[Features] = []
        self._pings: Recording | None = None
        self._n_forgotten = 0
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
        self.config = resolve(self.config, chunk)
        reach = float(chunk.slant_range_max.max())
        # the last window may still grow
        finished = sliding_windows(self._track, reach, self.config.windows)[:-1]
        waiting = finished[len(self.submaps) :]
        if not waiting or (self._radiometry is None and len(waiting) < N_FIRST_WINDOWS):
            return
        self._reconstruct([self._local(window) for window in waiting])
        self._close_loops(len(waiting))
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
        bottom = find_bottom(self._pings, self.config.bottom)
        if self._radiometry is None:
            joint = self.config.reconstruction.joint
            self._radiometry = calibrate(self._pings, windows, bottom, self.config.radiometry, joint)
        n = self._n_forgotten
        for s in reconstruct_windows(self._pings, windows, (bottom, self._radiometry), self.config, Watch()):
            first, end, anchor = s.first_ping + n, s.end_ping + n, s.anchor_ping + n
            self.submaps.append(replace(s, first_ping=first, end_ping=end, anchor_ping=anchor))
            self._features.append(describe_submap(s, self.config.features))

    def _close_loops(self, n_new: int) -> None:
        """Compare the new submaps with all before, and solve the graph again."""
        assert self._track is not None
        reckoning = self._dead_reckoning()
        prior = prior_covariance(self.submaps, reckoning)
        pairs = pairs_to_compare(self.submaps, self._track, prior, self.config.loop_closures.pairs)
        new = [pair for pair in pairs if pair[1] >= len(self.submaps) - n_new]
        found = compare_pairs(new, self.submaps, self._features, prior, self.config.loop_closures)
        self._candidates.extend(found)
        self._solution = solve_graph(self.submaps, self._candidates, reckoning, self.config)
        self.loop_closures = decided(self._candidates, self._solution)

    def _forget(self, first_ping: int) -> None:
        assert self._pings is not None
        self._pings = self._pings[first_ping - self._n_forgotten :]
        self._n_forgotten = first_ping


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
    return [reconstruct(recording, window, *known) for window in watch.track("reconstruction", windows)]


def close_loops(
    submaps: Sequence[Submap],
    features: Sequence[Features],
    track: tuple[Trajectory, DeadReckoning],
    config: Config,
    watch: Watch,
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

    Returns
    -------
    closures : list of LoopClosure
        One a pair that reached matching.
    """
    trajectory_dr, dead_reckoning = track
    prior = prior_covariance(submaps, dead_reckoning)
    pairs = pairs_to_compare(submaps, trajectory_dr, prior, config.loop_closures.pairs)
    compared = compare_pairs(pairs, submaps, features, prior, config.loop_closures)
    return [next(compared) for _ in watch.track("loop closures", pairs)]


def prior_covariance(submaps: Sequence[Submap], dead_reckoning: DeadReckoning) -> PriorCovariance:
    """What dead reckoning says of the pose of one submap seen from another.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps.
    dead_reckoning : DeadReckoning
        The uncertainty of the track.

    Returns
    -------
    covariance : callable
        Takes two positions in ``submaps``; gives the (6, 6) covariance in the target's level frame, rotation first.
    """

    def covariance(target: int, source: int) -> FloatArray:
        turn = np.kron(np.eye(2), submaps[target].T_submap_body[:3, :3])
        relative = dead_reckoning.relative_covariance(submaps[target].anchor_ping, submaps[source].anchor_ping)
        return np.asarray(turn @ relative @ turn.T)

    return covariance


def solve_graph(
    submaps: Sequence[Submap], closures: Sequence[LoopClosure], dead_reckoning: DeadReckoning, config: Config
) -> PoseGraphSolution:
    """Poses of the anchors from odometry, depth, attitude and the accepted closures.

    Parameters
    ----------
    submaps : sequence of Submap
        Their anchors are the nodes.
    closures : sequence of LoopClosure
        Those that the front end accepted enter.
    dead_reckoning : DeadReckoning
        Says how uncertain odometry is.
    config : Config
        Settings of the back end.

    Returns
    -------
    solution : PoseGraphSolution
        Poses, covariances and the verdict on each closure that entered.
    """
    anchors = anchor_pings(submaps)
    T_world_body_dr = np.stack([submap.T_world_submap_dr @ submap.T_submap_body for submap in submaps])
    graph = PoseGraph(T_world_body_dr, config.pose_graph, config.consistency, config.do_no_harm)
    graph.add_first_pose(FIRST_POSE_SIGMAS)
    settings = config.dead_reckoning
    for k in range(len(submaps)):
        graph.add_depth_and_tilt(k, settings.depth_sd, settings.tilt_sd)
    for k in range(len(submaps) - 1):
        T_target_source = invert(T_world_body_dr[k]) @ T_world_body_dr[k + 1]
        graph.add_odometry(k, k + 1, T_target_source, dead_reckoning.odometry_covariance(anchors[k], anchors[k + 1]))
    for closure in closures:
        if closure.accepted:
            target, source = submaps[closure.target], submaps[closure.source]
            T_bodies = invert(target.T_submap_body) @ closure.T_target_source @ source.T_submap_body
            graph.add_closure(closure.target, closure.source, T_bodies, closure.sigmas)
    return graph.solve()


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
        The corrected track; the very same where no closure holds.
    sigmas : ndarray, shape (N, 4)
        Standard deviations of x, y, z [m] and yaw [rad].
    """
    anchors = anchor_pings(submaps)
    sigmas = spread_sigmas(dead_reckoning, anchors, solution.sigmas)
    if not solution.is_inlier.any():
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


def anchor_pings(submaps: Sequence[Submap]) -> IntArray:
    """Anchor pings of submaps.

    Parameters
    ----------
    submaps : sequence of Submap
        The submaps.

    Returns
    -------
    pings : ndarray of int, shape (S,)
        One a submap.
    """
    return np.array([submap.anchor_ping for submap in submaps], dtype=np.int64)


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
    chosen = [
        f"Windows of {config.windows.length:.0f} m that overlap by {config.windows.overlap:.0%}, "
        f"cells of {config.reconstruction.joint.spacing:.2g} m: from a slant range of "
        f"{recording.slant_range_max.max():.0f} m.",
        f"Samples taken for {radiometry.quantity} with {radiometry.looks:.2g} looks each.",
    ]
    if np.isfinite(bottom.altimeter_scale) and bottom.altimeter_scale != 1:
        scale = f"{bottom.altimeter_scale:.3f}"
        chosen.append(f"The altimeter was multiplied by {scale} to agree with the first bottom return.")
    if np.isnan(bottom.altimeter_scale):
        chosen.append("No altitude recorded: taken from the first bottom return.")
    return (*recording.notes, *chosen)
