"""Tables of the loop closure experiment: precision and recall, errors, covariance, time."""

import json
import subprocess
from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import figures
import numpy as np
from dives import INFORMATIVE, TUNING_SEEDS
from scipy.stats import chi2

Record = dict[str, Any]
MAX_SHIFT, MAX_TURN = 3.0, np.radians(5.0)  # of a true closure, as `sssslam evaluate` has it
TURNS = ("0", "30", "90", "150", "180", "random")
HALF, THIRD, FAINT, APART = "50 % and more", "30 to 50 %", "10 to 30 %", "none"


def overlap_class(overlap: float, elsewhere: bool) -> str:
    """What share of the smaller submap the other covers, in words."""
    if elsewhere:
        return "elsewhere"
    return next((name for least, name in ((0.5, HALF), (0.3, THIRD), (0.1, FAINT)) if overlap >= least), APART)


def write(files: Sequence[Path], out: Path) -> None:
    """All tables as markdown, printed and kept, and the figures beside them."""
    records = [record for file in files for record in json.loads(file.read_text())]
    reporting = [r for r in records + by_chance(records) if r["seed"] not in TUNING_SEEDS]
    shipped = [r for r in reporting if r["row"] == "chain"]
    parts = [f"Commit {commit()}.", "Reporting seeds.", ranking_table(reporting)]
    parts += [turn_table(reporting), "As accepted.", accepted_table(shipped), "Tuning seeds, as accepted."]
    parts.append(accepted_table([r for r in records if r["row"] == "chain" and r["seed"] in TUNING_SEEDS]))
    text = "\n\n".join(parts) + "\n"
    (out / "tables.md").write_text(text, encoding="utf-8")
    print(text)
    told = [r for r in reporting if r["floor"] in INFORMATIVE]
    figures.draw_curves({name: curve(group) for name, group in rows_of(told)}, out / "precision_recall.png")


def by_chance(records: Sequence[Record]) -> list[Record]:
    """What the chain found, ranked by the chance of unrelated floors instead of the probability."""
    chain = [r for r in records if r["row"] == "chain"]
    scores = [-np.log10(max(r["chance"], 1e-300)) if np.isfinite(r["score"]) else -np.inf for r in chain]
    return [{**r, "row": "chance", "score": float(score)} for r, score in zip(chain, scores, strict=True)]


def is_right(record: Record) -> bool:
    """Whether what was found is within 3 m and 5 degrees of the truth; false where the floors are not the same."""
    shift = np.hypot(record["error_x"], record["error_y"])
    return bool(not record["elsewhere"] and shift <= MAX_SHIFT and abs(record["error_yaw"]) <= MAX_TURN)


def is_seen_again(record: Record, classes: tuple[str, ...] = (HALF, THIRD)) -> bool:
    """Whether a pair overlaps as much as the classes say."""
    return overlap_class(record["true_overlap"], record["elsewhere"]) in classes


def threshold(records: Sequence[Record]) -> float:
    """The highest score of what is wrong; above it precision is 100 %."""
    return max((r["score"] for r in records if not is_right(r)), default=-np.inf)


def recall(records: Sequence[Record], above: float, wanted: Callable[[Record], bool]) -> float:
    """Share of the wanted pairs found rightly with a score above; NaN where there are none."""
    of = [r for r in records if wanted(r)]
    return sum(is_right(r) and r["score"] > above for r in of) / len(of) if of else float("nan")


