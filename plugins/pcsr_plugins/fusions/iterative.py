"""The feature fusion (FF) block of TAPSR: Sec. 3.3, Fig. 3, Algorithm 1.

For each touch i = 1…α, with f₁ = fp::

    Fm      = MLP[Concat(ftᵢ, fᵢ)]
    fᵢ₊₁    = Deconv[Concat(Fm, fp)]

One block, applied again for each touch: "the number of input and output channels of the module is set to a
fixed value … we can easily connect multiple fusion modules by cascading." Sec. 3.3 also says "a common
approach is to apply MLPs followed by max-pooling", which the equations don't; `pool: global` does it
(PAPER.md, "The FF block").

The paper does not say which touched point the i-th visual point is concatenated with. `pairing: hilbert` takes the i-th
along the Hilbert curves of both, `pairing: nearest` the nearest in space. `offsets: true` adds the vector from the
visual to the touched point to ft. Both are our own, for the study `fusions/study`.
"""

from typing import Literal

import torch
from torch import nn
from torch.nn import functional as F

from pcsr import Fusion, TouchBatch, Trait, Widths
from pcsr.geometry.ordering import along, back, hilbert_order
from pcsr.tensors import Features, Points, TouchFeatures
from pcsr_plugins.layers.pairing import hilbert_pairs, nearest_pairs, taken
from pcsr_plugins.layers.rectifier import NegativeSlope, rectifier


class Iterative(Fusion):
    """Fuses one touch after the other with the features, each time together with the purely visual ones."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        pool: Literal["none", "global"] = "none",
        pairing: Literal["hilbert", "nearest"] = "hilbert",
        offsets: bool = False,
        negative_slope: NegativeSlope = 0.0,
    ) -> None:
        """Create the block.

        Args:
            widths: of the features, from the host.
            pool: whether Fm is replaced by its maximum over all points.
            pairing: which point of a touch a visual point is concatenated with: along the Hilbert curves of both
                clouds, or the nearest in space.
            offsets: whether the vector from the visual point to the touched one is concatenated too.
            negative_slope: of the MLP's ReLU. The paper's is 0.
        """
        super().__init__()
        self.pool, self.pairing, self.offsets = pool, pairing, offsets
        self.touch_channels = widths.touch + 3 * offsets
        linear = nn.Linear(self.touch_channels + widths.visual, widths.visual)
        self.mlp = nn.Sequential(linear, rectifier(negative_slope))
        # A deconvolution that keeps the number of points: width 3 along the curve, stride 1.
        self.deconv = nn.ConvTranspose1d(2 * widths.visual, widths.visual, 3, padding=1)

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        """Algorithm 1; a row of the batch skips the touches that it lacks.

        Both layers are linear in what is concatenated, so each is applied to the two parts: what the MLP makes of
        the touches, and the deconvolution of fp, is the same in every round or needs no round before it.
        """
        (linear, rectified), deconv = self.mlp, self.deconv
        assert isinstance(linear, nn.Linear)
        of_touch, of_fused = torch.split(linear.weight, [self.touch_channels, features.shape[-1]], dim=1)
        of_mixed, of_visual = deconv.weight.chunk(2)
        order = hilbert_order(points)
        fp = along(order, features)
        messages = F.linear(self._paired(along(order, points), touches), of_touch, linear.bias)  # (b a n c)
        visual = F.conv_transpose1d(fp.transpose(1, 2), of_visual, deconv.bias, padding=1)  # (b c n)
        f = fp
        for i in range(touches.mask.shape[1]):
            fm = rectified(messages[:, i] + F.linear(f, of_fused))  # (b n c)
            if self.pool == "global":
                fm = fm.amax(1, keepdim=True).expand_as(fm)
            fused = visual + F.conv_transpose1d(fm.transpose(1, 2), of_mixed, padding=1)
            f = torch.where(touches.mask[:, i, None, None], fused.transpose(1, 2), f)
        return back(order, f)

    def _paired(self, points: Points, touches: TouchBatch) -> TouchFeatures:
        """For each visual point, in the order of the curve, what is concatenated of each touch: (b a n c)."""
        nearest = self.pairing == "nearest"
        index = nearest_pairs(points, touches) if nearest else hilbert_pairs(touches, points.shape[1])
        features = taken(touches.features, index)
        if not self.offsets:
            return features
        offsets = taken(touches.points, index) - points.unsqueeze(1)
        # The points of a missing touch may be far off, or not finite.
        return torch.cat([features, offsets.masked_fill(~touches.mask[:, :, None, None], 0.0)], dim=-1)
