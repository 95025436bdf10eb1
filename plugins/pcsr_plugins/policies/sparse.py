"""Policy `sparse`: touches where the cloud is sparse."""

import numpy as np
from jaxtyping import Float

from pcsr import Policy, TouchCandidates
from pcsr.exploration import mean_distances

NEIGHBOURS = 4
"""Number of nearest known points whose mean distance is a candidate's sparsity."""


class Sparse(Policy):
    """Chooses the candidate around which points of the cloud and touched points are sparsest."""

    def scores(
        self, candidates: TouchCandidates, cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]
    ) -> Float[np.ndarray, " p"]:
        """Return the mean distance of each candidate to the nearest known points, in mm."""
        return mean_distances(candidates.points, np.concatenate([cloud, touched]), NEIGHBOURS)
