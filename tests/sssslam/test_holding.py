from dataclasses import replace

import gtsam
import numpy as np
import pytest

from backend import solving
from backend.dead_reckoning import DeadReckoning, DeadReckoningConfig
from backend.pose_graph import PoseGraph
from backend.solution import Withdrawal
from frontend.frames import invert, planar_pose
from frontend.loop_closures import LoopClosure
from sssslam.config import Config
from sssslam.graph import solve_graph
from sssslam.holding import INSOLUBLE, hold
from sssslam.overrides import Overrides
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor

SIGMAS = np.array([0.01, 0.01, 0.005, 0.1, 0.1, 0.1])
N = 20  # anchors: out and back on one line, 20 m from one to the next


def there_and_back():
    """True poses of the anchors: ten to the east, ten back beside them."""
    out = [planar_pose(20.0 * k, 0.0, 0.0) for k in range(N // 2)]
    back = [planar_pose(20.0 * k, 5.0, np.pi) for k in reversed(range(N // 2))]
    return np.stack([*out, *back])


def graph_with(offsets):
    """A graph without drift; closures by their offset in x and y [m] from the truth."""
    T, time = there_and_back(), 13.0 * np.arange(N)
    reckoning = DeadReckoning(time, T, DeadReckoningConfig())
    graph = PoseGraph(T)
    graph.add_first_pose([0.005, 0.005, 0.01, 0.1, 0.1, 0.1])
    for k in range(N):
        graph.add_depth_and_tilt(k, 0.1, 0.005)
    for k in range(N - 1):
        graph.add_odometry(k, k + 1, invert(T[k]) @ T[k + 1], reckoning.odometry_covariance(k, k + 1))
    for (target, source), offset in offsets.items():
        measured = planar_pose(*offset, 0.0) @ invert(T[target]) @ T[source]
        graph.add_closure(target, source, measured, SIGMAS)
    return graph


def relative(solution, target, source):
    return (invert(solution.T_world_anchor[target]) @ solution.T_world_anchor[source])[:2, 3]


def test_a_lone_closure_that_nobody_confirms_holds_when_it_is_forced():
    graph = graph_with({(2, 17): (3.0, 0.0)})
    before = graph.solve()
    assert before.reasons == (str(Withdrawal.ALONE),)
    after = hold(graph, before, [0])
    assert after.reasons == ("",)
    assert after.is_inlier.tolist() == [True]
    # the truth is (0, 5); dead reckoning is uncertain by metres over 300 m, the closure by 0.1 m
    assert relative(after, 2, 17) == pytest.approx([3.0, 5.0], abs=0.1)
    assert after.error_after < after.error_before
    assert after.g2o.count("EDGE") == N


def test_a_forced_closure_far_beyond_the_drift_is_met_and_dead_reckoning_says_less():
    graph = graph_with({(2, 17): (40.0, -30.0)})
    after = hold(graph, graph.solve(), [0])
    assert relative(after, 2, 17) == pytest.approx([40.0, -25.0], abs=1.0)  # ten sigmas: a pull of odometry is left
    assert after.odometry_scale > 1.5
    near = graph_with({(2, 17): (0.0, 0.0)})
    assert after.sigmas[10, 0] > 1.2 * hold(near, near.solve(), [0]).sigmas[10, 0]


def test_what_the_back_end_kept_stays_beside_what_is_forced():
    good = {(k, N - 1 - k): (0.0, 0.0) for k in range(0, 8, 2)}
    graph = graph_with({**good, (1, 10): (6.0, 6.0), (3, 12): (-9.0, 9.0)})
    before = graph.solve()
    assert before.is_inlier.tolist() == [True] * 4 + [False] * 2
    after = hold(graph, before, [4])
    assert after.is_inlier.tolist() == [True] * 5 + [False]
    assert after.reasons == ("",) * 5 + before.reasons[5:]


def test_nothing_changes_where_all_that_is_forced_holds_already():
    graph = graph_with({(k, N - 1 - k): (0.0, 0.0) for k in range(0, 8, 2)})
    solution = graph.solve()
    assert hold(graph, solution, [0, 3]) is solution
    assert hold(graph, solution, []) is solution


def test_a_fix_that_the_back_end_did_not_take_stays_out_where_a_closure_is_forced():
    graph = graph_with({(2, 17): (3.0, 0.0)})
    graph.add_fix(10, 5000.0, -5000.0, 1.0)  # 7 km off
    before = graph.solve()
    assert before.fix_reasons[0]
    after = hold(graph, before, [0])
    assert after.fix_reasons == before.fix_reasons
    assert np.abs(after.T_world_anchor[10, :2, 3] - there_and_back()[10, :2, 3]).max() < 20.0  # what 3 m may move


def test_poses_are_those_of_the_least_squares_of_gtsam():
    graph = graph_with({(2, 17): (3.0, 0.0)})
    after = hold(graph, graph.solve(), [0])
    T, noise = there_and_back(), gtsam.noiseModel.Gaussian.Covariance
    judge, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for factor in graph.problem().known_factors(after.odometry_scale):
        judge.push_back(factor)
    measured = gtsam.Pose3(planar_pose(3.0, 0.0, 0.0) @ invert(T[2]) @ T[17])
    # sigmas go along the target's axes, the residual of GTSAM along the source's: half a turn changes no variance
    judge.push_back(gtsam.BetweenFactorPose3(2, 17, measured, noise(np.diag(SIGMAS**2))))
    for k in range(N):
        values.insert(k, gtsam.Pose3(T[k]))
    found = gtsam.DoglegOptimizer(judge, values).optimize()
    poses = np.stack([found.atPose3(k).matrix() for k in range(N)])
    # the lever of the measured 5 m couples yaw and shift by millimetres
    assert after.T_world_anchor[:, :3, 3] == pytest.approx(poses[:, :3, 3], abs=0.05)


@pytest.mark.parametrize("fault", ["raises", "is not finite"])
def test_a_graph_without_a_solution_stays_as_the_back_end_left_it(monkeypatch, fault):
    def fail(_factors, T):
        if fault == "raises":
            raise RuntimeError("Indeterminant linear system")
        return np.full_like(T, np.nan)

    graph = graph_with({(2, 17): (3.0, 0.0)})
    before = graph.solve()
    monkeypatch.setattr(solving, "optimise", fail)
    after = hold(graph, before, [0])
    assert after.reasons == (INSOLUBLE,)
    assert "," not in INSOLUBLE
    assert np.array_equal(after.T_world_anchor, before.T_world_anchor)
    assert not after.is_inlier.any()


def test_a_closure_that_a_user_accepts_reaches_the_graph_and_stays():
    """Two places of different seafloors, one pass each: nothing but the user says that they are 4 m apart."""
    rng = np.random.default_rng(0)
    places = [cut_submap(rough_seafloor(rng), (150.0, 150.0, 0.0), rng, k) for k in range(3)]
    submaps = [
        replace(place, T_world_submap_dr=planar_pose(200.0 * (k % 2), 0.0, 0.0)) for k, place in enumerate(places)
    ]
    n_pings = places[-1].end_ping
    T_dr = np.stack([planar_pose(200.0 - abs(200.0 - k + 100.0), 0.0, 0.0) for k in range(n_pings)])
    reckoning = DeadReckoning(np.arange(float(n_pings)), T_dr, DeadReckoningConfig())
    measured = planar_pose(4.0, -3.0, 0.0)
    closure = LoopClosure(0, 2, measured, SIGMAS, 0, 0, 0.0, 0.5, True, "")
    doubted = solve_graph(submaps, [closure], reckoning, Config())
    assert not doubted.is_inlier.any()
    held = solve_graph(submaps, [closure], reckoning, Config(), Overrides({(0, 2): True}))
    assert held.is_inlier.all()
    assert relative(held, 0, 2) == pytest.approx([4.0, -3.0], abs=0.1)  # its sigma
