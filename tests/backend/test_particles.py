import numpy as np
import pytest
from pydantic import ValidationError

from backend.evidence import log_normal, surprises
from backend.particles import ParticleConfig, _Particle
from backend.pose_graph import PoseGraphConfig

PARTICLES = PoseGraphConfig(method="particles")


def test_a_particle_foretells_what_the_joint_covariance_says(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    compared, particle = survey.compared(survey.true_closures(rng)[:5]), _Particle(2.0, 0.0)
    for closure in range(4):
        particle.take(closure, *particle.foretell(compared, closure))
    np.testing.assert_allclose(particle.root @ particle.root.T, compared[np.arange(4)].joint_covariance(2.0), rtol=1e-8)
    surprise, covariance, _ = particle.foretell(compared, 4)
    distance = surprise @ np.linalg.solve(covariance, surprise)
    density = -0.5 * (distance + np.linalg.slogdet(2.0 * np.pi * covariance)[1])
    four, fifth = compared[np.arange(4)], compared[np.array([4])]
    assert density == pytest.approx(log_normal(*surprises(fifth, four, 2.0))[0])


@pytest.mark.parametrize("drift_factor", [1.0, 3.0])
def test_half_of_the_closures_false_and_the_track_is_found(make_survey, drift_factor):
    survey, rng = make_survey(1, drift_factor), np.random.default_rng(1)
    true = survey.true_closures(rng)
    solution = survey.graph([*true, *survey.independent_false(len(true), rng)], config=PARTICLES).solve()
    # hypotheses are drawn: one or two true ones may be drawn as false
    assert solution.is_inlier[: len(true)].sum() >= len(true) - 2
    assert survey.error(solution.T_world_anchor) < 0.5 * survey.error(survey.dr_anchors)


def test_the_same_draws_give_the_same_bytes_and_others_may_not(make_survey):
    survey, rng = make_survey(2), np.random.default_rng(2)
    graph = survey.graph(survey.true_closures(rng) + survey.independent_false(8, rng), config=PARTICLES)
    first, second = (graph.solve(rng=np.random.default_rng(7)) for _ in range(2))
    assert first.T_world_anchor.tobytes() == second.T_world_anchor.tobytes()
    assert first.reasons == second.reasons


def test_without_closures_dead_reckoning_comes_back(make_survey):
    survey = make_survey(0)
    solution = survey.graph([], config=PARTICLES).solve()
    assert solution.T_world_anchor.tobytes() == survey.dr_anchors.tobytes()


def test_one_closure_alone_is_not_believed_by_particles_either(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    solution = survey.graph([survey.closure(4, 57, rng)], config=PARTICLES).solve()
    assert not solution.is_inlier.any()


def test_misspelt_settings_are_refused():
    with pytest.raises(ValidationError, match="n_particle"):
        ParticleConfig(n_particle=3)
