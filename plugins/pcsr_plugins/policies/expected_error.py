"""Policy `expected-error`: touches that are expected to lower the error of the upsampled cloud most."""

import numpy as np
from jaxtyping import Float

from pcsr import Policy, TouchCandidates
from pcsr.exploration import Expectation


class ExpectedError(Policy):
    """Expects the contact of each candidate from the points of the cloud, and the error of the cloud in it."""

    def scores(
        self, candidates: TouchCandidates, cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]
    ) -> Float[np.ndarray, " p"]:
        """Return what each touch is expected to take off the Chamfer distance, in mm²."""
        expectation = _expectation(candidates, cloud, touched)
        return np.array([expectation.gain(contact) for contact in expectation.contacts(candidates)])

    def error(
        self, candidates: TouchCandidates, cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]
    ) -> float:
        """Return the expected Chamfer distance before the touch, in mm²."""
        return _expectation(candidates, cloud, touched).error()


def _expectation(
    candidates: TouchCandidates, cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]
) -> Expectation:
    surface = candidates.points if candidates.surface is None else candidates.surface
    return Expectation.of(surface, cloud, touched)
