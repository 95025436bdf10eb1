"""The 2-D grid that distinguishes a point's copies, as in FoldingNet: PU-GAN and Dis-PU add it to their features.

Li et al., "PU-GAN: a Point Cloud Upsampling Adversarial Network", ICCV 2019, Sec. 3.2; the extent of 0.2 is its code's.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

EXTENT = 0.2
"""The grid reaches from minus to plus this."""


def grid(count: int) -> Float[Tensor, "count 2"]:
    """`count` grid points in rows and columns, as close to a square as its divisors allow: 3 by 2 for 6.

    A single row or column lies at −EXTENT.
    """
    columns = next(divisor for divisor in range(math.isqrt(count) + 1, 0, -1) if count % divisor == 0)
    sides = (torch.linspace(-EXTENT, EXTENT, side) for side in (columns, count // columns))
    return torch.cartesian_prod(*sides)
