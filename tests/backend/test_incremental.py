import gtsam
import numpy as np
import pytest

from backend.incremental import IncrementalSolver
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
