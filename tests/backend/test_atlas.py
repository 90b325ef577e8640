import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backend.atlas import Atlas
from backend.optimiser import marginal_covariances
from backend.pose_graph import PoseGraphConfig
from backend.poses import RelativePose, invert


def east(x):
    T = np.eye(4)
    T[0, 3] = x
    return T


def step(target, source, x, sigma):
    return RelativePose(target, source, east(x), np.diag([1e-12] * 3 + [sigma**2] * 3))


def test_variances_add_along_a_chain():
    T, covariance = Atlas(4, [step(k, k + 1, 10.0, 0.1) for k in range(3)]).project(0, 3)
    np.testing.assert_allclose(T, east(30.0))
    np.testing.assert_allclose(np.diag(covariance)[3:], 0.03, rtol=1e-6)


def test_the_surer_of_two_paths_is_taken():
    long = [step(k, k + 1, 10.0, 0.1) for k in range(3)]
    for sigma, expected in ((0.1, 0.01), (1.0, 0.03)):
        _, covariance = Atlas(4, [*long, step(0, 3, 30.0, sigma)]).project(0, 3)
        np.testing.assert_allclose(covariance[3, 3], expected, rtol=1e-6)


def test_from_there_to_here_is_the_inverse(make_survey):
    survey = make_survey(0)
    atlas = Atlas(len(survey.dr_anchors), survey.odometry())
    there, back = atlas.project(3, 30)[0], atlas.project(30, 3)[0]
    np.testing.assert_allclose(there, invert(back), atol=1e-9)
    np.testing.assert_allclose(there, invert(survey.dr_anchors[3]) @ survey.dr_anchors[30], atol=1e-9)


def test_along_a_chain_the_projection_is_gtsams_marginal(make_survey):
    survey = make_survey(2, every=90)
    odometry = survey.odometry()
    graph = survey.graph([], first_pose=(1e-9,) * 6)
    factors = graph.problem().known_factors(1.0)[: 1 + len(odometry)]  # without depth and tilt
    judge = marginal_covariances(factors, survey.dr_anchors)
    atlas = Atlas(len(survey.dr_anchors), odometry)
    for source in (1, 5, 9):
        _, covariance = atlas.project(0, source)
        scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
        np.testing.assert_allclose(covariance / scale, judge[source] / scale, atol=1e-6)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)).filter(lambda pair: pair[0] != pair[1]), max_size=6))
def test_another_edge_never_adds_doubt(pairs):
    atlas, doubt = Atlas(10, [step(k, k + 1, 1.0, 0.2) for k in range(9)]), np.inf
    for a, b in pairs:
        atlas.add(step(a, b, float(b - a), 0.3))
        now = np.trace(atlas.project(0, 9)[1][3:, 3:])
        assert now <= doubt + 1e-12
        doubt = now


def test_a_closure_is_as_far_from_the_projection_as_its_covariance_says():
    atlas = Atlas(3, [step(0, 1, 10.0, 0.3), step(1, 2, 10.0, 0.4)])
    closure = RelativePose(0, 2, east(21.0), np.diag([1e-12] * 3 + [0.25**2] * 3))
    assert atlas.squared_distance(closure) == pytest.approx(1.0 / (0.09 + 0.16 + 0.0625))


def test_frames_without_a_path_are_named():
    with pytest.raises(ValueError, match="frames 0 and 2 are not joined by any path"):
        Atlas(3, [step(0, 1, 1.0, 0.1)]).project(0, 2)


def test_its_gates_let_true_closures_in_and_false_ones_not(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    true, false = survey.true_closures(rng), survey.independent_false(10, rng)
    solution = survey.graph([*true, *false], config=PoseGraphConfig(method="atlas")).solve()
    assert solution.is_inlier[: len(true)].sum() >= len(true) - 1
    assert solution.is_inlier[len(true) :].sum() <= 1  # by chance a false one lies where it should


def test_where_no_closure_is_inside_its_gate_dead_reckoning_comes_back(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    far = [survey.false_closure(4, 57, np.array([300.0, 300.0, 0.0]), rng)]
    solution = survey.graph(far, config=PoseGraphConfig(method="atlas")).solve()
    assert solution.T_world_anchor.tobytes() == survey.dr_anchors.tobytes()
