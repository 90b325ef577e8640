"""What it is worth to tell the graph what of the drift is constant: false closures, and ten thousand anchors."""

import argparse
import time

import numpy as np
from methods import make_graph
from scenes import KINDS, MODEL, Survey, make_survey
from speed import SHAPE, STEP, closures_of

from backend.dead_reckoning import DeadReckoning
from backend.pose_graph import PoseGraph
from backend.poses import RelativePose

_GROUP = 8  # false closures that share an offset
_REVISIT = 20.0  # m between anchors that true closures join


def told(survey: Survey, closures: list[RelativePose]) -> PoseGraph:
    """A graph that knows what is constant."""
    graph = make_graph(survey, closures)
    constants = DeadReckoning(survey.time, survey.T_dr, MODEL).constant_errors(np.arange(len(survey.T_dr)))
    assert constants is not None
    graph.add_constant_errors(constants)
    return graph


def false_closures(drift: float, kind: str, seeds: list[int]) -> str:
    """A row: errors of the anchors without and with, and the false closures that hold."""
    rows = []
    for seed in seeds:
        survey, rng = make_survey(seed, drift), np.random.default_rng(seed)
        true = [survey.closure(pair, np.zeros(3), rng) for pair in survey.revisits(_REVISIT, 5)]
        closures = [*true, *KINDS[kind](survey, 2 * len(true), min(_GROUP, len(true)), rng)]
        row = [survey.ate(survey.T_dr)]
        for make in (make_graph, told):
            solution = make(survey, closures).solve()
            row += [survey.ate(solution.T_world_anchor), int(solution.is_inlier[len(true) :].sum())]
        rows.append(row)
    still, without, n_without, with_them, n_with = np.array(rows).T
    cells = [kind, f"{drift:.0f}x", f"{np.median(still):.1f}"]
    cells += [f"{np.median(errors):.2f} ({errors.max():.2f})" for errors in (without, with_them)]
    return f"| {' | '.join(cells)} | {n_without.sum():.0f}, {n_with.sum():.0f} |"


def ten_thousand() -> str:
    """Time of the batch."""
    survey = make_survey(0, 1.0, SHAPE, STEP)
    closures, n_true = closures_of(survey, 1000, np.random.default_rng(0))
    graph = told(survey, closures)
    cpu = time.process_time()
    solution = graph.solve()
    cpu = time.process_time() - cpu
    held = solution.is_inlier[:n_true].sum()
    return f"{cpu:.1f} s of CPU, {survey.ate(solution.T_world_anchor):.2f} m wrong, {held} of {n_true} true closures"


def main() -> None:
    """Print the table, and the time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drifts", nargs="+", type=float, default=[1.0, 3.0])
    parser.add_argument("--kinds", nargs="+", default=["independent", "neighbouring", "scattered"], choices=list(KINDS))
    parser.add_argument("--seeds", nargs="+", type=int, default=list(range(10, 15)))
    arguments = parser.parse_args()
    for drift in arguments.drifts:
        for kind in arguments.kinds:
            print(false_closures(drift, kind, arguments.seeds), flush=True)
    for _ in range(2):  # the first compiles kernels where numba's cache is cold
        print(ten_thousand(), flush=True)


if __name__ == "__main__":
    main()
