"""Figures of the tracks and of the loop closures."""

import re
import textwrap
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection

from frontend.arrays import FloatArray
from frontend.loop_closures import LoopClosure
from frontend.trajectory import Trajectory
from sssslam.products import figure_style as look
from sssslam.products.run import Run


def draw_tracks(run: Run, trajectory_ref: Trajectory | None) -> bytes:
    """Both tracks with the loop closures, and beneath how far they lie apart.

    Parameters
    ----------
    run : Run
        The tracks and candidates.
    trajectory_ref : Trajectory or None
        The reference, where there is one: then the lower panel shows both errors.

    Returns
    -------
    content : bytes
        A PNG.
    """
    with look.style():
        figure = look.new_figure(11, 8.2, right=1.9)
        plan, below = figure.subplots(2, 1, height_ratios=[3.4, 1], gridspec_kw={"hspace": 0.2})
        _draw_plan(plan, run, trajectory_ref)
        if trajectory_ref is None:
            _draw_shift(below, run)
        else:
            _draw_errors(below, run, trajectory_ref)
        return look.png(figure)


def _draw_plan(axes: Any, run: Run, trajectory_ref: Trajectory | None) -> None:
    rejected, accepted = ([c for c in run.loop_closures if bool(c.accepted) == wanted] for wanted in (False, True))
    faint = float(np.clip(60.0 / max(len(rejected), 1), 0.25, 0.8))
    _draw_closures(axes, run, rejected, {"colors": look.REJECTED, "linewidths": 0.7, "linestyles": ":", "alpha": faint})
    _draw_closures(axes, run, accepted, {"colors": look.ACCEPTED, "linewidths": 1.8, "alpha": 0.9, "zorder": 4})
    axes.plot(run.trajectory_dr.x, run.trajectory_dr.y, color=look.DEAD_RECKONED, lw=1.1, label="dead-reckoned")
    if trajectory_ref is not None:
        style = {"color": look.REFERENCE, "lw": 1.4, "ls": (0, (4, 3)), "zorder": 5}
        axes.plot(trajectory_ref.x, trajectory_ref.y, label="reference", **style)
    axes.plot(run.trajectory.x, run.trajectory.y, color=look.CORRECTED, lw=1.8, zorder=3, label="corrected")
    axes.plot(*run.trajectory.positions[0, :2], "o", color=look.INK, ms=6, zorder=6, label="start")
    axes.set(aspect="equal", xlabel="x, east [m]", ylabel="y, north [m]", title="Tracks and loop closures")
    axes.set_adjustable("datalim")
    axes.plot([], [], color=look.ACCEPTED, lw=1.8, label=f"accepted ({len(accepted)})")
    axes.plot([], [], color=look.REJECTED, lw=1.0, ls=":", label=f"rejected ({len(rejected)})")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.3)


def _draw_closures(axes: Any, run: Run, loop_closures: Sequence[LoopClosure], style: dict[str, Any]) -> None:
    ends = np.array([[run.anchor_time[c.target], run.anchor_time[c.source]] for c in loop_closures]).reshape(-1, 2)
    x, y = (np.interp(ends, run.trajectory.time, values) for values in (run.trajectory.x, run.trajectory.y))
    axes.add_collection(LineCollection(list(np.stack([x, y], axis=-1)), **style))


def _draw_shift(axes: Any, run: Run) -> None:
    shift = np.hypot(run.trajectory.x - run.trajectory_dr.x, run.trajectory.y - run.trajectory_dr.y)
    axes.plot(run.trajectory.distance, shift, color=look.CORRECTED, lw=1.6, label="shift")
    _finish_below(axes, run, "How far the track was moved")


def _draw_errors(axes: Any, run: Run, trajectory_ref: Trajectory) -> None:
    named = (
        ("dead-reckoned", run.trajectory_dr, look.DEAD_RECKONED, "--"),
        ("corrected", run.trajectory, look.CORRECTED, "-"),
    )
    for name, trajectory, colour, dash in named:
        error = _error(trajectory, trajectory_ref)
        axes.plot(run.trajectory.distance, error, color=colour, ls=dash, lw=1.6, label=f"error, {name}")
    _finish_below(axes, run, "Error against the reference, not aligned")


