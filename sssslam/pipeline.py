"""The whole method on one screen, for a finished dive; `sssslam.online` has it for pings as they come."""

from dataclasses import replace

import numpy as np

from frontend.bottom import find_bottom
from frontend.comparison import Places
from frontend.frames import invert
from frontend.reconstruction import calibrate
from frontend.recording import Recording
from sssslam.config import Config, resolve
from sssslam.dead_reckoning import dead_reckon
from sssslam.fixes import fixes_at_anchors
from sssslam.graph import anchor_pings, make_graph, solve_at_fixes
from sssslam.mapping import map_notes, reconstruct_patches
from sssslam.overrides import Overrides, override, override_notes
from sssslam.products.result import Result
from sssslam.stages import (
    choose_windows,
    close_loops,
    correct,
    decided,
    describe_submaps,
    notes,
    reconstruct_windows,
)
from sssslam.watch import Watch


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
    places = Places(submaps, config.loop_closures.relief, config.loop_closures.search)
    found = close_loops(submaps, features, (recording.trajectory_dr, dead_reckoning), config, watch, places)
    closures = override(found, overrides)
    # loop closures to a trajectory
    with watch.stage("pose graph"):
        graph = make_graph(submaps, closures, dead_reckoning, config, overrides, places)
        seen = fixes_at_anchors(recording, anchor_pings(submaps), dead_reckoning, config.do_no_harm)
        solution, fixes = solve_at_fixes(graph, seen, dead_reckoning, config)
    closures = decided(closures, solution)
    with watch.stage("correction"):
        trajectory, sigmas = correct(recording.trajectory_dr, submaps, solution, dead_reckoning)
    # a trajectory to the map
    corrected, how = replace(recording, trajectory_dr=trajectory), (config.map, config.reconstruction.joint)
    patches = reconstruct_patches(corrected, windows, (bottom, radiometry), how, watch)
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
        (*said, *skipped.notes, *fixes.notes, *override_notes(found, closures, overrides), *map_notes(patches)),
        {**skipped.counts, **fixes.counts},
        tuple(patches),
    )
