"""The feature fusion (FF) block of TAPSR: Sec. 3.3, Fig. 3, Algorithm 1.

For each touch i = 1…α, with f₁ = fp::

    Fm      = MLP[Concat(ftᵢ, fᵢ)]
    fᵢ₊₁    = Deconv[Concat(Fm, fp)]

One block, applied again for each touch: "the number of input and output channels of the module is set to a
fixed value … we can easily connect multiple fusion modules by cascading." Sec. 3.3 also says "a common
approach is to apply MLPs followed by max-pooling", which the equations don't; `pool: global` does it
(PAPER.md, "The FF block").
"""

from typing import Literal

import torch
from jaxtyping import Float
from torch import nn

from pcsr import Fusion, Touches, Trait, Widths
from pcsr.geometry.ordering import along, back, hilbert_order
from pcsr.tensors import Features, Points
from pcsr_plugins.fusions.pairing import pair


class Iterative(Fusion):
    """Folds one touch after the other into the features, always reminded of the purely visual ones."""

    traits = frozenset({Trait.POINT_ORDER_FREE})

    def __init__(self, widths: Widths, *, pool: Literal["none", "global"] = "none") -> None:
        super().__init__()
        self.pool = pool
        self.mlp = nn.Sequential(nn.Linear(widths.touch + widths.visual, widths.visual), nn.ReLU())
        # A deconvolution that keeps the number of points: width 3 along the curve, stride 1.
        self.deconv = nn.ConvTranspose1d(2 * widths.visual, widths.visual, 3, padding=1)

    def forward(self, points: Points, features: Features, touches: Touches) -> Features:
        """Algorithm 1; a row of the batch skips the touches that it lacks."""
        order = hilbert_order(points)
        fp = along(order, features)
        heard = pair(points, touches)  # (b a n ct)
        f = fp
        for i in range(touches.mask.shape[1]):
            fused = self.fuse(fp, along(order, heard[:, i]), f)
            f = torch.where(touches.mask[:, i, None, None], fused, f)
        return back(order, f)

    def fuse(self, fp: Features, ft: Float[torch.Tensor, "b n ct"], f: Features) -> Features:
        """FeaFus, the body of Algorithm 1's loop; points in the curve's order."""
        fm = self.mlp(torch.cat([ft, f], dim=-1))  # (b n c)
        if self.pool == "global":
            fm = fm.amax(1, keepdim=True).expand_as(fm)
        x = torch.cat([fm, fp], dim=-1).transpose(1, 2)  # (b 2c n)
        fused: Features = self.deconv(x).transpose(1, 2)
        return fused
