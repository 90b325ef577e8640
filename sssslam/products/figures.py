"""All figures of a run."""

from typing import TYPE_CHECKING

from frontend.trajectory import Trajectory
from sssslam.products.figure_maps import draw_map, draw_mosaic, draw_sigma
from sssslam.products.figure_recording import draw_waterfall
from sssslam.products.figure_submaps import choose_submaps, draw_submaps
from sssslam.products.figure_tracks import draw_closure_scores, draw_tracks
from sssslam.products.maps import SeafloorMap
from sssslam.products.run import Run

if TYPE_CHECKING:
    from sssslam.products.result import Result

FIGURES = ("tracks", "map", "sigma", "mosaic", "closures", "submaps", "waterfall")


def draw_figures(result: "Result", run: Run, seafloor: SeafloorMap) -> dict[str, bytes]:
    """Draw what a person looks at to judge a run.

    Parameters
    ----------
    result : Result
        The run.
    run : Run
        The same as it lies on the disk.
    seafloor : SeafloorMap
        Its map.

    Returns
    -------
    figures : dict of str to bytes
        PNGs by name (of `FIGURES`); a dive without submaps or candidates lacks theirs.
    """
    truth = result.recording.truth
    figures = {"tracks": draw_tracks(run, reference_of(result)), "waterfall": draw_waterfall(result.recording)}
    if result.submaps:
        chosen = choose_submaps(result.submaps, result.loop_closures)
        figures |= {"map": draw_map(seafloor, result.trajectory), "submaps": draw_submaps(chosen, truth)}
        figures |= {"mosaic": draw_mosaic(seafloor), "sigma": draw_sigma(seafloor)}
    if result.loop_closures:
        figures["closures"] = draw_closure_scores(result.loop_closures)
    return figures


def reference_of(result: "Result") -> Trajectory | None:
    """The true track of a simulated recording.

    Parameters
    ----------
    result : Result
        The run.

    Returns
    -------
    trajectory_ref : Trajectory or None
        The truth, where there is one.
    """
    return None if result.recording.truth is None else result.recording.truth.trajectory
