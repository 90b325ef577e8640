from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frontend import matching as module
from frontend.features import Features, describe
from frontend.frames import invert, planar_parameters, planar_pose, transform
from frontend.matching import MatchingConfig, agreeing, find_consensus, match, mutual_matches
from frontend.priors import Prior
from tests.frontend.seafloor_scenes import cut_submap, rough_seafloor


def features_at(keypoints, descriptors=None):
    keypoints = np.asarray(keypoints, dtype=np.float64)
    descriptors = np.zeros((len(keypoints), 33)) if descriptors is None else descriptors
    return Features(keypoints, descriptors, np.tile([0.0, 0.0, 1.0], (len(keypoints), 1)))


def scattered(rng, n, T_target_source, n_wrong, offset=0.0, noise=0.1):
    """Source and target keypoints in one-to-one matches, of which the last ``n_wrong`` are wrong."""
    source = np.column_stack([rng.uniform(-40, 40, (n, 2)), rng.normal(0, 0.3, n)])
    target = transform(T_target_source, source) + rng.normal(0, noise, (n, 3)) + [0, 0, offset]
    target[n - n_wrong :] = np.column_stack([rng.uniform(-40, 40, (n_wrong, 2)), rng.normal(0, 0.3, n_wrong)])
    matches = np.column_stack([np.arange(n), np.arange(n)])
    return features_at(target), features_at(source), matches


def error_of(T, T_true):
    x, y, yaw = planar_parameters(invert(T_true) @ T)
    return np.hypot(x, y), abs(yaw)


def prior_at(T, sigma=8.0, sigma_yaw=0.035):
    return Prior(T, np.diag([1e-4, 1e-4, sigma_yaw**2, sigma**2, sigma**2, 1.0]))


def test_mutual_matches_are_each_others_nearest():
    a = np.zeros((3, 33))
    b = np.zeros((2, 33))
    a[:, 0], b[:, 0] = [0.0, 10.0, 11.0], [10.8, 0.4]
    matches = mutual_matches(features_at(np.zeros((3, 3)), a), features_at(np.zeros((2, 3)), b))
    assert matches.tolist() == [[0, 1], [2, 0]]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 30), st.integers(1, 30))
def test_swapping_the_submaps_swaps_the_matches(seed, n, m):
    rng = np.random.default_rng(seed)
    a = features_at(np.zeros((n, 3)), rng.normal(size=(n, 33)))
    b = features_at(np.zeros((m, 3)), rng.normal(size=(m, 33)))
    assert sorted(map(tuple, mutual_matches(a, b)[:, ::-1])) == sorted(map(tuple, mutual_matches(b, a)))


def test_without_features_nothing_matches():
    none, some = features_at(np.empty((0, 3))), features_at(np.zeros((4, 3)))
    assert mutual_matches(none, some).shape == (0, 2)
    assert match(some, none) == []


@pytest.mark.parametrize("yaw", [0.0, 0.8, np.pi / 2, np.pi, -2.5])
def test_ten_right_matches_among_a_hundred_wrong_ones_are_found_at_every_heading(yaw):
    T_true = planar_pose(12.0, -7.0, yaw, z=0.3)
    target, source, matches = scattered(np.random.default_rng(0), 110, T_true, 100)
    best = find_consensus(target, source, matches)[0]
    shift, turn = error_of(best.T_target_source, T_true)
    # right matches scatter by 0.1 m; a few wrong ones within 2 m of agreeing pull the mean by decimetres
    assert shift < 0.6
    assert turn < 0.03
    assert best.n_inliers >= 10


def test_wrong_matches_alone_do_not_agree_inside_a_gate():
    target, source, matches = scattered(np.random.default_rng(1), 100, np.eye(4), 100)
    found = find_consensus(target, source, matches, prior_at(planar_pose(5.0, 5.0, 0.3), sigma=3.0))
    assert all(candidate.n_inliers < 8 for candidate in found)


def test_candidates_lie_inside_the_gate_of_the_prior():
    T_true, T_other = planar_pose(0.0, 0.0, 0.0), planar_pose(30.0, 0.0, 1.0)
    rng = np.random.default_rng(2)
    a, b, _ = scattered(rng, 20, T_true, 0)
    c, d, _ = scattered(rng, 30, T_other, 0)
    target = features_at(np.concatenate([a.keypoints, c.keypoints]))
    source = features_at(np.concatenate([b.keypoints, d.keypoints]))
    matches = np.column_stack([np.arange(50), np.arange(50)])
    assert error_of(find_consensus(target, source, matches)[0].T_target_source, T_other)[0] < 0.5
    gated = find_consensus(target, source, matches, prior_at(planar_pose(3.0, 1.0, 0.02)))
    assert error_of(gated[0].T_target_source, T_true)[0] < 0.5


def test_both_of_two_places_come_back_when_matches_support_both():
    T_first, T_second = planar_pose(0.0, 0.0, 0.0), planar_pose(15.0, 0.0, 0.0)
    rng = np.random.default_rng(3)
    a, b, _ = scattered(rng, 20, T_first, 0)
    c, d, _ = scattered(rng, 12, T_second, 0)
    target = features_at(np.concatenate([a.keypoints, c.keypoints]))
    source = features_at(np.concatenate([b.keypoints, d.keypoints]))
    found = find_consensus(target, source, np.column_stack([np.arange(32), np.arange(32)]))
    assert error_of(found[0].T_target_source, T_first)[0] < 0.5
    assert any(error_of(candidate.T_target_source, T_second)[0] < 0.5 for candidate in found[1:])
    assert all(a.n_inliers >= b.n_inliers for a, b in pairwise(found))


