"""Motions that explain several touches at once, if the arm's error is the same for all of them.

Alone, a touch may fit in several places, such as the teeth of a rack. A motion that all touches share has to fit each.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pcsr.registration.arm import Arm, Evidence
from pcsr.registration.fit import TEMPER, Mode, Posterior, modes
from pcsr.registration.likelihood import Likelihood

TOUCHES = 16
"""Largest number of touches that propose shared motions."""
PROPOSALS = 48
"""Largest number of proposed motions."""
PRIVATE = 0.2
"""Deviation of each touch's own motion in the comparison of shared ones, in units of the stated error."""
COMPARED = 3
"""Number of shared motions, the best ones, whose evidence is computed."""

Matrix = Float[np.ndarray, "6 6"]


def arm_of(
    first: Sequence[Posterior],
    likelihoods: Sequence[Likelihood],
    frames: Sequence[Matrix],
    stated: Matrix,
    floors: Sequence[float],
    deviation: float,
) -> Arm:
    """Estimate the error of the arm, from each touch alone or from shared motions, whichever explains the cloud better.

    Args:
        first: distribution of each touch's motion.
        likelihoods: of each touch's motion.
        frames: matrices that express the shared motion in the frame of each touch.
        stated: covariance of the stated error.
        floors: smallest deviation of the cloud from each touched surface, in millimetres.
        deviation: deviation of the cloud from all of them.
    """
    arms = [Arm.of([Evidence(*one) for one in zip([each.mode for each in first], frames, strict=True)], stated)]
    if not first:
        return arms[0]
    proposals = _proposals(first, frames)
    private = np.linalg.inv(PRIVATE**2 * stated)
    widest = PRIVATE * float(np.sqrt(stated[5, 5]))
    scores = -0.5 * TEMPER * np.einsum("ci,ij,cj->c", proposals, np.linalg.inv(stated), proposals)
    found: list[list[Mode]] = []
    for likelihood, frame, floor in zip(likelihoods, frames, floors, strict=True):
        starts = proposals @ frame.T
        motions, there = modes(likelihood, starts, private, floor, max(deviation, floor), max(widest, floor))
        away = motions - starts
        scores += TEMPER * np.array([one.log for one in there]) - 0.5 * np.einsum("ci,ij,cj->c", away, private, away)
        found.append(there)
    best = [0, *[index for index in np.argsort(-scores, kind="stable").tolist() if index][:COMPARED]]
    arms += [Arm.of([Evidence(of[c], frame) for of, frame in zip(found, frames, strict=True)], stated) for c in best]
    return max(arms, key=lambda arm: arm.log)


def _proposals(first: Sequence[Posterior], frames: Sequence[Matrix]) -> Float[np.ndarray, "c 6"]:
    """Return the motions of the cloud's frame that the likeliest particles of the touches stand for; first, none."""
    some = np.unique(np.linspace(0, len(first) - 1, min(TOUCHES, len(first))).astype(int))
    each = max(1, PROPOSALS // len(some))
    proposals = [np.zeros((1, 6))]
    for number in some:
        posterior = first[number]
        likely = np.argsort(-posterior.weights, kind="stable")[:each]
        proposals.append(np.linalg.solve(frames[number], posterior.particles[likely].T).T)
    return np.concatenate(proposals)
