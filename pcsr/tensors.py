"""The shape vocabulary. Channels come last; b batch, n points, a touches, m points a touch, c channels.

The names cost nothing at run time. The tests switch on jaxtyping's checks, where every axis that carries the
same letter within one call must have the same length.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from torch import Tensor

Points = Float[Tensor, "b n 3"]
Features = Float[Tensor, "b n c"]
Dense = Float[Tensor, "b rn 3"]

TouchPoints = Float[Tensor, "b a m 3"]
TouchFeatures = Float[Tensor, "b a m c"]
TouchMask = Bool[Tensor, "b a"]

Neighbours = Int[Tensor, "b n k"]

Mesh = tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]
