import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from backend.evidence import log_evidence, log_gate, log_normal, surprises, without_losers
from backend.innovations import Innovations

GATE_VOLUME = 4.0 / 3.0 * np.pi * chi2.ppf(0.9999, 3) ** 1.5


def along_a_track(residuals, first, last, noise=0.01, step=1.0):
    """Innovations in x and y of a track whose yaw is known: variance of each step and of each closure [m**2]."""
    n, n_anchors = len(residuals), int(np.max(last)) + 1
    drift = np.arange(n_anchors)[:, None, None] * np.diag([1e-6, step, step])
    shift = np.asarray(residuals, dtype=np.float64).reshape(n, 2)
    each = np.tile(np.diag([1e-6, noise, noise]), (n, 1, 1))
    bare = (np.zeros((n, 3)), np.zeros(n), np.ones(n), np.tile([1.0, 0.0], (n, 1)))
    return Innovations(np.zeros(n), shift, each, np.asarray(first), np.asarray(last), drift, *bare)


def gains_beside(judged, believed, scale):
    """Evidence that each closure adds to a set it is not part of."""
    return log_normal(*surprises(judged, believed, scale)) - log_gate(judged, scale)


def log_false(closures):
    own = closures.drift[closures.last] - closures.drift[closures.first] + closures.noise
    return -np.log(GATE_VOLUME) - 0.5 * np.log(np.linalg.det(own))


def test_evidence_is_the_ratio_of_a_joint_normal_to_an_even_density():
    closures = along_a_track([[1.0, 0.5], [1.2, 0.3], [-0.2, 2.0]], [0, 1, 3], [8, 9, 6])
    joint = multivariate_normal(np.zeros(9), closures.joint_covariance(1.0))
    expected = joint.logpdf(closures.residuals.ravel()) - log_false(closures).sum()
    assert log_evidence(closures, 1.0) == pytest.approx(expected)


def test_a_scale_of_two_costs_half_a_unit_more_than_its_likelihood():
    closures = along_a_track([[1.0, 0.5], [1.2, 0.3]], [0, 1], [8, 9])
    joint = multivariate_normal(np.zeros(6), closures.joint_covariance(2.0))
    expected = joint.logpdf(closures.residuals.ravel()) - log_false(closures).sum() - 0.5
    assert log_evidence(closures, 2.0) == pytest.approx(expected)


def test_evidence_of_a_set_is_the_sum_of_what_each_adds_to_those_before():
    closures = along_a_track([[1.0, 0.5], [1.2, 0.3], [1.1, 0.4]], [0, 1, 0], [8, 9, 9])
    total = log_evidence(closures[np.array([0])], 1.0)
    for k in (1, 2):
        total += gains_beside(closures[np.array([k])], closures[np.arange(k)], 1.0)[0]
    assert log_evidence(closures, 1.0) == pytest.approx(total)


def test_drift_five_times_its_model_is_better_explained_by_a_larger_scale():
    rng = np.random.default_rng(0)
    drift = 5.0 * np.cumsum(rng.normal(size=(20, 2)), axis=0)
    first, last = np.arange(0, 8), np.arange(12, 20)
    closures = along_a_track(drift[first] - drift[last], first, last)
    assert log_evidence(closures, 4.0) > log_evidence(closures, 2.0) > log_evidence(closures, 1.0)


def test_a_closure_beside_a_set_gains_where_the_set_says_it_must_lie():
    believed = along_a_track([[3.0, 0.0], [3.1, 0.1]], [0, 0], [8, 9])
    judged = along_a_track([[3.0, 0.1], [0.0, 0.0]], [0, 0], [9, 9])
    gains = gains_beside(judged, believed, 1.0)
    assert gains[0] > 0 > gains[1]


def test_all_that_agree_are_kept():
    closures = along_a_track([[3.0, 0.0], [3.1, 0.1], [2.9, -0.1]], [0, 0, 0], [8, 8, 8])
    assert without_losers(closures, np.arange(3), 1.0).tolist() == [0, 1, 2]


def test_the_one_that_disagrees_is_dropped():
    closures = along_a_track([[3.0, 0.0], [-3.0, 0.0], [3.1, 0.1], [2.9, -0.1]], [0, 0, 0, 0], [8, 8, 8, 8])
    assert without_losers(closures, np.arange(4), 1.0).tolist() == [0, 2, 3]


def test_a_group_that_backs_itself_alone_is_dropped_where_dead_reckoning_speaks_against_it():
    # five closures of one place share an offset of 12 m: eight standard deviations of the steps that only they contain
    offsets = [[0.5, 0.0], [0.3, 0.2], [0.4, -0.2]] + [[12.0, 0.0]] * 5
    closures = along_a_track(offsets, [0, 1, 2, 10, 10, 10, 10, 10], [9, 8, 7, 12, 12, 12, 12, 12])
    group = np.array([0, 1, 2, 3, 3, 3, 3, 3])
    assert without_losers(closures, group, 1.0).tolist() == [0, 1, 2]


def test_as_closures_of_many_places_the_same_would_be_kept():
    offsets = [[0.5, 0.0], [0.3, 0.2], [0.4, -0.2]] + [[12.0, 0.0]] * 5
    closures = along_a_track(offsets, [0, 1, 2, 10, 10, 10, 10, 10], [9, 8, 7, 12, 12, 12, 12, 12])
    assert without_losers(closures, np.arange(8), 1.0).tolist() == list(range(8))


def test_a_single_closure_is_kept_only_near_dead_reckoning():
    near, far = along_a_track([[1.0, 1.0]], [0], [4]), along_a_track([[6.0, 6.0]], [0], [4])
    assert without_losers(near, np.zeros(1, dtype=int), 1.0).tolist() == [0]
    assert without_losers(far, np.zeros(1, dtype=int), 1.0).tolist() == []


def test_dropping_one_by_one_equals_starting_without_it():
    rng = np.random.default_rng(3)
    closures = along_a_track(rng.normal(0, 3, (8, 2)), rng.integers(0, 5, 8), rng.integers(6, 12, 8))
    kept = without_losers(closures, np.arange(8), 1.0)
    assert np.array_equal(kept, kept[without_losers(closures[kept], np.arange(len(kept)), 1.0)])
