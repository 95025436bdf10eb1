"""Policy `spread`: touches far from earlier touches."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float

from pcsr import Policy, TouchCandidates
from pcsr.exploration import mean_distances


class Spread(Policy):
    """Chooses the candidate farthest from all touched points; before the first touch, a random one."""

    uses_cloud: ClassVar[bool] = False

    def scores(
        self, candidates: TouchCandidates, cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]
    ) -> Float[np.ndarray, " p"]:
        """Return the distance of each candidate to the nearest touched point, in mm."""
        return mean_distances(candidates.points, touched, 1)
