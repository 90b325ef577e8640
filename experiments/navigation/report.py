"""Tables of the navigation experiment: medians over runs, and what is worse than dead reckoning."""

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from typing import Any

import numpy as np

Run = dict[str, Any]
REPORTING_SEEDS = frozenset({3, 4, 5})
REPORTING_TERRAIN = "sand-waves"
VARIANTS = ("dead reckoning", "ours", "without verification", "plain least squares", "true closures given")
_COLUMNS: tuple[tuple[str, str, float], ...] = (
    ("ATE [m]", "ate", 1.0),
    ("unaligned [m]", "ate_unaligned", 1.0),
    ("SE(3) [m]", "ate_se3", 1.0),
    ("RPE leg [m]", "rpe_leg", 1.0),
    ("RPE leg [deg]", "rpe_yaw_leg", 180.0 / np.pi),
    ("RPE 100 m [m]", "rpe_100m", 1.0),
    ("end [m]", "end_point_error", 1.0),
    ("end [%]", "end_point_error_share", 1.0),
    ("closures true", "closures_true", 1.0),
    ("false", "closures_false", 1.0),
    ("NEES", "track_nees", 1.0),
)


def tables(runs: Sequence[Run]) -> str:
    """Markdown: one table a track source and kind of seed, one line a terrain, grade and variant."""
    parts = []
    for kept, of in ((is_reporting, "for reporting"), (lambda run: not is_reporting(run), "looked at while tuning")):
        chosen = [run for run in runs if kept(run)]
        parts += [_table(source, of, group) for source, group in _grouped(chosen, ("source",))]
    return "\n\n".join(parts)


def is_reporting(run: Run) -> bool:
    """Whether no setting was chosen by looking at a run of this seed or floor."""
    return run["seed"] in REPORTING_SEEDS or run["terrain"] == REPORTING_TERRAIN


def is_worse(run: Run, variant: str) -> bool:
    """Whether a track is worse than dead reckoning by more than 5 % and 0.2 m."""
    row = run["variants"][variant]
    return bool(row["ate"] > row["ate_dr"] + max(0.05 * row["ate_dr"], 0.2))


def _table(source: tuple[str, ...], of: str, runs: Sequence[Run]) -> str:
    commits = ", ".join(sorted({run["commit"] for run in runs}))
    seconds = np.median([1e3 * run["slam_seconds"] / run["n_pings"] for run in runs])
    judge = max(_disagreement(runs), default=float("nan"))
    head = ("terrain", "equipment", "track", "runs", "ATE / DR", *(title for title, _, _ in _COLUMNS), "worse")
    lines = [
        f"Track {source[0]}, seeds and floors {of}: {len(runs)} runs, commit {commits}, {seconds:.0f} ms a ping in the "
        f"median; evo's ATE differs by at most {judge:.1e} m.",
        "",
        f"| {' | '.join(head)} |",
        f"|{'---|' * len(head)}",
    ]
    for key, group in _grouped(runs, ("terrain", "grade")):
        lines += [_line(key, variant, group) for variant in VARIANTS]
    return "\n".join(lines)


def _line(key: tuple[str, ...], variant: str, runs: Sequence[Run]) -> str:
    rows = [run["variants"][variant] for run in runs]
    figures = [_median(row["ate"] / row["ate_dr"] for row in rows)]
    figures += [_median(scale * row[name] for row in rows) for _, name, scale in _COLUMNS]
    worse = sum(is_worse(run, variant) for run in runs)
    return f"| {' | '.join([*key, variant, str(len(runs)), *figures, str(worse)])} |"


def _median(values: Iterable[float]) -> str:
    """The median, or nothing where no run has a figure."""
    known = [value for value in values if np.isfinite(value)]
    return f"{np.median(known):.2f}" if known else ""


def _disagreement(runs: Sequence[Run]) -> list[float]:
    rows = [row for run in runs for row in run["variants"].values()]
    return [abs(row["ate"] - row["ate_by_evo"]) for row in rows if np.isfinite(row["ate_by_evo"])]


def _grouped(runs: Sequence[Run], names: tuple[str, ...]) -> list[tuple[tuple[str, ...], list[Run]]]:
    key: Callable[[Run], tuple[str, ...]] = lambda run: tuple(run[name] for name in names)  # noqa: E731
    return [(group, list(members)) for group, members in groupby(sorted(runs, key=key), key)]
