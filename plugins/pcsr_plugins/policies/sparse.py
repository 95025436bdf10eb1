"""Policy `sparse`: touches where the cloud is sparse."""

from typing import Annotated

import numpy as np
from jaxtyping import Float
from pydantic import Field

from pcsr import Policy, TouchCandidates
from pcsr.exploration import mean_distances


class Sparse(Policy):
    """Chooses the candidate around which points of the cloud and touched points are sparsest."""

    def __init__(self, *, neighbours: Annotated[int, Field(ge=1, le=1000)] = 4) -> None:
        """Create the policy.

        Args:
            neighbours: number of nearest known points whose mean distance is the sparsity of a candidate.
        """
        self.neighbours = neighbours

    def scores(
        self, candidates: TouchCandidates, cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]
    ) -> Float[np.ndarray, " p"]:
        """Return the mean distance of each candidate to the nearest known points, in mm."""
        return mean_distances(candidates.points, np.concatenate([cloud, touched]), self.neighbours)
