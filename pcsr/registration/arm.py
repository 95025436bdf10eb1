"""Error of the arm: how large it is, and what of it all touches share.

A touch's motion is the sum of a shared motion, as a wrong calibration between arm and camera causes it, and one of its
own. Both are normal, with deviations that are not known: all on a grid are tried, and each counts by how well it
explains the touches that the cloud constrains. So an arm that proves exact is trusted along the directions too that no
touch can check, and touches of a side that the cloud does not show are corrected by those of the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.registration.fit import TEMPER, Mode, Prior

STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0, 1.5, 2.5)
"""Deviations that are tried, in units of the stated one."""
DOUBT = 1.0
"""Standard deviation of the logarithm of the ratio between the true and the stated deviation."""
LIKELY = 1e-3
"""Pairs of deviations with a smaller probability, relative to the best, are left out."""

Matrix = Float[np.ndarray, "6 6"]
Matrices = Float[np.ndarray, "... 6 6"]
Vectors = Float[np.ndarray, "... 6"]


@dataclass(frozen=True)
class Evidence:
    """What the cloud says of one touch's motion."""

    mode: Mode
    carried: Matrix
    """Matrix that expresses the shared motion in the frame of the touch."""


@dataclass(frozen=True)
class Arm:
    """Estimated error of the arm: q possible pairs of deviations, in units of the stated error."""

    stated: Matrix
    """Covariance of the stated error."""
    probabilities: Float[np.ndarray, " q"]
    shared_steps: Float[np.ndarray, " q"]
    """Deviation of the shared motion."""
    private_steps: Float[np.ndarray, " q"]
    """Deviation of each touch's own motion."""
    informations: Float[np.ndarray, "q k 6 6"]
    """Information about the shared motion from each of k touches."""
    vectors: Float[np.ndarray, "q k 6"]
    """Information times the most likely shared motion."""
    log: float
    """Logarithm of the evidence: the probability of the cloud, given that each touch is near its mode."""

    @classmethod
    def of(cls, evidence: Sequence[Evidence], stated: Matrix) -> "Arm":
        """Estimate the error of the arm from the touches that the cloud constrains."""
        steps = np.array(STEPS)
        logs, informations, vectors = _marginal(evidence, steps[:, None, None] ** 2 * stated)
        shared = np.r_[0.0, steps]
        logs = logs[:, None] + _logs_of_shared(informations.sum(1), vectors.sum(1), shared[:, None, None] ** 2 * stated)
        private, shared = (each.ravel() for each in np.meshgrid(steps, shared, indexing="ij"))
        logs = logs.ravel() - 0.5 * (np.log(np.hypot(private, shared)) / DOUBT) ** 2
        likely = np.flatnonzero(logs > logs.max() + np.log(LIKELY))
        probabilities = np.exp(logs[likely] - logs.max())
        total = probabilities.sum()
        rows = likely // (len(steps) + 1)
        return cls(
            stated=stated,
            probabilities=probabilities / total,
            shared_steps=shared[likely],
            private_steps=private[likely],
            informations=informations[rows],
            vectors=vectors[rows],
            log=float(logs.max() + np.log(total)) + TEMPER * sum(one.mode.log for one in evidence),
        )

    @property
    def shared(self) -> float:
        """Expected deviation of the shared motion, in units of the stated one."""
        return float(self.probabilities @ self.shared_steps)

    @property
    def private(self) -> float:
        """Expected deviation of each touch's own motion, in units of the stated one."""
        return float(self.probabilities @ self.private_steps)

    def offset(self) -> Prior:
        """Return the distribution of the shared motion, in the frame of the cloud."""
        return self._mixed(*self._offsets(None))

    def prior(self, carried: Matrix, without: int | None = None) -> Prior:
        """Return the distribution of a touch's motion before the cloud around it is looked at.

        Args:
            carried: matrix that expresses the shared motion in the frame of the touch.
            without: number of the touch among the evidence, which must not count twice.
        """
        means, covariances = self._offsets(without)
        own = self.private_steps[:, None, None] ** 2 * self.stated
        return self._mixed(means @ carried.T, own + carried @ covariances @ carried.T)

    def _offsets(self, without: int | None) -> tuple[Vectors, Matrices]:
        """Return mean and covariance of the shared motion for each pair, given all touches or all but one."""
        counted = np.arange(self.vectors.shape[1]) != (-1 if without is None else without)
        information, vector = self.informations[:, counted].sum(1), self.vectors[:, counted].sum(1)
        covariance = self.shared_steps[:, None, None] ** 2 * self.stated
        after = np.linalg.solve(np.eye(6) + covariance @ information, covariance)
        after = (after + after.transpose(0, 2, 1)) / 2
        return (after @ vector[..., None])[..., 0], after

    def _mixed(self, means: Vectors, covariances: Matrices) -> Prior:
        """Return the normal distribution with the mean and covariance of the mixture."""
        mean = self.probabilities @ means
        away = means - mean
        covariance = np.einsum("q,qij->ij", self.probabilities, covariances)
        return Prior(mean, covariance + (away * self.probabilities[:, None]).T @ away)


def _marginal(evidence: Sequence[Evidence], private: Matrices) -> tuple[Float[np.ndarray, " p"], Matrices, Vectors]:
    """Integrate over the touches' own motions.

    Args:
        evidence: of k touches.
        private: p covariances of their own motions.

    Returns:
        The logarithms of the likelihood, (p), and what is left for the shared motion: information, (p k 6 6), and
        vectors, (p k 6).
    """
    count = len(private)
    if not evidence:
        return np.zeros(count), np.zeros((count, 0, 6, 6)), np.zeros((count, 0, 6))
    information = np.stack([one.mode.information for one in evidence])
    vector = np.stack([one.mode.vector for one in evidence])
    carried = np.stack([one.carried for one in evidence])
    gain = np.linalg.inv(np.eye(6) + private[:, None] @ information)
    explained = np.einsum("ki,pkij,pjl,kl->p", vector, gain, private, vector)
    most = np.einsum("ki,kij,kj->", vector, np.linalg.pinv(information), vector)
    logs = 0.5 * (np.linalg.slogdet(gain)[1].sum(1) + explained - most)
    through = carried.transpose(0, 2, 1) @ gain.transpose(0, 1, 3, 2)
    return logs, through @ information @ carried, (through @ vector[..., None])[..., 0]


def _logs_of_shared(information: Matrices, vector: Vectors, shared: Matrices) -> Float[np.ndarray, "p s"]:
    """Integrate over the shared motion: for each of p sums of information, and each of s covariances."""
    gain = np.linalg.inv(np.eye(6) + shared @ information[:, None])
    explained = np.einsum("pi,psij,sjl,pl->ps", vector, gain, shared, vector)
    logs: Float[np.ndarray, "p s"] = 0.5 * (np.linalg.slogdet(gain)[1] + explained)
    return logs
