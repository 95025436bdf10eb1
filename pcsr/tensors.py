"""Names of tensor types with their shapes; channels come last.

Axes: b clouds of a batch, n points of a cloud, a touches, m points of a touch, c channels, k neighbours.

The names are type annotations and are not checked at run time. The tests check them with jaxtyping: axes with the same
letter within one call must have the same length.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from torch import Tensor

__all__ = [
    "CloudArray",
    "Dense",
    "Features",
    "Mesh",
    "Neighbours",
    "Points",
    "TouchFeatures",
    "TouchMask",
    "TouchPoints",
]

CloudArray = Float[np.ndarray, "_ 3"]
"""One cloud in numpy, of any number of points."""
Mesh = tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]
"""Vertices and faces of a triangle mesh."""

Points = Float[Tensor, "b n 3"]
"""Coordinates of a batch of clouds."""
Features = Float[Tensor, "b n c"]
"""Features of each point."""
Dense = Float[Tensor, "b rn 3"]
"""Coordinates of a batch of upsampled clouds, r points for each input point."""

TouchPoints = Float[Tensor, "b a m 3"]
"""Coordinates of the touched points."""
TouchFeatures = Float[Tensor, "b a m c"]
"""Features of each touched point."""
TouchMask = Bool[Tensor, "b a"]
"""Mask of touches: False for padding, since clouds of a batch may have different numbers of touches."""

Neighbours = Int[Tensor, "b n k"]
"""Indices of the k neighbours of each point."""
