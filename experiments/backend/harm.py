"""How often does the back end make a track worse? Random surveys, some true closures or none, every kind of false."""

import argparse
import itertools
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from methods import METHODS
from scenes import KINDS, drifted_survey, figure_of_eight, lawn_mower, repeated_line

from backend.poses import RelativePose

PATHS = {
    "lawn mower": lawn_mower(6, 200.0, 30.0, 2, 30.0),
    "line again": repeated_line(4, 200.0, 30.0),
    "eight": figure_of_eight(3, 45.0, 20.0),
}
N_FALSE = 30  # at most
WORSE, LEAST = 1.05, 0.2  # times dead reckoning, or so many metres more, the larger


class Case(NamedTuple):
    """What is random of a graph is drawn from its seed; the rest are its rows in the table."""

    drift: float
    too_sure: float
    has_true: bool
    kind: str


class Verdict(NamedTuple):
    """Errors of a graph before and after [m], and how many false closures were held."""

    before: float
    after: float
    n_false: int

    @property
    def is_worse(self) -> bool:
        """Whether harm was done."""
        return self.after > max(WORSE * self.before, self.before + LEAST)


def cases() -> Iterator[Case]:
    """All rows."""
    for row in itertools.product((1.0, 3.0), (1.0, 3.0), (True, False), KINDS):
        yield Case(*row)


def judge(case: Case, seed: int, method: str) -> tuple[str, Verdict]:
    """One random graph: its path and what became of it."""
    rng = np.random.default_rng([seed, list(KINDS).index(case.kind), case.has_true])
    path = list(PATHS)[rng.integers(len(PATHS))]
    survey = drifted_survey(*PATHS[path], case.drift, rng)
    pairs = survey.revisits(20.0, 5)
    n_true = int(rng.integers(1, 1 + min(N_FALSE, len(pairs)))) if case.has_true else 0
    true = [survey.closure(pairs[k], np.zeros(3), rng) for k in np.sort(rng.choice(len(pairs), n_true, replace=False))]
    n_false = int(rng.integers(1, N_FALSE + 1))
    false = KINDS[case.kind](survey, n_false, int(rng.integers(1, n_false + 1)), rng)
    closures = [*true, *false]
    result = METHODS[method](survey, [surer(closure, case.too_sure) for closure in closures])
    n_held = int((result.taken >= n_true).sum()) if result.taken is not None else len(false)
    return path, Verdict(survey.ate(survey.T_dr), survey.ate(result.T), n_held)


def surer(closure: RelativePose, factor: float) -> RelativePose:
    """A closure that takes itself for better than it is."""
    return replace(closure, covariance=closure.covariance / factor**2)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", default="ours", choices=list(METHODS))
    parser.add_argument("--seeds", type=int, default=20, help="graphs a row")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=list(KINDS))
    arguments = parser.parse_args()
    print("| drift | sigmas | true closures | false closures | worse | by path | worst | median after / before |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for case in cases():
        if case.kind in arguments.kinds:
            print(row_of(case, [judge(case, seed, arguments.method) for seed in range(arguments.seeds)]), flush=True)


def row_of(case: Case, found: list[tuple[str, Verdict]]) -> str:
    """A row of the table."""
    worse, ratio = defaultdict[str, int](int), np.array([verdict.after / verdict.before for _, verdict in found])
    for path, verdict in found:
        worse[path] += verdict.is_worse
    paths = ", ".join(f"{path} {count}" for path, count in worse.items() if count)
    sigmas = "honest" if case.too_sure == 1.0 else f"{case.too_sure:.0f}x too small"
    name = f"| {case.drift:.0f}x | {sigmas} | {'some' if case.has_true else 'none'} | {case.kind} "
    return f"{name}| {sum(worse.values())} of {len(found)} | {paths} | {ratio.max():.1f} | {np.median(ratio):.2f} |"


if __name__ == "__main__":
    main()
