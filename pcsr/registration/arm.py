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
Vector = Float[np.ndarray, "6"]


@dataclass(frozen=True)
class Evidence:
    """What the cloud says of one touch's motion."""

    mode: Mode
    carried: Matrix
    """Matrix that expresses the shared motion in the frame of the touch."""


@dataclass(frozen=True)
class Deviations:
    """One possibility of how large the errors are, in units of the stated error."""

    probability: float
    shared: float
    private: float
    pieces: Sequence[tuple[Matrix, Vector]]
    """Information about the shared motion from each touch of the evidence, and its vector."""

    def offset(self, stated: Matrix, without: int | None) -> Prior:
        """Return the distribution of the shared motion, given all touches or all but one."""
        information, vector = _sum([piece for number, piece in enumerate(self.pieces) if number != without])
        covariance = self.shared**2 * stated
        gain = np.linalg.solve(np.eye(6) + covariance @ information, covariance)
        return Prior(gain @ vector, (gain + gain.T) / 2)


@dataclass(frozen=True)
class Arm:
    """Estimated error of the arm."""

    stated: Matrix
    """Covariance of the stated error."""
    possible: Sequence[Deviations]
    log: float
    """Logarithm of the evidence: the probability of the cloud, given that each touch is near its mode."""

    @classmethod
    def of(cls, evidence: Sequence[Evidence], stated: Matrix) -> "Arm":
        """Estimate the error of the arm from the touches that the cloud constrains."""
        found = []
        height = TEMPER * sum(one.mode.log for one in evidence)
        for private in STEPS:
            log, pieces = _marginal(evidence, private**2 * stated)
            for shared in (0.0, *STEPS):
                doubt = 0.5 * (np.log(np.hypot(private, shared)) / DOUBT) ** 2
                found.append((log + _log_of_shared(pieces, shared**2 * stated) - doubt, shared, private, pieces))
        most = max(log for log, *_ in found)
        total = sum(np.exp(log - most) for log, *_ in found)
        likely = [Deviations(float(np.exp(log - most) / total), *rest) for log, *rest in found]
        best = max(one.probability for one in likely)
        return cls(stated, [one for one in likely if one.probability >= LIKELY * best], float(most + np.log(total)) + height)

    @property
    def shared(self) -> float:
        """Expected deviation of the shared motion, in units of the stated one."""
        return self._mean("shared")

    @property
    def private(self) -> float:
        """Expected deviation of each touch's own motion, in units of the stated one."""
        return self._mean("private")

    def _mean(self, name: str) -> float:
        total = sum(one.probability for one in self.possible)
        return sum(one.probability * getattr(one, name) for one in self.possible) / total

    def offset(self) -> Prior:
        """Return the distribution of the shared motion, in the frame of the cloud."""
        return _mixed([(one.probability, one.offset(self.stated, None)) for one in self.possible])

    def prior(self, carried: Matrix, without: int | None = None) -> Prior:
        """Return the distribution of a touch's motion before the cloud around it is looked at.

        Args:
            carried: matrix that expresses the shared motion in the frame of the touch.
            without: number of the touch among the evidence, which must not count twice.
        """
        parts = []
        for one in self.possible:
            offset = one.offset(self.stated, without)
            covariance = one.private**2 * self.stated + carried @ offset.covariance @ carried.T
            parts.append((one.probability, Prior(carried @ offset.mean, covariance)))
        return _mixed(parts)


def _mixed(parts: Sequence[tuple[float, Prior]]) -> Prior:
    """Return the normal distribution with the mean and covariance of a mixture."""
    total = sum(weight for weight, _ in parts)
    mean = sum((weight / total * one.mean for weight, one in parts), np.zeros(6))
    covariance = sum(
        (weight / total * (one.covariance + np.outer(one.mean - mean, one.mean - mean)) for weight, one in parts),
        np.zeros((6, 6)),
    )
    return Prior(mean, covariance)


def _marginal(evidence: Sequence[Evidence], private: Matrix) -> tuple[float, list[tuple[Matrix, Vector]]]:
    """Integrate over the touches' own motions: the logarithm of the likelihood, and what is left for the shared one."""
    log, pieces = 0.0, []
    for one in evidence:
        gain = np.linalg.inv(np.eye(6) + private @ one.mode.information)
        log += 0.5 * float(np.linalg.slogdet(gain)[1] + one.mode.vector @ gain @ private @ one.mode.vector)
        log -= 0.5 * float(one.mode.vector @ np.linalg.pinv(one.mode.information) @ one.mode.vector)
        through = one.carried.T @ gain.T
        pieces.append((through @ one.mode.information @ one.carried, through @ one.mode.vector))
    return log, pieces


def _log_of_shared(pieces: Sequence[tuple[Matrix, Vector]], shared: Matrix) -> float:
    """Integrate over the shared motion."""
    information, vector = _sum(pieces)
    gain = np.linalg.inv(np.eye(6) + shared @ information)
    return 0.5 * float(np.linalg.slogdet(gain)[1] + vector @ gain @ shared @ vector)


def _sum(pieces: Sequence[tuple[Matrix, Vector]]) -> tuple[Matrix, Vector]:
    information = sum((one for one, _ in pieces), np.zeros((6, 6)))
    return information, sum((one for _, one in pieces), np.zeros(6))
