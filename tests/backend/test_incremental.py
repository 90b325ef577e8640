import gtsam
import numpy as np
import pytest

from backend.beliefs import Offer
from backend.consistency import ConsistencyConfig
from backend.incremental import IncrementalGraph, IncrementalSolver
from backend.optimiser import optimise
from backend.pose_graph import PoseGraphConfig

INCREMENTAL = PoseGraphConfig(method="incremental")


def at(x):
    T = np.eye(4)
    T[0, 3] = x
    return T


def between(first, second, x, sigma=0.1):
    return gtsam.BetweenFactorPose3(first, second, gtsam.Pose3(at(x)), gtsam.noiseModel.Isotropic.Sigma(6, sigma))


def test_one_anchor_at_a_time_ends_where_least_squares_does():
    prior = gtsam.PriorFactorPose3(0, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, 0.01))
    factors = [[prior], [between(0, 1, 1.0)], [between(1, 2, 1.0)], [between(2, 3, 1.0), between(0, 3, 3.4)]]
    solver = IncrementalSolver()
    for k, new in enumerate(factors):
        solver.update(new, at(float(k))[None])
    assert solver.n_anchors == 4
    judge = optimise([factor for new in factors for factor in new], solver.poses())
    np.testing.assert_allclose(solver.poses(), judge, atol=1e-6)
    np.testing.assert_allclose(solver.pose(3), judge[3], atol=1e-6)


def test_anchors_that_have_not_come_are_refused():
    with pytest.raises(ValueError, match=r"anchors so far are numbered 0\.\.-1, got 0"):
        IncrementalSolver().pose(0)


@pytest.mark.parametrize("drift_factor", [1.0, 3.0])
def test_incremental_is_as_good_as_batch(make_survey, drift_factor):
    survey, rng = make_survey(1, drift_factor), np.random.default_rng(1)
    closures = survey.true_closures(rng) + survey.independent_false(8, rng)
    batch, incremental = (survey.graph(closures, **kwargs).solve() for kwargs in ({}, {"config": INCREMENTAL}))
    assert survey.error(incremental.T_world_anchor) < 1.05 * survey.error(batch.T_world_anchor)


def test_where_no_closure_is_believed_dead_reckoning_comes_back(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    alone = survey.graph([survey.closure(4, 57, rng)], config=INCREMENTAL)
    assert alone.solve().T_world_anchor.tobytes() == survey.dr_anchors.tobytes()


def test_solving_twice_gives_the_same_bytes(make_survey):
    survey, rng = make_survey(2, every=40), np.random.default_rng(2)
    graph = survey.graph([survey.closure(*pair, rng) for pair in survey.revisits(25.0, 4)], config=INCREMENTAL)
    assert graph.solve().T_world_anchor.tobytes() == graph.solve().T_world_anchor.tobytes()


def test_turns_are_followed_though_shifts_of_metres_are_not_linearised_again():
    """A loop of thirty anchors that bends by 0.5 rad in all and is closed at its end."""
    prior = gtsam.PriorFactorPose3(0, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, 1e-3))
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([1e-3, 1e-3, 0.05, 0.05, 0.05, 0.05]))
    bend = 2.0 * np.pi / 30.0
    steps = [gtsam.Pose3(gtsam.Rot3.Yaw(bend + 0.5 / 30.0), np.array([10.0, 0.0, 0.0]))] * 29
    factors = [prior, *(gtsam.BetweenFactorPose3(k, k + 1, step, noise) for k, step in enumerate(steps))]
    closing = gtsam.BetweenFactorPose3(29, 0, gtsam.Pose3(gtsam.Rot3.Yaw(bend), np.array([10.0, 0.0, 0.0])), noise)
    solver, T = IncrementalSolver(), gtsam.Pose3()
    solver.update(factors[:1], T.matrix()[None])
    for factor, step in zip(factors[1:], steps, strict=True):
        T = T.compose(step)
        solver.update([factor], T.matrix()[None])
    solver.update([closing], np.zeros((0, 4, 4)))
    for _ in range(20):  # anchors that come later give the turns their turn
        solver.update([], np.zeros((0, 4, 4)))
    judge = optimise([*factors, closing], solver.poses())
    np.testing.assert_allclose(solver.poses(), judge, atol=0.02)  # 0.02 rad squared over 2, times 100 m


def test_a_closure_is_judged_by_what_has_come_so_far(make_survey):
    survey, rng = make_survey(1), np.random.default_rng(1)
    problem = survey.graph(survey.true_closures(rng)).problem()
    so_far = np.flatnonzero([max(c.target, c.source) < 60 for c in problem.closures])
    assert so_far.size
    early, late = problem.compared(survey.dr_anchors[:60], so_far), problem.compared(survey.dr_anchors, so_far)
    assert early.drift.shape == (60, 3, 3)
    np.testing.assert_allclose(early.yaw, late.yaw, atol=1e-12)
    # another middle of the world: the same places but for what a tilt of 5 mrad moves there
    np.testing.assert_allclose(early.reach, late.reach, rtol=1e-4)


def test_a_track_that_is_not_over_does_not_settle(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    problem = survey.graph(survey.true_closures(rng)).problem()
    graph = IncrementalGraph(Offer(problem, np.arange(len(problem.closures)), ConsistencyConfig(), rng))
    graph.advance(np.zeros(0, dtype=np.int64))
    with pytest.raises(ValueError, match=r"only 1 of \d+ anchors have come; the whole track is wanted"):
        graph.settle()


@pytest.mark.parametrize("seed", range(3))
def test_at_the_end_the_same_closures_are_believed_as_if_all_had_come_at_once(make_survey, seed):
    survey, rng = make_survey(seed, 3.0), np.random.default_rng(seed)
    closures = survey.true_closures(rng) + survey.repeated_false(12, 4, rng)
    batch, incremental = (survey.graph(closures, **kwargs).solve() for kwargs in ({}, {"config": INCREMENTAL}))
    assert incremental.reasons == batch.reasons
    # both end where a ten-thousandth is left to gain: sqrt(2e-4) standard deviations from the minimum at most
    apart = np.abs(incremental.T_world_anchor[:, :2, 3] - batch.T_world_anchor[:, :2, 3])
    assert (apart <= 2.0 * np.sqrt(2e-4) * batch.sigmas[:, :2]).all()
