import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from backend.consistency import ConsistencyConfig
from backend.pose_graph import DisconnectedGraphError, PoseGraph, PoseGraphConfig
from backend.poses import RelativePose, invert

SINGLE = ConsistencyConfig(min_votes=1)  # so few anchors that no second closure can be independent
FIRST_POSE = np.array([1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])
ONE = np.ones(6)


def pose(x=0.0, y=0.0, z=0.0, yaw=0.0, pitch=0.0, roll=0.0):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix(), [x, y, z]
    return T


def chain(T, sigmas, consistency=SINGLE, unary=None):
    """Anchors with odometry of the same sigmas from each to the next."""
    graph = PoseGraph(T, consistency=consistency)
    graph.add_first_pose(FIRST_POSE)
    for k in range(len(T) - 1):
        graph.add_odometry(k, k + 1, invert(T[k]) @ T[k + 1], np.diag(np.square(sigmas)))
    if unary is not None:
        for k in range(len(T)):
            graph.add_depth_and_tilt(k, *unary)
    return graph


def test_odometry_and_a_closure_of_equal_sigmas_meet_half_way():
    sigmas = np.array([1e-6, 1e-6, 1e-6, 0.1, 0.1, 0.1])
    graph = chain(np.stack([pose(), pose(y=1.0)]), 10.0 * sigmas)
    graph.add_closure(0, 1, pose(y=0.0), 10.0 * sigmas)
    solution = graph.solve()
    assert solution.is_inlier.tolist() == [True]
    # the first pose is held to 1 mm, so it gives way by 0.001**2
    np.testing.assert_allclose(solution.T_world_anchor[1][:3, 3], [0.0, 0.5, 0.0], atol=1e-5)
    assert solution.error_before == pytest.approx(0.5)
    assert solution.error_after == pytest.approx(0.25, rel=1e-4)


def test_without_closures_the_poses_given_come_back_bit_for_bit(make_survey):
    survey = make_survey(0)
    solution = survey.graph([]).solve()
    assert solution.T_world_anchor.tobytes() == survey.dr_anchors.tobytes()
    assert solution.error_before == solution.error_after
    assert solution.error_before == pytest.approx(0.0, abs=1e-12)
    assert solution.odometry_scale == 1.0
    assert solution.closure_weights.shape == solution.is_inlier.shape == (0,)