def test_an_offset_of_all_heights_is_no_disagreement():
    T_true = planar_pose(4.0, 5.0, 0.2)
    target, source, matches = scattered(np.random.default_rng(4), 20, T_true, 0, offset=3.0)
    best = find_consensus(target, source, matches)[0]
    assert best.n_inliers == 20
    assert best.T_target_source[2, 3] == pytest.approx(3.0, abs=0.1)


def test_a_match_at_the_wrong_height_does_not_agree():
    points = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [10.0, 10.0, 2.5]])
    agrees = agreeing(points * [1, 1, 0], points, np.eye(4), MatchingConfig())
    assert agrees.tolist() == [True, True, True, False]


def test_a_match_that_lands_beside_its_partner_does_not_agree():
    points = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [20.0, 0.0, 0.0]])
    moved = points + np.array([[0, 1.9, 0], [0, 2.1, 0], [0, 0, 0]])
    assert agreeing(moved, points, np.eye(4), MatchingConfig()).tolist() == [True, False, True]


def test_too_few_matches_give_no_candidate():
    target, source, matches = scattered(np.random.default_rng(5), 3, np.eye(4), 0)
    assert find_consensus(target, source, matches) == []
    assert find_consensus(target, source, matches[:0]) == []


def test_matches_too_close_together_leave_the_yaw_open_and_give_no_candidate():
    keypoints = np.random.default_rng(6).uniform(0, 3, (10, 3))
    matches = np.column_stack([np.arange(10), np.arange(10)])
    assert find_consensus(features_at(keypoints), features_at(keypoints), matches) == []


def test_the_kernel_counts_as_its_own_python_function_and_as_numpy():
    rng = np.random.default_rng(7)
    p, q = rng.uniform(-5, 5, (40, 3)), rng.uniform(-5, 5, (40, 3))
    hypotheses = np.column_stack([rng.uniform(-2, 2, (15, 3)), rng.uniform(-3, 3, 15)])
    compiled, plain = np.zeros(15, dtype=np.int64), np.zeros(15, dtype=np.int64)
    tolerances = np.array([2.0, 1.0])
    module._count(hypotheses, p, q, tolerances, compiled)
    getattr(module._count, "py_func", module._count)(hypotheses, p, q, tolerances, plain)
    expected = []
    for x, y, z, yaw in hypotheses:
        error = transform(planar_pose(x, y, yaw, z), q) - p
        expected.append(int(((np.hypot(error[:, 0], error[:, 1]) <= 2.0) & (np.abs(error[:, 2]) <= 1.0)).sum()))
    assert compiled.tolist() == plain.tolist() == expected


@pytest.mark.parametrize("turn", [0.0, 0.6, np.pi / 2, np.pi])
def test_two_passes_over_one_place_are_matched_from_their_shape_alone(turn):
    rng = np.random.default_rng(int(10 * turn))
    seafloor = rough_seafloor(rng)
    T_true = planar_pose(6.0, -4.0, turn)
    a = cut_submap(seafloor, (150.0, 150.0, 0.2), rng, error=0.02)
    b = cut_submap(seafloor, planar_parameters(planar_pose(150.0, 150.0, 0.2) @ T_true), rng, error=0.02)
    best = match(describe(a), describe(b))[0]
    shift, yaw = error_of(best.T_target_source, T_true)
    assert shift < 2.0  # the tolerance of an agreeing match
    assert yaw < 0.1
    assert best.n_inliers >= 8


def test_the_same_features_give_the_same_candidates():
    target, source, matches = scattered(np.random.default_rng(8), 60, planar_pose(1.0, 2.0, 0.5), 40)
    first, second = (find_consensus(target, source, matches) for _ in range(2))
    assert [c.n_inliers for c in first] == [c.n_inliers for c in second]
    assert all(np.array_equal(a.T_target_source, b.T_target_source) for a, b in zip(first, second, strict=True))


def test_the_nearest_are_those_of_the_definition_and_the_kernel_its_own_python_function():
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(13, 33)).astype(np.float32), rng.normal(size=(9, 33)).astype(np.float32)
    compiled, plain = ([np.zeros(13, dtype=np.int64), np.zeros(9, dtype=np.int64)] for _ in range(2))
    module._nearest(a, np.ascontiguousarray(b.T), *compiled)
    getattr(module._nearest, "py_func", module._nearest)(a, np.ascontiguousarray(b.T), *plain)
    distance = ((a[:, None].astype(float) - b[None]) ** 2).sum(axis=2)
    assert compiled[0].tolist() == plain[0].tolist() == distance.argmin(axis=1).tolist()
    assert compiled[1].tolist() == plain[1].tolist() == distance.argmin(axis=0).tolist()


def test_pairs_of_matches_that_fit_are_counted_and_filled_in_alike():
    rng = np.random.default_rng(3)
    p = np.column_stack([rng.uniform(-30, 30, (12, 2)), rng.normal(0, 0.3, 12)])
    q = transform(planar_pose(4.0, -7.0, 0.6), p) + rng.normal(0, 0.3, p.shape)
    limits, out = np.array([8.0, 2.0, 1.0]), np.empty((66, 4))
    n = module._fit(p, q, limits, np.empty((0, 4)))
    plain = np.empty((n, 4))
    assert module._fit(p, q, limits, out) == n
    assert getattr(module._fit, "py_func", module._fit)(p, q, limits, plain) == n
    assert out[:n] == pytest.approx(plain, abs=1e-12)
    assert np.median(np.abs(np.angle(np.exp(1j * (out[:n, 3] + 0.6))))) < 0.05  # 0.3 m over 8 m and more
