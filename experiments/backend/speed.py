"""Ten thousand anchors and a thousand closures, a fifth of them false: time of the batch and of every anchor."""

import argparse
import os
import time

import numpy as np
from methods import make_graph
from scenes import WORST_OFFSET, Survey, make_survey

from backend.arrays import FloatArray, IntArray
from backend.beliefs import Chooser, Offer, believe_consistent
from backend.consistency import ConsistencyConfig
from backend.do_no_harm import DoNoHarmConfig
from backend.incremental import IncrementalGraph
from backend.pose_graph import PoseGraphConfig
from backend.poses import RelativePose
from backend.problem import Belief, Problem
from backend.solving import Rules, solve_problem

SHAPE = (40, 2400.0, 40.0, 2)  # legs, their length and spacing [m], ties
STEP = 10.0  # between anchors [m]


def closures_of(survey: Survey, n: int, rng: np.random.Generator) -> tuple[list[RelativePose], int]:
    """True and false closures between neighbouring legs and at ties, and how many of them are true."""
    n_true = round(0.8 * n)
    near = survey.revisits(41.0, 50)
    true = [survey.closure(near[k], np.zeros(3), rng) for k in np.sort(rng.choice(len(near), n_true, replace=False))]
    offsets = rng.uniform(-1.0, 1.0, (n - n_true, 3)) * WORST_OFFSET
    return [*true, *(survey.closure(near[rng.integers(len(near))], offset, rng) for offset in offsets)], n_true


def main() -> None:
    """Print times, errors and what was believed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drifts", nargs="+", type=float, default=[1.0, 3.0])
    parser.add_argument("--closures", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ways", nargs="+", default=["batch", "incremental"], choices=["batch", "incremental"])
    arguments = parser.parse_args()
    for drift in arguments.drifts:
        survey = make_survey(arguments.seed, drift, SHAPE, STEP)
        closures, n_true = closures_of(survey, arguments.closures, np.random.default_rng(arguments.seed))
        error = f"dead reckoning {drift:.0f}x its model, {survey.ate(survey.T_dr):.0f} m wrong"
        print(f"\n{len(survey.T_dr)} anchors; {error}; load {os.getloadavg()[0]:.1f}", flush=True)
        for way in arguments.ways:
            {"batch": batch, "incremental": incremental}[way](survey, make_graph(survey, closures).problem(), n_true)


def batch(survey: Survey, problem: Problem, n_true: int) -> None:
    """Time a solution of all."""
    solve(survey, problem, n_true, believe_consistent)


def solve(survey: Survey, problem: Problem, n_true: int, choose: Chooser) -> None:
    """Time what is left to do where closures are chosen in some way."""
    config = PoseGraphConfig()
    rng, rules = np.random.default_rng(0), (config.inlier_probability, ConsistencyConfig(), DoNoHarmConfig(), None)
    wall, cpu = time.perf_counter(), time.process_time()
    solution = solve_problem(problem, Rules(choose, *rules, rng), {})
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    print(f"solved: {wall:.1f} s ({cpu:.1f} s CPU), {verdict(survey, solution.T_world_anchor)}", end=", ")
    print(counts(np.flatnonzero(solution.is_inlier), n_true), flush=True)


def incremental(survey: Survey, problem: Problem, n_true: int) -> None:
    """Time each anchor, with whatever closures end at it."""
    every = np.arange(len(problem.closures))
    graph = IncrementalGraph(Offer(problem, every, ConsistencyConfig(), np.random.default_rng(0)))
    last = np.array([max(closure.target, closure.source) for closure in problem.closures])
    seconds = []
    for anchor in range(len(problem.T_world_anchor_dr)):
        wall, cpu = time.perf_counter(), time.process_time()
        graph.advance(np.flatnonzero(last == anchor))
        seconds.append((time.perf_counter() - wall, time.process_time() - cpu))
    wall = time.perf_counter()
    graph.settle()
    wall = time.perf_counter() - wall
    for name, column in zip(("", " of CPU"), np.array(seconds).T, strict=True):
        median, late, longest = 1e3 * np.percentile(column, [50, 99, 100])
        print(f"incremental{name}: {median:.1f} ms median, {late:.0f} ms 99th percentile, {longest:.0f} ms longest")
    print(f"{wall:.1f} s to settle, {verdict(survey, graph.solver.poses())}", end=", ")
    print(counts(graph.believed, n_true), flush=True)
    # what the whole graph bears out of it: with method "incremental" this is what comes back
    belief = Belief(graph.believed, graph.scale, graph.solver.poses())
    solve(survey, problem, n_true, lambda _: belief)


def verdict(survey: Survey, T: FloatArray) -> str:
    """Error of a track."""
    return f"{survey.ate(T):.2f} m wrong"


def counts(held: IntArray, n_true: int) -> str:
    """How many true and false closures hold."""
    return f"{(held < n_true).sum()} of {n_true} true and {(held >= n_true).sum()} false closures"


if __name__ == "__main__":
    main()