def test_where_no_closure_is_believed_the_poses_given_come_back_bit_for_bit(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    solution = survey.graph([survey.false_closure(4, 57, np.array([15.0, 15.0, 0.0]), rng)]).solve()
    assert solution.T_world_anchor.tobytes() == survey.dr_anchors.tobytes()
    assert solution.reasons == ("no independent closure agrees with it",)
    assert solution.closure_weights.tolist() == [0.0]


def test_a_square_that_does_not_close_is_closed_and_its_error_shared():
    # four sides of 10 m and three quarter turns; the last side comes back 1 m short of the start
    corners = [pose(), pose(10.0, 0.0, yaw=np.pi / 2), pose(10.0, 10.0, yaw=np.pi), pose(0.0, 10.0, yaw=-np.pi / 2)]
    T = np.stack([*corners, pose(0.0, 1.0, yaw=-np.pi / 2)])
    graph = chain(T, [1e-5, 1e-5, 1e-5, 0.5, 0.5, 0.5])
    graph.add_closure(0, 4, pose(0.0, 0.0, yaw=-np.pi / 2), [1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-4])
    y = graph.solve().T_world_anchor[:, 1, 3]
    np.testing.assert_allclose(y - T[:, 1, 3], [0.0, -0.25, -0.5, -0.75, -1.0], atol=1e-3)


def test_sigmas_are_taken_along_the_targets_axes_and_rotation_first():
    # the target heads north, the source west: forward of the target is north, forward of the source west
    T = np.stack([pose(yaw=np.pi / 2), pose(yaw=np.pi)])
    graph = chain(T, np.array([0.01, 0.01, 0.01, 1.0, 1.0, 1.0]))
    measured = invert(T[0]) @ pose(x=-0.4, y=0.8, yaw=np.pi)
    graph.add_closure(0, 1, measured, [10.0, 10.0, 10.0, 1e-3, 1e3, 1e3])  # only forward of the target is known
    np.testing.assert_allclose(graph.solve().T_world_anchor[1][:3, 3], [0.0, 0.8, 0.0], atol=1e-3)


def test_a_tight_yaw_sigma_corrects_yaw_and_a_loose_one_does_not():
    for yaw_sigma, expected in ((1e-4, 0.1), (1e2, 0.0)):
        graph = chain(np.stack([pose(), pose(x=5.0)]), np.array([0.1, 0.1, 0.1, 0.01, 0.01, 0.01]))
        graph.add_closure(0, 1, pose(x=5.0, yaw=0.1), [1e2, 1e2, yaw_sigma, 1e2, 1e2, 1e2])
        T = graph.solve().T_world_anchor[1]
        assert np.arctan2(T[1, 0], T[0, 0]) == pytest.approx(expected, abs=1e-3)


def test_target_and_source_are_not_the_same_thing():
    T = np.stack([pose(), pose(x=3.0), pose(x=6.0)])
    tight = np.array([1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-2])
    seen = pose(x=6.5, y=0.5, yaw=0.05)
    for target, source, measured in ((0, 2, seen), (2, 0, invert(seen))):
        graph = chain(T, [0.1, 0.1, 0.1, 0.5, 0.5, 0.5])
        graph.add_closure(target, source, measured, tight)
        np.testing.assert_allclose(graph.solve().T_world_anchor[2], seen, atol=5e-3)


def test_depth_and_tilt_hold_what_they_measure_and_nothing_else():
    T = np.stack([pose(z=-50.0), pose(x=10.0, z=-50.0, pitch=0.1, roll=-0.2)])
    seen = pose(x=11.0, y=1.0, z=-49.8, yaw=0.2, pitch=0.12, roll=-0.18)
    graph = chain(T, [0.3, 0.3, 0.3, 1.0, 1.0, 1.0], unary=(1e-4, 1e-5))
    graph.add_closure(0, 1, invert(T[0]) @ seen, [0.2, 0.2, 1e-2, 1e-2, 1e-2, 1.0])
    found = graph.solve().T_world_anchor[1]
    yaw, pitch, roll = Rotation.from_matrix(found[:3, :3]).as_euler("ZYX")
    np.testing.assert_allclose([found[2, 3], pitch, roll], [-50.0, 0.1, -0.2], atol=1e-3)
    np.testing.assert_allclose([found[0, 3], found[1, 3], yaw], [11.0, 1.0, 0.2], atol=0.03)


def test_marginal_sigmas_are_those_of_dense_linear_algebra(make_survey):
    survey = make_survey(5, every=90)
    T, covariance = survey.dr_anchors, np.diag([0.01, 0.02, 0.03, 0.4, 0.5, 0.6]) ** 2
    # closures that agree with dead reckoning: where residuals vanish, every way to write them has one derivative
    closures = [RelativePose(t, s, invert(T[t]) @ T[s], covariance) for t, s in survey.revisits(40.0)[:3]]
    solution = survey.graph(closures, consistency=SINGLE).solve()
    assert solution.is_inlier.all()
    judge = np.linalg.inv(dense_information(T, [*survey.odometry(), *closures]))
    for k in range(len(T)):
        block = judge[6 * k : 6 * k + 6, 6 * k : 6 * k + 6]
        scale = np.sqrt(np.outer(np.diag(block), np.diag(block)))
        # differences of 1e-6 are good to 1e-9; the graph's information has a condition number of some 1e4
        np.testing.assert_allclose(solution.covariances[k] / scale, block / scale, rtol=0, atol=1e-4)


def dense_information(T_dr, relative_poses, step=1e-6):
    """The judge: residuals written out in numpy, differentiated numerically along each body's axes."""
    columns = []
    for k in range(len(T_dr)):
        for xi in np.eye(6) * step:
            ahead, behind = T_dr.copy(), T_dr.copy()
            ahead[k], behind[k] = T_dr[k] @ pose_of(xi), T_dr[k] @ pose_of(-xi)
            ends = (dense_residuals(T_dr, T, relative_poses) for T in (ahead, behind))
            columns.append(np.subtract(*ends) / (2.0 * step))
    J = np.stack(columns, axis=1)
    return J.T @ J


def dense_residuals(T_dr, T, relative_poses):
    """Normalised residuals of the first pose, of relative poses, and of depth and tilt as surveys' graphs have them."""
    rows = [in_target_axes(T_dr[0], T[0]) / [0.005, 0.005, 0.02, 0.01, 0.01, 0.1]]
    for relative in relative_poses:
        found = invert(T[relative.target]) @ T[relative.source]
        error = in_target_axes(relative.T_target_source, found)
        rows.append(np.linalg.solve(np.linalg.cholesky(relative.covariance), error))
    for pose_dr, pose_now in zip(T_dr, T, strict=True):
        across_the_vertical = np.linalg.svd(pose_dr[2:3, :3])[2][1:]
        rows.append(across_the_vertical @ (pose_now[2, :3] - pose_dr[2, :3]) / 0.005)
        rows.append([(pose_now[2, 3] - pose_dr[2, 3]) / 0.1])
    return np.concatenate(rows)


def in_target_axes(measured, found):
    """Error of a pose: turn, then shift, along the target's axes."""
    turn = Rotation.from_matrix(found[:3, :3] @ measured[:3, :3].T).as_rotvec()
    return np.concatenate([turn, found[:3, 3] - measured[:3, 3]])


def pose_of(xi):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(xi[:3]).as_matrix(), xi[3:]
    return T


def test_world_sigmas_are_x_y_z_and_yaw_whatever_the_heading():
    for yaw in (0.0, np.pi / 2, 2.0):
        graph = PoseGraph(pose(yaw=yaw)[None])
        graph.add_first_pose([0.01, 0.02, 0.03, 4.0, 5.0, 6.0])
        np.testing.assert_allclose(graph.solve().sigmas, [[4.0, 5.0, 6.0, 0.03]], rtol=1e-9)


@pytest.mark.parametrize("drift_factor", [1.0, 3.0])
def test_true_closures_are_kept_even_when_dead_reckoning_is_three_times_worse_than_its_model(make_survey, drift_factor):
    for seed in range(3):
        survey, rng = make_survey(seed, drift_factor), np.random.default_rng(seed)
        closures = survey.true_closures(rng)
        solution = survey.graph(closures).solve()
        assert solution.is_inlier.sum() >= len(closures) - 1
        assert survey.error(solution.T_world_anchor) < 0.5 * survey.error(survey.dr_anchors)


@pytest.mark.parametrize("drift_factor", [1.0, 3.0])
@pytest.mark.parametrize("kind", ["independent", "repeated"])
def test_two_false_closures_for_every_true_one_do_not_spoil_the_track(make_survey, drift_factor, kind):
    survey, rng = make_survey(1, drift_factor), np.random.default_rng(1)
    true = survey.true_closures(rng)
    n = 2 * len(true)
    false = survey.independent_false(n, rng) if kind == "independent" else survey.repeated_false(n, len(true), rng)
    alone, among = (survey.graph(closures).solve() for closures in (true, [*true, *false]))
    assert survey.error(among.T_world_anchor) < 1.1 * survey.error(alone.T_world_anchor)


def test_the_order_of_the_closures_does_not_matter(make_survey):
    survey, rng = make_survey(2), np.random.default_rng(2)
    closures = survey.true_closures(rng) + survey.independent_false(10, rng)
    order = rng.permutation(len(closures))
    straight, shuffled = (survey.graph(some).solve() for some in (closures, [closures[k] for k in order]))
    assert straight.is_inlier[order].tolist() == shuffled.is_inlier.tolist()
    np.testing.assert_allclose(straight.T_world_anchor, shuffled.T_world_anchor, rtol=0, atol=1e-4)


def test_solving_twice_gives_the_same_bytes(make_survey):
    survey, rng = make_survey(3), np.random.default_rng(3)
    graph = survey.graph(survey.true_closures(rng) + survey.independent_false(10, rng))
    first, second = graph.solve(), graph.solve()
    assert first.T_world_anchor.tobytes() == second.T_world_anchor.tobytes()
    assert first.covariances.tobytes() == second.covariances.tobytes()
    assert first.g2o == second.g2o


def test_a_closure_withdrawn_by_the_caller_keeps_the_callers_reason(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    graph = survey.graph(survey.true_closures(rng))
    solution = graph.solve({2: "the maps disagree"})
    assert solution.reasons[2] == "the maps disagree"
    assert not solution.is_inlier[2]
    assert solution.is_inlier.sum() == len(solution.reasons) - 1
    assert all(reason == "" for k, reason in enumerate(solution.reasons) if k != 2)


def test_reasons_hold_no_comma_and_are_empty_exactly_where_a_closure_holds(make_survey):
    survey, rng = make_survey(1), np.random.default_rng(1)
    solution = survey.graph(survey.true_closures(rng) + survey.independent_false(15, rng)).solve()
    assert [reason == "" for reason in solution.reasons] == solution.is_inlier.tolist()
    assert not any("," in reason for reason in solution.reasons)


@settings(max_examples=10, deadline=None)
@given(st.floats(-np.pi, np.pi), st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)))
def test_turning_the_world_turns_the_solution(make_survey, yaw, shift):
    survey, rng = make_survey(4, every=60), np.random.default_rng(4)
    closures, G = [survey.closure(*pair, rng) for pair in survey.revisits(30.0, 3)], pose(*shift, yaw=yaw)
    here = survey.graph(closures).solve()
    moved = PoseGraph(G @ survey.dr_anchors)
    moved.add_first_pose([0.005, 0.005, 0.02, 0.01, 0.01, 0.1])
    for relative in survey.odometry():
        moved.add_odometry(relative.target, relative.source, relative.T_target_source, relative.covariance)
    for k in range(len(survey.dr_anchors)):
        moved.add_depth_and_tilt(k, 0.1, 0.005)
    for closure in closures:
        moved.add_closure(closure.target, closure.source, closure.T_target_source, np.sqrt(np.diag(closure.covariance)))
    there = moved.solve()
    assert there.is_inlier.tolist() == here.is_inlier.tolist()
    # the optimiser stops at a relative change of 1e-9 of the error
    np.testing.assert_allclose(there.T_world_anchor, G @ here.T_world_anchor, rtol=0, atol=1e-3)


