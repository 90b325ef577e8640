import gtsam
import numpy as np
import pytest

from backend.descent import descend
from backend.factors import between_factors, graph_of, pose_values, poses_of


def damped(graph, start):
    """The judge: GTSAM's own Levenberg-Marquardt, to the last digit."""
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-14)
    params.setAbsoluteErrorTol(1e-14)
    return gtsam.LevenbergMarquardtOptimizer(graph, start, params).optimize()


@pytest.fixture
def surveyed(make_survey):
    """A graph with true closures and two false ones, and where dead reckoning starts it."""
    survey, rng = make_survey(3, 3.0), np.random.default_rng(3)
    closures = survey.true_closures(rng) + survey.independent_false(2, rng)
    problem = survey.graph(closures).problem()
    return graph_of([*problem.known_factors(1.0), *between_factors(closures)]), pose_values(survey.dr_anchors)


def test_the_minimum_is_that_of_levenberg_and_marquardt(surveyed):
    graph, start = surveyed
    reached, judge = descend(graph, start), damped(graph, start)
    assert graph.error(reached) == pytest.approx(graph.error(judge), abs=1e-4)  # its own bound on what is left
    np.testing.assert_allclose(poses_of(reached), poses_of(judge), atol=1e-2)  # a hundredth of a sigma of metres


def test_at_the_minimum_nothing_moves(surveyed):
    graph, start = surveyed
    there = damped(graph, start)
    np.testing.assert_allclose(poses_of(descend(graph, there)), poses_of(there), atol=1e-4)


def test_a_graph_too_flat_for_an_undamped_step_is_solved_all_the_same():
    noise = gtsam.noiseModel.Isotropic.Sigma(6, 0.1)
    graph = graph_of([gtsam.BetweenFactorPose3(0, 1, gtsam.Pose3(), noise)])  # nothing says where the two lie
    start = pose_values(np.stack([np.eye(4), np.eye(4)]))
    start.update(1, gtsam.Pose3(gtsam.Rot3(), np.array([1.0, 0.0, 0.0])))
    assert graph.error(descend(graph, start)) < 1e-6


def test_a_step_uphill_is_damped_instead():
    """Two anchors half a turn apart from what is measured, where the undamped step leads astray."""
    rng = np.random.default_rng(0)
    noise = gtsam.noiseModel.Isotropic.Sigma(6, 0.1)
    factors = [gtsam.PriorFactorPose3(0, gtsam.Pose3(), noise)]
    for k in range(6):
        factors.append(
            gtsam.BetweenFactorPose3(k, (k + 1) % 6, gtsam.Pose3(gtsam.Rot3.Yaw(np.pi / 3), [5, 0, 0]), noise)
        )
    start = gtsam.Values()
    for k in range(6):
        start.insert(k, gtsam.Pose3(gtsam.Rot3.Rodrigues(*rng.normal(0, 2.0, 3)), rng.normal(0, 10.0, 3)))
    graph = graph_of(factors)
    assert graph.error(descend(graph, start)) <= graph.error(damped(graph, start)) + 1e-4


def test_where_it_starts_is_not_changed(surveyed):
    graph, start = surveyed
    before = poses_of(start)
    descend(graph, start)
    assert np.array_equal(poses_of(start), before)
