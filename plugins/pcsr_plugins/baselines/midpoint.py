"""Baseline `midpoint`: interpolation by midpoints between neighbours.

He et al., "Grad-PU: Arbitrary-Scale Point Cloud Upsampling via Gradient Descent with Learned Distance Functions",
CVPR 2023, Sec. 3.2.
"""

import numpy as np
from jaxtyping import Float

from pcsr import Baseline
from pcsr.geometry.interpolation import midpoint
from pcsr.tensors import Mesh

TWICE = 16
"""Least rate that is reached in two passes, each at its square root: far more exact than one pass."""


class Midpoint(Baseline):
    """Midpoints between neighbours, thinned to farthest points."""

    def upsample(
        self, points: Float[np.ndarray, "n 3"], rate: int, mesh: Mesh | None, rng: np.random.Generator
    ) -> Float[np.ndarray, "rn 3"]:
        """Interpolate."""
        return midpoint(points, rate, passes=2 if rate >= TWICE else 1)