def curve(records: Sequence[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Recall of pairs with an overlap of 30 % and more, and precision of all, from the surest down."""
    ranked = sorted((r for r in records if np.isfinite(r["score"])), key=lambda r: -r["score"])
    right = np.array([is_right(r) for r in ranked], dtype=bool)
    seen = np.array([is_seen_again(r) for r in ranked], dtype=bool)
    n = sum(is_seen_again(r) for r in records)
    return np.cumsum(right & seen) / max(n, 1), np.cumsum(right) / np.arange(1, len(right) + 1)


def area(records: Sequence[Record]) -> float:
    """Area under the curve of precision over recall: mean precision where recall rises."""
    recalls, precisions = curve(records)
    return float(np.sum(np.diff(recalls, prepend=0.0) * precisions)) if len(recalls) else 0.0


def rows_of(records: Sequence[Record]) -> Iterable[tuple[tuple[str, str, str], list[Record]]]:
    """The records of each row, surface and knowledge of the heading."""
    key: Callable[[Record], tuple[str, str, str]] = lambda r: (r["heading"], r["surface"], r["row"])  # noqa: E731
    return [(name, list(group)) for name, group in groupby(sorted(records, key=key), key)]


def ranking_table(records: Sequence[Record]) -> str:
    """One line a row: how well its score tells right from wrong."""
    head = ("heading", "terrain", "row", "pairs", "area", "wrong scores up to", HALF, THIRD, "ms a pair")
    lines = [_line(head), _line(["---"] * len(head))]
    for (heading, surface, row), group in rows_of(records):
        told = [r for r in group if r["floor"] in INFORMATIVE]
        limit = threshold(group)
        shares = [recall(told, limit, lambda r, c=c: is_seen_again(r, (c,))) for c in (HALF, THIRD)]
        ms = np.median([r["ms"] for r in group])
        lines.append(
            _line([heading, surface, row, len(group), *map(_number, (area(told), limit, *shares)), f"{ms:.0f}"])
        )
    return "\n".join(lines)


def turn_table(records: Sequence[Record]) -> str:
    """Recall at 100 % precision of pairs with an overlap of half and more, by heading difference."""
    head = ("heading", "terrain", "row", *(f"{turn} deg" if turn != "random" else turn for turn in TURNS))
    lines = [_line(head), _line(["---"] * len(head))]
    for name, group in rows_of(records):
        told, limit = [r for r in group if r["floor"] in INFORMATIVE], threshold(group)
        shares = [recall(told, limit, lambda r, t=t: is_seen_again(r, (HALF,)) and r["turn"] == t) for t in TURNS]
        lines.append(_line([*name, *map(_number, shares)]))
    return "\n".join(lines)


def accepted_table(records: Sequence[Record]) -> str:
    """One line a floor: what the chain accepts as it is."""
    head = ("heading", "terrain", "floor", "pairs", "accepted", "false", HALF, THIRD, "error [m]", "[deg]", "NEES / 3")
    lines = [_line((*head, "bounds")), _line(["---"] * (len(head) + 1))]
    key: Callable[[Record], tuple[str, str, str]] = lambda r: (r["heading"], r["surface"], r["floor"])  # noqa: E731
    for name, group in groupby(sorted(records, key=key), key):
        lines.append(_line([*name, *_accepted(list(group))]))
    for (heading, surface, _), group in rows_of([r for r in records if r["floor"] in INFORMATIVE]):
        lines.append(_line([heading, surface, "informative", *_accepted(group)]))
    return "\n".join(lines)


def _accepted(records: Sequence[Record]) -> list[str]:
    """Counts, recalls, errors and NEES of what is accepted."""
    kept = [r for r in records if r.get("accepted")]
    right = [r for r in kept if is_right(r)]
    shares = []
    for name in (HALF, THIRD):
        of = [r for r in records if is_seen_again(r, (name,))]
        found = sum(bool(r.get("accepted")) and is_right(r) for r in of)
        shares.append(f"{found}/{len(of)} = {found / len(of):.2f}" if of else "")
    counts = [str(len(records)), str(len(kept)), str(len(kept) - len(right)), *shares]
    if not right:
        return [*counts, "", "", "", ""]
    shift = np.median([np.hypot(r["error_x"], r["error_y"]) for r in right])
    turn = np.degrees(np.median([abs(r["error_yaw"]) for r in right]))
    low, high = chi2.ppf([0.025, 0.975], 3 * len(right)) / (3 * len(right))
    return [*counts, f"{shift:.2f}", f"{turn:.2f}", f"{np.mean(nees(right)) / 3:.2f}", f"{low:.2f} to {high:.2f}"]


def nees(records: Sequence[Record]) -> np.ndarray:
    """Squared errors of x, y and yaw over their variances, summed; 3 on average where sigmas are honest."""
    return np.array([sum((r[f"error_{n}"] / r[f"sigma_{n}"]) ** 2 for n in ("x", "y", "yaw")) for r in records])


def commit() -> str:
    """The commit this runs on, where there is one."""
    asked = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    return asked.stdout.strip() or "unknown"


def _number(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else ""


def _line(cells: Iterable[object]) -> str:
    return f"| {' | '.join(str(cell) for cell in cells)} |"
