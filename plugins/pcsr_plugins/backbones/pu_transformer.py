"""The cascaded transformer encoder of PU-Transformer, which TAPSR keeps (TAPSR, Sec. 3.4).

Qiu et al., "PU-Transformer: Point Cloud Upsampling Transformer", ACCV 2022, Sec. 3. Each encoder computes::

    G  = PosFusion(P, F)                  positional fusion
    G' = G + SC-MSA(Norm(G))              shifted-channel multi-head self-attention
    F' = G' + MLP(Norm(G'))

Norm is LayerNorm throughout: a batch norm would tie the points of one object to those of another.
"""

from typing import Annotated

import torch
from jaxtyping import Float
from pydantic import Field
from torch import nn
from torch.nn import functional as F

from pcsr import Backbone, Trait, UserError, Widths
from pcsr.geometry.neighbours import knn, neighbour_max
from pcsr.tensors import Features, Neighbours, Points
from pcsr_plugins.layers.options import HalvedCascade, NeighbourCount
from pcsr_plugins.layers.rectifier import NegativeSlope, rectifier

Refined = Float[torch.Tensor, "b n refined"]


class PUTransformer(Backbone):
    """Five encoders in a row; each sees the raw coordinates again."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        channels: HalvedCascade = (32, 64, 128, 256, 256),
        neighbours: NeighbourCount = 20,
        windows: Annotated[int, Field(ge=1, le=64)] = 4,
        negative_slope: NegativeSlope = 0.0,
    ) -> None:
        """Create the encoders.

        Args:
            widths: of the features, from the host.
            channels: of each encoder's result.
            neighbours: of each point in the positional fusion, itself among them.
            windows: of channels in the attention, without those between two of them.
            negative_slope: of the ReLUs. Their channels can be 0 at every point, since the positional fusion has no
                norm; with a slope above 0 they cannot.

        Raises:
            UserError: a layer has too few channels for the windows.
        """
        super().__init__()
        if min(channels) < 2 * windows:
            raise UserError(
                f"backbone 'pu-transformer' cuts {windows} windows of two channels or more out of each layer, and "
                f"one of them has {min(channels)} channels: take {min(channels) // 2} windows or fewer, or wider layers"
            )
        self.channels = channels[-1]
        self.neighbours = neighbours
        wide = (widths.visual, *channels)
        self.encoders = nn.ModuleList(
            TransformerEncoder(c_in, c_out, windows, negative_slope)
            for c_in, c_out in zip(wide, channels, strict=False)
        )

    def forward(self, points: Points, features: Features) -> Refined:
        """Refine the features; the neighbour graph is that of the coordinates, built once for all encoders."""
        index = knn(points, points, self.neighbours)
        for encoder in self.encoders:
            features = encoder(points, features, index)
        return features


class TransformerEncoder(nn.Module):
    """One encoder of the cascade."""

    def __init__(self, c_in: int, c_out: int, windows: int, negative_slope: float) -> None:
        super().__init__()
        self.position = PositionalFusion(c_in, c_out, negative_slope)
        self.norm_attention = nn.LayerNorm(c_out)
        self.attention = ShiftedChannelAttention(c_out, windows)
        self.norm_mlp = nn.LayerNorm(c_out)
        self.mlp = nn.Sequential(nn.Linear(c_out, c_out), rectifier(negative_slope))

    def forward(self, points: Points, features: Features, index: Neighbours) -> Refined:
        """The three lines of the module's docstring."""
        g = self.position(points, features, index)
        g = g + self.attention(self.norm_attention(g))
        refined: Refined = g + self.mlp(self.norm_mlp(g))
        return refined


class PositionalFusion(nn.Module):
    """Coordinates and features of each point's neighbourhood, half the channels each, maximum over neighbours."""

    def __init__(self, c_in: int, c_out: int, negative_slope: float) -> None:
        super().__init__()
        self.geometry = EdgeMax(3, c_out // 2, negative_slope)
        self.features = EdgeMax(c_in, c_out - c_out // 2, negative_slope)

    def forward(self, points: Points, features: Features, index: Neighbours) -> Refined:
        """Concatenate both halves."""
        return torch.cat([self.geometry(points, index), self.features(features, index)], dim=-1)


class EdgeMax(nn.Module):
    """max over j of ReLU(W·[xᵢ, xⱼ − xᵢ] + b), a one-layer edge MLP and the maximum over neighbours.

    W splits into U for xᵢ and V for the difference. ReLU grows, leaky or not, and only V·xⱼ depends on j, so the
    maximum moves inside: ReLU((U − V)·xᵢ + b + max over j of V·xⱼ). The edge tensor (b n k 2c) is never stored.
    """

    def __init__(self, c_in: int, c_out: int, negative_slope: float = 0.0) -> None:
        super().__init__()
        self.edge = nn.Linear(2 * c_in, c_out)
        self.rectified = rectifier(negative_slope)

    def forward(self, x: Features, index: Neighbours) -> Refined:
        """Features of the edges' maximum."""
        u, v = self.edge.weight.chunk(2, dim=1)
        refined: Refined = self.rectified(F.linear(x, u - v, self.edge.bias) + neighbour_max(F.linear(x, v), index))
        return refined


class ShiftedChannelAttention(nn.Module):
    """SC-MSA: heads are overlapping windows of channels, so that neighbouring heads share half their channels.

    Of `c` channels, a window is w = c / windows wide and the next begins d = w / 2 further: 2·windows − 1
    heads. The logits are not scaled, as in the paper's Algorithm 1.
    """

    def __init__(self, channels: int, windows: int) -> None:
        super().__init__()
        self.width = channels // windows
        self.shift = self.width // 2
        heads = (channels - self.width) // self.shift + 1
        self.query = nn.Linear(channels, channels)
        self.key = nn.Linear(channels, channels)
        self.value = nn.Linear(channels, channels)
        self.out = nn.Linear(heads * self.width, channels)

    def forward(self, x: Features) -> Features:
        """Attention of all points to all points."""
        q, k, v = (self._heads(layer(x)) for layer in (self.query, self.key, self.value))  # (b heads n w)
        attended = F.scaled_dot_product_attention(q, k, v, scale=1.0)
        mixed: Features = self.out(attended.transpose(1, 2).flatten(2))
        return mixed

    def _heads(self, x: Features) -> torch.Tensor:
        return x.unfold(-1, self.width, self.shift).transpose(1, 2)
