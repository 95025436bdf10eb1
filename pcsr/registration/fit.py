"""Posterior distribution of a touch's motion, by particles that are fitted to the cloud."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.distance import cdist
from scipy.special import logsumexp

from pcsr.registration.likelihood import Likelihood
from pcsr.registration.motions import Motions

PARTICLES = 64
"""Number of particles drawn from the prior, the first at its mean, and as many that are drawn around the best. Their
mean is that of the distribution, so that nothing moves where the cloud says nothing."""
NARROW = 3.0
"""The latter's deviations are those of the prior, divided by this."""
FIRST, SECOND, LAST = (5, 2), (2, 3), (0, 3)
"""Numbers of steps of the first particles, the second ones and their mean: with a large deviation of the cloud, which
falls, and with the estimated one."""
TEMPER = 0.5
"""Power of the likelihood in the weights: its approximations make errors that several points share."""
BASIN = 30.0
"""Particles are in one basin if their squared distance, in deviations that the cloud allows, is below this."""
ROUNDING = 1e-10
"""Variances are known up to this share of those of the prior."""


@dataclass(frozen=True)
class Prior:
    """Normal distribution of a touch's motion, in the frame of the touch."""

    mean: Float[np.ndarray, "6"]
    covariance: Float[np.ndarray, "6 6"]

    def log(self, motions: Motions) -> Float[np.ndarray, " s"]:
        """Return the logarithm of the density of motions."""
        away = np.linalg.solve(np.linalg.cholesky(self.covariance), (motions - self.mean).T)
        log: Float[np.ndarray, " s"] = -0.5 * (away**2).sum(0) - 0.5 * np.linalg.slogdet(self.covariance)[1]
        return log


@dataclass(frozen=True)
class Mode:
    """What the cloud says of a touch's motion around a mode: a normal likelihood in information form."""

    information: Float[np.ndarray, "6 6"]
    """Information of the cloud about the motion, without the prior."""
    vector: Float[np.ndarray, "6"]
    """Information times the motion that is most likely without the prior."""
    log: float
    """Logarithm of the likelihood at the mode."""


@dataclass(frozen=True)
class Posterior:
    """Distribution of a touch's motion, given the cloud and the prior."""

    motion: Float[np.ndarray, "6"]
    """Mean of the particles around the best one, fitted to the cloud."""
    mode: Mode
    """Likelihood around `motion`."""
    deviation: float
    """Standard deviation of the cloud's points from the touched surface."""
    freedom: float
    """Number of points behind the deviation, less the fitted parameters."""
    particles: Motions
    weights: Float[np.ndarray, " s"]
    """Probability of each particle."""

    @property
    def covariance(self) -> Float[np.ndarray, "6 6"]:
        """Second moment of the motion about `motion`."""
        away = self.particles - self.motion
        moment: Float[np.ndarray, "6 6"] = (away * self.weights[:, None]).T @ away
        return moment


def fit(likelihood: Likelihood, prior: Prior, floor: float, deviation: float | None = None) -> Posterior:
    """Find the distribution of a touch's motion.

    Motions are drawn from the prior. Each is fitted to the cloud, as if its draw were the mean of the prior: it moves
    only along the directions that the cloud constrains (randomise, then optimise; Bardsley et al., 2014), and is
    weighted by its likelihood. So sliding along a surface stays as uncertain as the prior, unless the border of the
    contact speaks against it. Around the likely motions more are drawn (population Monte Carlo).

    Args:
        likelihood: of the touch's motions.
        prior: distribution of the motion before the cloud is looked at.
        floor: smallest deviation of the points from the surface, in millimetres.
        deviation: deviation of the points; it is estimated if it is not known.
    """
    rng = np.random.default_rng(0)
    root = np.linalg.cholesky(prior.covariance)
    if len(likelihood.points) == 0:
        return _unchanged(prior, _drawn(rng) @ root.T, floor if deviation is None else deviation)
    precision = np.linalg.inv(prior.covariance)
    first = prior.mean + _drawn(rng) @ root.T
    widest = max(float((np.trace(precision[3:, 3:]) / 3) ** -0.5), floor)
    particles, level, freedom = _fitted(likelihood, first, precision, floor, deviation, widest, FIRST)
    logs, _, _ = _logs(likelihood, particles, prior, precision, level)
    weights = np.exp(TEMPER * (logs - logs.max()))
    shares = np.cumsum(weights) / weights.sum()
    parents = np.searchsorted(shares, (np.arange(PARTICLES) + 0.5) / PARTICLES).clip(max=PARTICLES - 1)
    second = particles[parents] + _drawn(rng) @ root.T / NARROW
    more, level, freedom = _fitted(likelihood, second, precision, floor, deviation, max(widest / NARROW, level), SECOND)
    starts, particles = np.concatenate([first, second]), np.concatenate([particles, more])
    logs, informations, inverse = _logs(likelihood, particles, prior, precision, level)
    of_prior = prior.log(starts)
    logs += of_prior - np.logaddexp(of_prior, _log_around(starts, particles[parents], root / NARROW))
    weights = np.exp(TEMPER * (logs - logs.max()))
    weights /= weights.sum()
    best = int(weights.argmax())
    beside = particles - particles[best]
    same = np.einsum("si,ij,sj->s", beside, informations[best], beside) < BASIN
    mean = weights[same] @ particles[same] / weights[same].sum()
    motion, mode = modes(likelihood, mean[None], precision, floor, level, level, LAST)
    spread = inverse @ informations @ inverse  # inverse - inverse @ precision @ inverse would cancel for coarse clouds
    least = ROUNDING * np.diag(np.diag(prior.covariance))
    jitter = np.linalg.cholesky(spread + least) @ rng.normal(size=(2 * PARTICLES, 6, 1))
    return Posterior(motion[0], mode[0], level, freedom, particles + jitter[..., 0], weights)