def test_a_fix_draws_its_anchor_by_the_variances_and_leaves_its_height():
    sigmas = np.array([1e-6, 1e-6, 1e-6, 0.3, 0.3, 0.3])
    graph = chain(np.stack([pose(), pose(x=5.0, z=-2.0)]), sigmas)
    graph.add_fix(1, 6.0, -0.5, 0.3)
    solution = graph.solve()
    # the first pose is held to 1 mm and turns by 1 mrad, which hardly count beside 0.3 m
    np.testing.assert_allclose(solution.T_world_anchor[1][:3, 3], [5.5, -0.25, -2.0], atol=1e-3)
    np.testing.assert_allclose(solution.sigmas[1, :2], 0.3 / np.sqrt(2.0), rtol=1e-3)


def test_closures_and_fixes_are_solved_together(make_survey):
    survey, rng = make_survey(1), np.random.default_rng(1)
    closures = survey.true_closures(rng)
    graph = survey.graph(closures, first_pose=(0.005, 0.005, 0.1, 1.0, 1.0, 0.1))
    ends = [0, len(survey.dr_anchors) - 1]
    for anchor in ends:
        graph.add_fix(anchor, *survey.true_anchors[anchor][:2, 3], 0.1)
    solution = graph.solve()
    assert solution.is_inlier.all()
    errors = solution.T_world_anchor[ends, :2, 3] - survey.true_anchors[ends, :2, 3]
    assert np.abs(errors).max() < 0.4  # four sigmas of the fixes, which are exact here


