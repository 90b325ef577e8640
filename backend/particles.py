"""Particles: a Rao-Blackwellised filter over which loop closures are true.

A particle is a hypothesis: which of the closures so far are true, and how much worse than modelled dead reckoning is.
Given that, the errors of all anchors are Gaussian and are carried in closed form, as FastSLAM carries its landmarks
(Montemerlo et al., AAAI 2002) and SegSLAM its submaps (Fairfield, Wettergreen and Kantor, JFR 2010). A particle draws
for each closure whether it is true by how well it foretells it, is weighed by the likelihood, and drawn again where few
carry all the weight. At the end the best particle's closures go to the graph: the delayed decision of a particle front
end and one Gaussian behind it are HybridSLAM (Brooks and Bailey, WAFR 2008).
"""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from backend.arrays import BoolArray, FloatArray, IntArray
from backend.beliefs import Offer, believed_set, start_poses
from backend.consistency import credible_set, group_closures
from backend.evidence import log_gate, log_normal
from backend.innovations import Innovations
from backend.problem import Belief
from backend.votes import stretch_of


class ParticleConfig(BaseModel):
    """The particle filter."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    n_particles: int = Field(default=100, ge=1, description="Hypotheses [1]; more keep a rare truth longer.")
    prior_true: float = Field(
        default=0.5, gt=0, lt=1, description="Share of closures [1] that are true before they are looked at; undecided."
    )
    min_effective: float = Field(
        default=0.5, gt=0, le=1, description="Effective share of particles [1] below which they are drawn again; usual."
    )


class _Particle:
    """One hypothesis: the closures it takes for true and a Cholesky factor of their joint covariance."""

    def __init__(self, scale: float, log_weight: float) -> None:
        self.scale = scale
        self.log_weight = log_weight
        self.log_evidence = log_weight
        self.members: list[int] = []
        self.root: FloatArray = np.zeros((0, 0))
        self.whitened: FloatArray = np.zeros(0)

    def copy(self) -> "_Particle":
        """A hypothesis that begins as this one; arrays are replaced and never changed, so they may be shared."""
        other = _Particle(self.scale, self.log_weight)
        other.log_evidence = self.log_evidence
        other.members, other.root, other.whitened = list(self.members), self.root, self.whitened
        return other

    def foretell(self, closures: Innovations, closure: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Surprise of a closure, its covariance, and the row of the factor that it would add."""
        one, row = closures[np.array([closure])], np.zeros((3, 0))
        own = self.scale**2 * one.shared_drift(one)[0, 0] + one.noise[0]
        if not self.members:
            return one.residuals[0], own, row
        shared = self.scale**2 * one.shared_drift(closures[np.array(self.members)])[0]
        row = np.linalg.solve(self.root, shared.transpose(0, 2, 1).reshape(-1, 3)).T
        return one.residuals[0] - row @ self.whitened, own - row @ row.T, row

    def take(self, closure: int, surprise: FloatArray, covariance: FloatArray, row: FloatArray) -> None:
        """Take a closure for true."""
        n, corner = len(self.whitened), np.linalg.cholesky(covariance)
        root = np.zeros((n + 3, n + 3))
        root[:n, :n], root[n:, :n], root[n:, n:] = self.root, row, corner
        self.root, self.whitened = root, np.concatenate([self.whitened, np.linalg.solve(corner, surprise)])
        self.members.append(closure)


def believe_best_particle(offer: Offer, config: ParticleConfig | None = None) -> Belief:
    """Believe the closures of the best particle.

    Parameters
    ----------
    offer : Offer
        The graph and the closures to choose from.
    config : ParticleConfig, optional
        The filter.

    Returns
    -------
    belief : Belief
        The closures that the heaviest hypothesis takes for true, if they are enough and credible.
    """
    config, problem = config or ParticleConfig(), offer.problem
    T = start_poses(problem)
    compared = problem.compared(T, offer.closures)
    best = _filtered(compared, offer, config)
    members = np.sort(np.array(best.members, dtype=np.int64))
    return believed_set(offer, credible_set(compared, members, best.scale, offer.consistency), T)


def _filtered(closures: Innovations, offer: Offer, config: ParticleConfig) -> _Particle:
    """Run the filter over the closures, the surest first, and give the particle that explains them best."""
    scales = np.geomspace(1.0, offer.consistency.max_odometry_scale, config.n_particles)
    particles = [_Particle(float(scale), -0.5 * float(np.log2(scale)) ** 2) for scale in scales]
    log_prior = float(np.log(config.prior_true) - np.log1p(-config.prior_true))
    group = group_closures(closures.first, closures.last, stretch_of(offer.consistency))
    worth = np.where(_is_founder(group), 1.0, offer.consistency.repeat_vote)
    log_false = log_gate(closures, 1.0)
    for closure in np.argsort(-log_false, kind="stable").tolist():
        for particle in particles:
            _decide(particle, closures, closure, (log_false[closure] - log_prior, worth[closure]), offer.rng)
        particles = _resampled(particles, config, offer.rng)
    return max(particles, key=lambda particle: particle.log_evidence)


def _decide(
    particle: _Particle, closures: Innovations, closure: int, false: tuple[float, float], rng: np.random.Generator
) -> None:
    """Draw whether a closure is true by its odds, and weigh the particle by how likely the closure was at all."""
    surprise, covariance, row = particle.foretell(closures, closure)
    gain = float(log_normal(surprise[None], covariance[None])[0]) - false[0]
    # the weight is the likelihood of the closure, be it true or false; a repetition tells little that is new
    likelihood = false[1] * float(np.logaddexp(0.0, gain))
    particle.log_weight += likelihood
    particle.log_evidence += likelihood
    if np.log(rng.uniform()) < -np.logaddexp(0.0, -gain):
        particle.take(closure, surprise, covariance, row)


def _resampled(particles: list[_Particle], config: ParticleConfig, rng: np.random.Generator) -> list[_Particle]:
    """Draw particles again by their weights, evenly spaced, where few carry all of it."""
    log_weights = np.array([particle.log_weight for particle in particles])
    weights = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()
    if 1.0 / (weights**2).sum() > config.min_effective * len(particles):
        return particles
    places = (np.arange(len(particles)) + rng.uniform()) / len(particles)
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)
    drawn = [particles[int(k)].copy() for k in chosen]
    for particle in drawn:
        particle.log_weight = 0.0
    return drawn


def _is_founder(group: IntArray) -> BoolArray:
    """Whether each closure is the first of its group."""
    is_founder = np.zeros(len(group), dtype=bool)
    is_founder[np.unique(group, return_index=True)[1]] = True
    return is_founder
