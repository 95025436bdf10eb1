"""Policy `uniform`: touches at random points of the surface."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float

from pcsr import Policy, TouchCandidates


class Uniform(Policy):
    """Keeps the order of the candidates, which is random."""

    uses_cloud: ClassVar[bool] = False

    def scores(
        self, candidates: TouchCandidates, cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]
    ) -> Float[np.ndarray, " p"]:
        """Return 0 for each candidate."""
        return np.zeros(len(candidates))