def _error(trajectory: Trajectory, trajectory_ref: Trajectory) -> FloatArray:
    ends = {"left": np.nan, "right": np.nan}
    x, y = (
        np.interp(trajectory.time, trajectory_ref.time, values, **ends)
        for values in (trajectory_ref.x, trajectory_ref.y)
    )
    return np.hypot(trajectory.x - x, trajectory.y - y)


def _finish_below(axes: Any, run: Run, title: str) -> None:
    sigma = 2.0 * np.hypot(run.sigmas[:, 0], run.sigmas[:, 1])
    if np.any(np.isfinite(sigma)):
        axes.fill_between(
            run.trajectory.distance, 0.0, sigma, color=look.CORRECTED, alpha=0.14, lw=0, label="claimed: 2 sigma"
        )
    axes.set(xlabel="distance run [m]", ylabel="horizontal [m]", title=title, ylim=(0, None))
    axes.margins(x=0.01)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.3)


def draw_closure_scores(loop_closures: Sequence[LoopClosure]) -> bytes:
    """Correlation against inliers and overlap of every candidate, rejected ones by their commonest reasons.

    Parameters
    ----------
    loop_closures : sequence of LoopClosure
        The candidates.

    Returns
    -------
    content : bytes
        A PNG.
    """
    groups = [("accepted", [c for c in loop_closures if c.accepted], look.ACCEPTED, "o")]
    groups += _by_reason([c for c in loop_closures if not c.accepted])
    with look.style():
        figure = look.new_figure(11, 4.4, right=3.0)
        left, right = figure.subplots(1, 2, sharey=True, gridspec_kw={"wspace": 0.08})
        for name, members, colour, marker in reversed(groups):
            _draw_scores((left, right), f"{name} ({len(members)})", members, {"color": colour, "marker": marker})
        left.set(xlabel="inliers", ylabel="correlation of heights", title="Candidates")
        left.xaxis.get_major_locator().set_params(integer=True)
        left.set_xlim(-0.5, 1.05 * max((c.n_inliers for c in loop_closures), default=0) + 0.5)
        right.set(xlabel="overlap, share of the smaller submap")
        handles, labels = right.get_legend_handles_labels()
        place = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.3}
        right.legend(handles[::-1], labels[::-1], **place)
        return look.png(figure)


def count_reasons(loop_closures: Sequence[LoopClosure]) -> dict[str, int]:
    """How many candidates were rejected for each kind of reason; numbers within a reason do not count.

    Parameters
    ----------
    loop_closures : sequence of LoopClosure
        The candidates.

    Returns
    -------
    counts : dict of str to int
        The commonest first.
    """
    counts = Counter(_kind(c.reason) for c in loop_closures if not c.accepted)
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def _kind(reason: str) -> str:
    """The words of a reason, with its numbers left out."""
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "…", reason) or "no reason given"


def _by_reason(rejected: Sequence[LoopClosure]) -> list[tuple[str, list[LoopClosure], str, str]]:
    common = list(count_reasons(rejected))[: len(look.REASON_COLOURS) - 1]
    groups = [(kind, [c for c in rejected if _kind(c.reason) == kind]) for kind in common]
    others = [c for c in rejected if _kind(c.reason) not in common]
    groups += [("other reasons", others)] if others else []
    return [(n, m, look.REASON_COLOURS[i], "xs^vD"[i]) for i, (n, m) in enumerate(groups)]


def _draw_scores(axes: Sequence[Any], name: str, members: Sequence[LoopClosure], style: dict[str, Any]) -> None:
    rows = [[c.n_inliers, c.overlap, c.correlation] for c in members]
    scores = np.array(rows, dtype=np.float64).reshape(-1, 3)
    unknown = int(np.count_nonzero(~np.isfinite(scores[:, 2])))
    label = textwrap.fill(f"{name}; {unknown} without a correlation" if unknown else name, 38)
    for axis, values in zip(axes, scores.T[:2], strict=True):
        axis.scatter(values, scores[:, 2], s=26, linewidths=1.2, alpha=0.85, label=label, **style)
