"""Upsamplers that predict a point's distance to the surface; objective `grad-pu` trains them by it."""

from jaxtyping import Float
from torch import Tensor

from pcsr import Upsampler
from pcsr.tensors import Dense, Features, Points


class DistanceRegressor(Upsampler):
    """An upsampler with a learned distance function."""

    def distance(self, queries: Dense, points: Points, features: Features) -> Float[Tensor, "b rn"]:
        """Predicted distance of each query point to the surface, never below 0.

        Args:
            queries: (b rn 3).
            points: those that the features are of.
            features: (b n c).
        """
        raise NotImplementedError
