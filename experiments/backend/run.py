"""False closures against the back end: one row a kind, share and drift, one column a method."""

import argparse
import platform
import subprocess
import time
from collections import defaultdict

import numpy as np
from methods import METHODS, least_squares
from scenes import KINDS, make_survey

SHARES = [0.0, 0.25, 0.5, 0.67, 0.86, 0.9]


Seconds = dict[str, list[float]]


def ratios(case: tuple[str, float, float], seed: int, methods: list[str], seconds: Seconds) -> list[float]:
    """Error of each method over that of least squares with only the true closures."""
    kind, share, drift = case
    survey, rng = make_survey(seed, drift), np.random.default_rng(seed + 100)
    true = [survey.closure(pair, np.zeros(3), rng) for pair in survey.revisits(20.0, 5)]
    false = KINDS[kind](survey, round(share / (1.0 - share) * len(true)), len(true), rng)
    reference = survey.ate(least_squares(survey, true).T)
    found = []
    for name in methods:
        start = time.process_time()
        found.append(survey.ate(METHODS[name](survey, [*true, *false]).T) / reference)
        seconds[name].append(time.process_time() - start)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=list(KINDS))
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES)
    parser.add_argument("--drifts", nargs="+", type=float, default=[1.0, 3.0])
    parser.add_argument("--seeds", nargs="+", type=int, default=list(range(10, 20)))
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=list(METHODS))
    arguments = parser.parse_args()
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
    print(f"commit {commit.stdout.strip()}, {platform.machine()}, seeds {arguments.seeds}\n")
    print(f"| false closures | share | drift | {' | '.join(arguments.methods)} |")
    print("|---" * (3 + len(arguments.methods)) + "|", flush=True)
    seconds: Seconds = defaultdict(list)
    cases = [(k, s, d) for d in arguments.drifts for k in arguments.kinds for s in arguments.shares]
    for case in cases:
        rows = np.array([ratios(case, seed, arguments.methods, seconds) for seed in arguments.seeds])
        cells = [f"{np.median(column):.2f} ({column.max():.1f})" for column in rows.T]
        print(f"| {case[0]} | {100 * case[1]:.0f} % | {case[2]:.0f}x | {' | '.join(cells)} |", flush=True)
    times = " | ".join(f"{np.median(seconds[name]):.2f}" for name in arguments.methods)
    print(f"| median CPU [s] | | | {times} |")


if __name__ == "__main__":
    main()