def test_one_anchor_alone_is_a_graph():
    graph = PoseGraph(pose(1.0, 2.0, 3.0)[None])
    graph.add_first_pose(FIRST_POSE)
    np.testing.assert_allclose(graph.solve().sigmas, 1e-3, rtol=1e-9)


def test_what_was_given_is_not_changed(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    before = survey.dr_anchors.copy()
    graph = survey.graph(survey.true_closures(rng))
    graph.solve()
    assert np.array_equal(graph.T_world_anchor_dr, before)


def test_a_missing_link_is_found_before_the_optimiser_and_named():
    graph = PoseGraph(np.stack([pose(), pose(1.0), pose(2.0)]))
    graph.add_first_pose(FIRST_POSE)
    graph.add_odometry(0, 1, pose(1.0), np.eye(6))
    with pytest.raises(DisconnectedGraphError, match="between all consecutive anchors: 1 and 2 are not joined"):
        graph.solve()


def test_a_graph_without_a_first_pose_hangs_in_the_air():
    with pytest.raises(DisconnectedGraphError, match="hangs in the air: add_first_pose is wanted before solve"):
        PoseGraph(pose()[None]).solve()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda g: g.add_odometry(0, 2, pose(), np.eye(6)), "joins an anchor once and to the next one, got 0 and 2"),
        (lambda g: g.add_odometry(0, 1, pose(), np.eye(6)), "joins an anchor once and to the next one, got 0 and 1"),
        (lambda g: g.add_odometry(1, 2, pose(), np.zeros((6, 6))), "covariance of 1 and 2 must be a positive definite"),
        (lambda g: g.add_odometry(1, 2, pose(), np.eye(3)), "covariance of 1 and 2 must be a positive definite 6 x 6"),
        (lambda g: g.add_closure(0, 3, pose(), ONE), r"anchors are numbered 0\.\.2, got 3"),
        (lambda g: g.add_closure(-1, 2, pose(), ONE), r"anchors are numbered 0\.\.2, got -1"),
        (lambda g: g.add_closure(1, 1, pose(), ONE), "joins two different anchors, got 1 twice"),
        (lambda g: g.add_closure(0, 2, np.full((4, 4), np.nan), ONE), "T_target_source must be finite"),
        (lambda g: g.add_closure(0, 2, pose(), [1, 1, 1]), "sigmas must be six positive numbers"),
        (lambda g: g.add_closure(0, 2, pose(), [1, 1, 1, 1, 0, 1]), "sigmas must be six positive numbers"),
        (lambda g: g.add_first_pose([1, 1, 1, 1, np.nan, 1]), "sigmas must be six positive numbers"),
        (lambda g: g.add_depth_and_tilt(0, 0.0, 1.0), r"must be positive, got 0\.0 m and 1\.0 rad"),
        (lambda g: g.add_closure(0, 2, pose(), ONE, np.nan), "chance of a closure is a number that is not negative"),
        (lambda g: g.add_fix(3, 0.0, 0.0, 1.0), r"anchors are numbered 0\.\.2, got 3"),
        (lambda g: g.add_fix(0, np.nan, 0.0, 1.0), "a fix is a finite position with a positive sigma, got nan, 0.0"),
        (lambda g: g.add_fix(0, 0.0, 0.0, 0.0), "a fix is a finite position with a positive sigma, got 0.0, 0.0"),
        (lambda g: g.add_depth_and_tilt(7, 1.0, 1.0), r"anchors are numbered 0\.\.2, got 7"),
    ],
)
def test_measurements_that_make_no_sense_are_refused(call, message):
    graph = PoseGraph(np.stack([pose(), pose(1.0), pose(2.0)]))
    graph.add_odometry(0, 1, pose(1.0), np.eye(6))
    with pytest.raises(ValueError, match=message):
        call(graph)


def test_a_graph_without_anchors_is_refused():
    with pytest.raises(ValueError, match="at least one anchor, got none"):
        PoseGraph(np.zeros((0, 4, 4)))


def test_misspelt_settings_are_refused():
    with pytest.raises(ValidationError, match="inlier_probabilty"):
        PoseGraphConfig(inlier_probabilty=0.9)
