"""The probability that a candidate is true: fitted on tuning seeds, judged on reporting seeds."""

import argparse
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import figures
import numpy as np
from dives import INFORMATIVE, TUNING_SEEDS
from report import HALF, THIRD, is_right, is_seen_again
from scipy.optimize import minimize

from frontend.acceptance import AcceptanceConfig, Rejection
from frontend.probability import probability

Record = dict[str, Any]
HERE = Path(__file__).resolve().parent
EDGES = (0.0, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999, 1.0)
_CHANCES = (1e-12, 1e2)  # beyond which one counts no more, as in `frontend.probability`
_SHRINK = 0.1  # of the weights of standardised numbers: a hundredth of what the records say


def fit(records: Sequence[Record]) -> tuple[float, float, float]:
    """Offset and the weights of lead and decades of chance that make the truth of the records likeliest."""
    x = np.array([[r["lead"], -np.log10(np.clip(r["chance"], *_CHANCES))] for r in records])
    sign = np.where([is_right(r) for r in records], 1.0, -1.0)
    mean, scale = x.mean(axis=0), x.std(axis=0)
    design = np.column_stack([np.ones(len(x)), (x - mean) / scale])

    def cost(b: np.ndarray) -> float:
        return float(np.logaddexp(0.0, -sign * (design @ b)).sum() + _SHRINK * (b[1:] ** 2).sum())

    b = minimize(cost, np.zeros(3)).x
    weights = b[1:] / scale
    return float(b[0] - weights @ mean), float(weights[0]), float(weights[1])


def said(record: Record) -> float:
    """What the chain says of a record."""
    return probability(record["lead"], record["chance"], AcceptanceConfig().probability)


def by_chance(record: Record) -> float:
    """What the chance of unrelated floors would say, were it the probability of being false."""
    return 1.0 - min(record["chance"], 1.0)


def reliability(records: Sequence[Record], claim: Callable[[Record], float]) -> list[tuple[float, float, int]]:
    """Mean claim, share that is right, and number of the records of each class of the claim."""
    claims, right = np.array([claim(r) for r in records]), np.array([is_right(r) for r in records])
    which = np.clip(np.searchsorted(EDGES, claims, side="right") - 1, 0, len(EDGES) - 2)
    chosen = [which == k for k in range(len(EDGES) - 1)]
    return [(float(claims[c].mean()), float(right[c].mean()), int(c.sum())) for c in chosen if c.any()]


def log_loss(records: Sequence[Record], claim: Callable[[Record], float]) -> float:
    """Mean logarithmic loss [nat], no claim surer than 1e-6."""
    claims = np.clip([claim(r) for r in records], 1e-6, 1 - 1e-6)
    return float(-np.mean(np.log(np.where([is_right(r) for r in records], claims, 1 - claims))))


def fits(record: Record) -> bool:
    """Whether the rules on geometry hold; only they and the lead come before that on probability."""
    return record["reason"] in ("", Rejection.BY_CHANCE, Rejection.AMBIGUOUS)


def is_loose(record: Record) -> bool:
    """Whether the alignment is open in a direction, a rule that comes last."""
    return max(record["sigma_x"], record["sigma_y"]) > AcceptanceConfig().max_sigma


def is_sure(record: Record, least: float) -> bool:
    """The rules on geometry, a probability and the least lead."""
    sure = "chance" in record and fits(record) and not is_loose(record) and said(record) >= least
    return bool(sure and record["lead"] >= AcceptanceConfig().min_lead)


def is_no_chance(record: Record) -> bool:
    """A chance of 1e-4, a lead of 1 and a correlation of 0.2 in the place of the probability."""
    if "chance" not in record or not fits(record) or is_loose(record):
        return False
    return bool(record["chance"] <= 1e-4 and record["lead"] >= 1.0 and record["correlation"] >= 0.2)


def acceptance_lines(records: Sequence[Record]) -> Iterable[str]:
    """What would be accepted at several probabilities, beside what is."""
    yield "| rule | accepted | false | informative, 50 % and more | 30 to 50 % |\n|---|---|---|---|---|"
    yield _counts("as it is", records, lambda r: bool(r.get("accepted")))
    yield _counts("chance of 1e-4, lead of 1, correlation of 0.2", records, is_no_chance)
    for least in (0.9, 0.95, 0.97, 0.98, 0.99, 0.997):
        yield _counts(f"probability of {least} and more", records, lambda r, p=least: is_sure(r, p))


def _counts(name: str, records: Sequence[Record], accepts: Callable[[Record], bool]) -> str:
    kept = [r for r in records if accepts(r)]
    shares = []
    for overlap in (HALF, THIRD):
        of = [r for r in records if r["floor"] in INFORMATIVE and is_seen_again(r, (overlap,))]
        shares.append(f"{sum(accepts(r) and is_right(r) for r in of)}/{len(of)}")
    return f"| {name} | {len(kept)} | {sum(not is_right(r) for r in kept)} | {' | '.join(shares)} |"


def highest(records: Sequence[Record]) -> str:
    """The most probable alignments that are false."""
    false = sorted((r for r in records if not is_right(r)), key=said)[:-4:-1]
    return "; ".join(f"{r['floor']} {r['seed']} {said(r):.3f} with overlap {r['true_overlap']:.2f}" for r in false)


def main() -> None:
    """Fit, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE / "out")
    arguments = parser.parse_args()
    files = sorted((arguments.out / "pairs").glob("chain-reconstructed-*.json"))
    records = [record for file in files for record in json.loads(file.read_text())]
    verified = [r for r in records if "chance" in r]
    tuning = [r for r in verified if r["seed"] in TUNING_SEEDS]
    print("Fit: offset {:.2f}, lead {:.2f}, chance {:.2f}".format(*fit(tuning)), end=", ")
    print(f"{np.mean([is_right(r) for r in tuning]):.2f} of {len(tuning)} right.\n")
    print("Tuning seeds.", "", *acceptance_lines([r for r in records if r["seed"] in TUNING_SEEDS]), "", sep="\n")
    for heading in ("known", "unknown"):
        chosen = [r for r in verified if r["seed"] not in TUNING_SEEDS and r["heading"] == heading]
        if not chosen:
            continue
        print(f"Reporting seeds, heading {heading}: log loss {log_loss(chosen, said):.3f}, ", end="")
        print(f"of 1 - chance {log_loss(chosen, by_chance):.3f}.\n\n| said | right | candidates |\n|---|---|---|")
        for mean, right, n in reliability(chosen, said):
            print(f"| {mean:.3f} | {right:.3f} | {n} |")
        everything = [r for r in records if r["seed"] not in TUNING_SEEDS and r["heading"] == heading]
        print("", *acceptance_lines(everything), "", sep="\n")
        print(f"False at the highest: {highest(chosen)}\n")
        curves = {"probability": reliability(chosen, said), "1 - chance": reliability(chosen, by_chance)}
        figures.draw_reliability(curves, arguments.out / f"reliability_{heading}.png")


if __name__ == "__main__":
    main()
