"""Names of tensor types with their shapes; channels come last.

Axes: b clouds of a batch, n points of a cloud, a touches, m points of a touch, c channels, k neighbours.

The names are type annotations and are not checked at run time. The tests check them with jaxtyping: axes with the same
letter within one call must have the same length.
"""

from jaxtyping import Bool, Float, Int
from torch import Tensor

Points = Float[Tensor, "b n 3"]
Features = Float[Tensor, "b n c"]
Dense = Float[Tensor, "b rn 3"]

TouchPoints = Float[Tensor, "b a m 3"]
TouchFeatures = Float[Tensor, "b a m c"]
TouchMask = Bool[Tensor, "b a"]

Neighbours = Int[Tensor, "b n k"]
