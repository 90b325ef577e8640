"""The table of loop-closure candidates, written and read."""

import csv
import os
from collections.abc import Mapping, Sequence

import numpy as np

from frontend.frames import planar_parameters, planar_pose
from frontend.loop_closures import LoopClosure
from sssslam.products.tracks import format_number, format_table

LOOP_CLOSURE_COLUMNS = (
    *("target", "source", "t_target", "t_source", "x", "y", "yaw", "sigma_x", "sigma_y", "sigma_yaw"),
    *("n_matches", "n_inliers", "correlation", "overlap", "accepted", "reason"),
)
_YAW, _X, _Y = 2, 3, 4  # rows of a 6-vector, rotation first


def format_loop_closures(loop_closures: Sequence[LoopClosure], anchor_time: Mapping[int, float]) -> str:
    """Loop-closure candidates as comma-separated values, ordered by target and source.

    Parameters
    ----------
    loop_closures : sequence of LoopClosure
        Candidates, accepted or not.
    anchor_time : mapping of int to float
        Time of each submap's anchor ping [s since 1970 UTC].

    Returns
    -------
    text : str
        A header and one row a candidate; unknown numbers are empty.

    Raises
    ------
    ValueError
        If a candidate names a submap that has no anchor time.
    """
    ordered = sorted(loop_closures, key=lambda closure: (closure.target, closure.source))
    return format_table(LOOP_CLOSURE_COLUMNS, [_row(closure, anchor_time) for closure in ordered])


def _row(closure: LoopClosure, anchor_time: Mapping[int, float]) -> list[str]:
    for number in (closure.target, closure.source):
        if number not in anchor_time:
            raise ValueError(f"a loop closure must join submaps of the run, got {number} of {len(anchor_time)} submaps")
    times = [anchor_time[closure.target], anchor_time[closure.source]]
    numbers = [*times, *planar_parameters(closure.T_target_source), *closure.sigmas[[_X, _Y, _YAW]]]
    counts = [str(closure.n_matches), str(closure.n_inliers)]
    scores = [format_number(closure.correlation), format_number(closure.overlap)]
    reason = "" if closure.accepted else " ".join(closure.reason.replace(",", ";").split())
    row = [str(closure.target), str(closure.source), *(format_number(number) for number in numbers), *counts, *scores]
    return [*row, "true" if closure.accepted else "false", reason]


def read_loop_closures(path: str | os.PathLike[str]) -> tuple[tuple[LoopClosure, ...], dict[int, float]]:
    """Read a table of loop-closure candidates.

    Parameters
    ----------
    path : path-like
        ``loop_closures.csv`` of a run.

    Returns
    -------
    loop_closures : tuple of LoopClosure
        Its rows; what the table does not hold is NaN.
    anchor_time : dict of int to float
        Anchor times of the submaps that the rows name [s since 1970 UTC].

    Raises
    ------
    ValueError
        If the file cannot be read, or is not such a table.
    """
    try:
        with open(path, encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: a table of loop closures is wanted, cannot read it ({error})") from None
    if not rows or tuple(rows[0]) != LOOP_CLOSURE_COLUMNS:
        raise ValueError(f"{path}: the header must be {','.join(LOOP_CLOSURE_COLUMNS)}")
    return _parse_rows(rows[1:], path)


def _parse_rows(
    rows: list[list[str]], path: str | os.PathLike[str]
) -> tuple[tuple[LoopClosure, ...], dict[int, float]]:
    loop_closures: list[LoopClosure] = []
    anchor_time: dict[int, float] = {}
    for i, cells in enumerate(rows, start=2):
        try:
            row = dict(zip(LOOP_CLOSURE_COLUMNS, cells, strict=True))
            loop_closures.append(_parse_row(row))
            anchor_time |= {int(row["target"]): float(row["t_target"]), int(row["source"]): float(row["t_source"])}
        except ValueError as error:
            raise ValueError(f"{path}, line {i}: not a row of loop closures ({error})") from None
    return tuple(loop_closures), anchor_time


def _parse_row(row: dict[str, str]) -> LoopClosure:
    if row["accepted"] not in ("true", "false"):
        raise ValueError(f"accepted must be true or false, got {row['accepted']!r}")
    sigmas = np.full(6, np.nan)
    sigmas[[_X, _Y, _YAW]] = [_number(row[name]) for name in ("sigma_x", "sigma_y", "sigma_yaw")]
    planar = [_number(row[name]) for name in ("x", "y", "yaw")]
    return LoopClosure(
        target=int(row["target"]),
        source=int(row["source"]),
        T_target_source=planar_pose(*planar) if np.all(np.isfinite(planar)) else np.full((4, 4), np.nan),
        sigmas=sigmas,
        n_matches=int(row["n_matches"]),
        n_inliers=int(row["n_inliers"]),
        correlation=_number(row["correlation"]),
        overlap=_number(row["overlap"]),
        accepted=row["accepted"] == "true",
        reason=row["reason"],
    )


def _number(cell: str) -> float:
    return float(cell) if cell else float("nan")
