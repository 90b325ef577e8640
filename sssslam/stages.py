"""The stages of the method as `sssslam.pipeline` strings them together: the two halves hand over plain values here."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from backend.correction import spread_correction, spread_sigmas
from backend.dead_reckoning import DeadReckoning
from backend.pose_graph import PoseGraph, PoseGraphSolution
from frontend.arrays import FloatArray, IntArray
from frontend.bottom import Bottom
from frontend.features import Features
from frontend.frames import invert
from frontend.loop_closures import LoopClosure, compare_pairs
from frontend.pairs import PriorCovariance, pairs_to_compare
from frontend.radiometry import Radiometry
from frontend.reconstruction import method_of
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from frontend.windows import Window
from sssslam.config import Config
from sssslam.dead_reckoning import first_pose_sigmas
from sssslam.holding import hold
from sssslam.map_agreement import MapAgreement
from sssslam.overrides import Overrides
from sssslam.watch import Watch


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
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:  # kernels let go of the interpreter's lock
        submaps = pool.map(lambda window: reconstruct(recording, window, *known), windows)
        return [next(submaps) for _ in watch.track("reconstruction", windows)]


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
    submaps: Sequence[Submap],
    closures: Sequence[LoopClosure],
    dead_reckoning: DeadReckoning,
    config: Config,
    overrides: Overrides | None = None,
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
    overrides : Overrides, optional
        Closures that a user accepted: no false one is as good, and the back end does not withdraw them.

    Returns
    -------
    solution : PoseGraphSolution
        Poses, covariances and the verdict on each closure that entered.
    """
    anchors = anchor_pings(submaps)
    T_world_body_dr = np.stack([submap.T_world_submap_dr @ submap.T_submap_body for submap in submaps])
    graph = PoseGraph(T_world_body_dr, config.pose_graph, config.consistency, config.do_no_harm)
    graph.add_first_pose(first_pose_sigmas(dead_reckoning, int(anchors[0])))
    maps, prior = MapAgreement(submaps, config.loop_closures), prior_covariance(submaps, dead_reckoning)
    settings = config.dead_reckoning
    for k in range(len(submaps)):
        graph.add_depth_and_tilt(k, settings.depth_sd, settings.tilt_sd)
    for k in range(len(submaps) - 1):
        T_target_source = invert(T_world_body_dr[k]) @ T_world_body_dr[k + 1]
        graph.add_odometry(k, k + 1, T_target_source, dead_reckoning.odometry_covariance(anchors[k], anchors[k + 1]))
    entering = [closure for closure in closures if closure.accepted]
    forced = [k for k, closure in enumerate(entering) if overrides and overrides.accepts(closure)]
    for k, closure in enumerate(entering):
        target, source = submaps[closure.target], submaps[closure.source]
        T_bodies = invert(target.T_submap_body) @ closure.T_target_source @ source.T_submap_body
        chance = 0.0 if k in forced else len(closures) * maps.chance(closure, prior)
        graph.add_closure(closure.target, closure.source, T_bodies, closure.sigmas, chance)
    return hold(graph, graph.solve(agreement=maps, rng=np.random.default_rng(config.seed)), forced)


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
        f"cells of {getattr(config.reconstruction, config.reconstruction.method).spacing:.2g} m: from a slant range of "
        f"{recording.slant_range_max.max():.0f} m.",
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
