import numpy as np
import pytest
from scipy.stats import multivariate_normal

from backend.consistency import group_closures
from backend.evidence import log_gate
from backend.growth import grown_sets


@pytest.fixture(scope="module")
def compared(make_survey):
    """Twice as many false closures, in groups of one offset each, after the true ones."""
    survey, rng = make_survey(1), np.random.default_rng(1)
    true = survey.true_closures(rng)
    return survey.compared(true + survey.repeated_false(2 * len(true), len(true), rng)), len(true)


def test_the_set_with_most_evidence_holds_true_closures_only(compared):
    closures, n_true = compared
    group = group_closures(closures.first, closures.last, 4)
    _, members = max(grown_sets(closures, group, 1.0), key=lambda grown: grown[0])
    assert (members < n_true).all()


def test_a_set_takes_one_closure_of_a_group_and_at_least_two(compared):
    closures, _ = compared
    group = group_closures(closures.first, closures.last, 4)
    sets = [members for _, members in grown_sets(closures, group, 2.0)]
    assert sets
    for members in sets:
        assert len(members) >= 2
        assert len(set(group[members].tolist())) == len(members)


def test_evidence_that_grows_step_by_step_is_that_of_the_joint_normal(compared):
    closures, _ = compared
    group = group_closures(closures.first, closures.last, 4)
    for evidence, members in grown_sets(closures, group, 1.5):
        joint = multivariate_normal(np.zeros(3 * len(members)), closures[members].joint_covariance(1.5))
        log_true = joint.logpdf(closures[members].residuals.ravel())
        assert evidence == pytest.approx(log_true - log_gate(closures[members], 1.5).sum(), rel=1e-6)


def test_without_closures_nothing_grows(make_survey):
    empty = make_survey(0).compared([])
    assert list(grown_sets(empty, np.zeros(0, dtype=np.int64), 1.0)) == []
