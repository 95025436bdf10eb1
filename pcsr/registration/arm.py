"""Error of the arm: how large it is, and what of it all touches share.

A touch's motion is the sum of a shared motion, as a wrong calibration between arm and camera causes it, and one of its
own. Both are normal with unknown deviations, which are estimated by the likelihood of the touches that the cloud
constrains (type-II maximum likelihood). So an arm that proves exact is trusted, also along the directions that no
touch can check.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.registration.fit import Prior
from pcsr.registration.motions import isotropic

STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0, 1.5, 2.5)
"""Deviations that are tried, in units of the stated one."""
DOUBT = 1.0
"""Standard deviation of the logarithm of the ratio between the true and the stated deviation."""


@dataclass(frozen=True)
class Evidence:
    """What the cloud says of one touch's motion: a normal likelihood in information form."""

    information: Float[np.ndarray, "6 6"]
    vector: Float[np.ndarray, "6"]
    """Information times the most likely motion."""
    carried: Float[np.ndarray, "6 6"]
    """Matrix that expresses the shared motion in the frame of the touch."""


@dataclass(frozen=True)
class Arm:
    """Estimated error of the arm."""

    shared: float
    """Deviation of the shared motion, in units of the stated error."""
    private: float
    """Deviation of each touch's own motion, likewise."""
    stated: Float[np.ndarray, "6 6"]
    """Covariance of the stated error."""
    pieces: tuple[tuple[Float[np.ndarray, "6 6"], Float[np.ndarray, "6"]], ...]
    """Information about the shared motion, and its vector, from each touch."""

    @classmethod
    def of(cls, evidence: Sequence[Evidence], stated: Float[np.ndarray, "6 6"]) -> "Arm":
        """Estimate the error of the arm from the touches that the cloud constrains."""
        best, most = (1.0, 0.0), -np.inf
        for private in STEPS:
            logs, pieces = _marginal(evidence, private**2 * stated)
            for shared in (0.0, *STEPS):
                total = np.hypot(private, shared)
                found = logs + _of_shared(pieces, shared**2 * stated) - 0.5 * (np.log(total) / DOUBT) ** 2
                if found > most:
                    best, most = (private, shared), found
        private, shared = best
        return cls(shared, private, stated, tuple(_marginal(evidence, private**2 * stated)[1]))

    def offset(self, without: int | None = None) -> Prior:
        """Return the distribution of the shared motion, given all touches or all but one."""
        pieces = [piece for number, piece in enumerate(self.pieces) if number != without]
        information = sum((one for one, _ in pieces), np.zeros((6, 6)))
        vector = sum((one for _, one in pieces), np.zeros(6))
        covariance = self.shared**2 * self.stated
        gain = np.linalg.solve(np.eye(6) + covariance @ information, covariance)
        return Prior(gain @ vector, (gain + gain.T) / 2)

    def prior(self, carried: Float[np.ndarray, "6 6"], without: int | None = None) -> Prior:
        """Return the distribution of a touch's motion.

        Args:
            carried: matrix that expresses the shared motion in the frame of the touch.
            without: number of the touch among the evidence, which must not count twice.
        """
        offset = self.offset(without)
        covariance = self.private**2 * self.stated + carried @ offset.covariance @ carried.T
        return Prior(carried @ offset.mean, covariance)


def _marginal(
    evidence: Sequence[Evidence], private: Float[np.ndarray, "6 6"]
) -> tuple[float, list[tuple[Float[np.ndarray, "6 6"], Float[np.ndarray, "6"]]]]:
    """Integrate over the touches' own motions: the logarithm of the likelihood, and what is left for the shared one."""
    logs, pieces = 0.0, []
    for one in evidence:
        gain = np.linalg.inv(np.eye(6) + private @ one.information)
        logs += 0.5 * np.linalg.slogdet(gain)[1] + 0.5 * one.vector @ gain @ private @ one.vector
        through = one.carried.T @ gain.T
        pieces.append((through @ one.information @ one.carried, through @ one.vector))
    return float(logs), pieces


def _of_shared(
    pieces: Sequence[tuple[Float[np.ndarray, "6 6"], Float[np.ndarray, "6"]]], shared: Float[np.ndarray, "6 6"]
) -> float:
    information = sum((one for one, _ in pieces), np.zeros((6, 6)))
    vector = sum((one for _, one in pieces), np.zeros(6))
    gain = np.linalg.inv(np.eye(6) + shared @ information)
    return float(0.5 * np.linalg.slogdet(gain)[1] + 0.5 * vector @ gain @ shared @ vector)


def stated(position: float, rotation: float) -> Float[np.ndarray, "6 6"]:
    """Return the covariance of a stated error: in millimetres, and in degrees."""
    return isotropic(position, np.radians(rotation))
