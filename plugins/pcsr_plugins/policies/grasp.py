"""Policy `grasp`: grasps at random points of the surface (Smith et al., 2020)."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float

from pcsr import Policy, TouchCandidates


class Grasp(Policy):
    """Keeps the order of the candidates, which is random; each touch is a grasp by a thumb and opposing fingers."""

    grasps: ClassVar[bool] = True
    uses_cloud: ClassVar[bool] = False

    def scores(
        self, candidates: TouchCandidates, cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]
    ) -> Float[np.ndarray, " p"]:
        """Return 0 for each candidate."""
        return np.zeros(len(candidates))