def _drawn(rng: np.random.Generator) -> Motions:
    """Draw motions from the standard normal distribution, the first at its mean, and subtract their mean."""
    drawn = rng.normal(size=(PARTICLES, 6))
    drawn[0] = 0
    drawn[1:] -= drawn[1:].mean(0)
    return drawn


def _unchanged(prior: Prior, drawn: Motions, deviation: float) -> Posterior:
    """Return the prior as the distribution of a touch's motion, if there is no cloud around it."""
    particles = prior.mean + drawn
    weights = np.full(len(particles), 1 / len(particles))
    nothing = Mode(np.zeros((6, 6)), np.zeros(6), 0.0)
    return Posterior(prior.mean, nothing, deviation, 0.0, particles, weights)


def _log_around(
    starts: Motions, centres: Float[np.ndarray, "p 6"], root: Float[np.ndarray, "6 6"]
) -> Float[np.ndarray, " s"]:
    """Return the logarithm of the density of a mixture of normal distributions with the same root of covariance."""
    squared = cdist(np.linalg.solve(root, starts.T).T, np.linalg.solve(root, centres.T).T, "sqeuclidean")
    log: Float[np.ndarray, " s"] = (
        logsumexp(-0.5 * squared, axis=1) - np.log(len(centres)) - np.log(np.diag(root)).sum()
    )
    return log


def modes(
    likelihood: Likelihood,
    starts: Motions,
    precision: Float[np.ndarray, "6 6"],
    floor: float,
    deviation: float,
    widest: float,
    steps: tuple[int, int] = SECOND,
) -> tuple[Motions, list[Mode]]:
    """Fit motions to the cloud, each with its start as the mean of the prior, and return what the cloud says there.

    Args:
        likelihood: of the touch's motions.
        starts: (s 6).
        precision: inverse of the prior's covariance.
        floor: smallest deviation of the points from the surface, in millimetres.
        deviation: deviation of the points.
        widest: deviation in the first step.
        steps: numbers of steps while the deviation falls, and with the last one.
    """
    motions, _, _ = _fitted(likelihood, starts, precision, floor, deviation, widest, steps)
    terms = likelihood.terms(motions, np.full(len(motions), deviation))
    vectors = (terms.information @ motions[..., None])[..., 0] + (motions - starts) @ precision
    logs = likelihood.log(terms).tolist()
    return motions, [Mode(*one) for one in zip(terms.information, vectors, logs, strict=True)]


def _logs(
    likelihood: Likelihood, particles: Motions, prior: Prior, precision: Float[np.ndarray, "6 6"], level: float
) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s 6 6"], Float[np.ndarray, "s 6 6"]]:
    """Return the logarithm of each particle's weight, the cloud's information, and the posterior covariance there.

    Of the prior only the constrained directions count: along the others the particles are drawn from it.
    """
    terms = likelihood.terms(particles, np.full(len(particles), level))
    inverse = np.linalg.inv(terms.information + precision)
    constrained = precision - precision @ inverse @ precision
    away = particles - prior.mean
    logs = likelihood.log(terms) - 0.5 * np.einsum("si,sij,sj->s", away, constrained, away)
    return logs + 0.5 * np.linalg.slogdet(inverse)[1], terms.information, inverse


def _fitted(
    likelihood: Likelihood,
    start: Motions,
    precision: Float[np.ndarray, "6 6"],
    floor: float,
    deviation: float | None,
    widest: float,
    steps: tuple[int, int],
) -> tuple[Motions, float, float]:
    """Fit motions to the cloud, each with its start as the mean of the prior.

    Returns:
        The motions, the deviation of the cloud from the best, and the number of points behind it, less the fitted
        parameters.
    """
    coarse, fine = steps
    level = np.full(len(start), widest)
    motions, count = start, np.zeros(len(start))
    for step in range(1, coarse + fine + 1):
        terms = likelihood.terms(motions, level)
        gradient = terms.gradient + (motions - start) @ precision
        motions = motions - np.linalg.solve(terms.information + precision, gradient[..., None])[..., 0]
        count = np.maximum(terms.inside.sum(1) - 3, 0)
        if deviation is None:
            level = np.sqrt((terms.inside * terms.squared).sum(1) / np.maximum(count, 1))
        else:
            level = np.full(len(start), deviation)
        level = np.maximum(level, floor)
        if step <= coarse:
            level = np.maximum(level, widest * (floor / widest) ** (step / coarse))
    if deviation is not None:
        return motions, deviation, float(count.max())
    best = int(likelihood.log(likelihood.terms(motions, level)).argmax())
    return motions, float(level[best]), float(count[best])
