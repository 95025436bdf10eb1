"""The feature extraction (FE) block of TAPSR, Sec. 3.2 and Fig. 2: a U-Net along the points.

"The feature extraction block is downsampled two times by the max-pooling layer and upsampled two times by the
deconvolution, and the skip connection is used at the same stage." One serves the cloud with mC channels, one
each touch with C; the paper found m = 4 best.

The paper pools along an axis whose order it never defines. Here the points are first sorted along a Hilbert
curve, so that a window of the axis is a neighbourhood (PAPER.md, "The order of points"). `order: file` is the
literal reading.
"""

from functools import partial
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Encoder, Trait, Widths
from pcsr.geometry.ordering import along, back, hilbert_order
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.options import HalvedChannels
from pcsr_plugins.layers.rectifier import NegativeSlope, rectifier


class UNet(Encoder):
    """Two max-pools down, two deconvolutions up, skips between stages of one size."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        channels: HalvedChannels = 128,
        order: Literal["hilbert", "file"] = "hilbert",
        norm: Literal["none", "layer"] = "none",
        negative_slope: NegativeSlope = 0.0,
    ) -> None:
        """Create the block.

        Args:
            widths: of the features, from the host.
            channels: of the result, and of the first stage.
            order: of the points along the axis: along their Hilbert curve, or as they are given.
            norm: of each layer but the last, before its ReLU: none, or a layer norm over the channels of each point.
            negative_slope: of the ReLUs. The paper's are 0.
        """
        super().__init__()
        self.channels = c = channels
        self.order = order
        if order == "file":
            self.traits = frozenset()
        conv, deconv = (partial(make, norm=norm, slope=negative_slope) for make in (_conv, _deconv))
        self.enter = nn.Sequential(conv(3, c // 2), conv(c // 2, c))
        self.down = nn.ModuleList([conv(c, c), conv(c, 2 * c)])
        self.up = nn.ModuleList([deconv(2 * c, c), deconv(c, c)])
        self.merge = nn.ModuleList([conv(2 * c, c), nn.Conv1d(2 * c, c, 1)])

    def forward(self, points: Points) -> Features:
        """Encode the points at three scales of the curve."""
        if self.order == "file":
            return self._encode(points)
        order = hilbert_order(points)
        return back(order, self._encode(along(order, points)))

    def _encode(self, points: Points) -> Features:
        n = points.shape[1]
        # Pooling twice by two wants a multiple of four: the last point is repeated, its copies cut off again.
        x = F.pad(points.transpose(1, 2), (0, -n % 4), mode="replicate")  # (b 3 n)
        stage0 = self.enter(x)  # (b c n)
        stage1 = self.down[0](F.max_pool1d(stage0, 2))  # (b c n/2)
        stage2 = self.down[1](F.max_pool1d(stage1, 2))  # (b 2c n/4)
        x = self.merge[0](torch.cat([self.up[0](stage2), stage1], 1))  # (b c n/2)
        x = self.merge[1](torch.cat([self.up[1](x), stage0], 1))  # (b c n)
        features: Tensor = x[..., :n].transpose(1, 2)  # (b n c)
        return features


def _conv(c_in: int, c_out: int, norm: str, slope: float) -> nn.Module:
    # Width 3, as in the U-Net that the paper takes its block from (Ronneberger et al., 2015).
    return _layer(nn.Conv1d(c_in, c_out, 3, padding=1, padding_mode="replicate"), c_out, norm, slope)


def _deconv(c_in: int, c_out: int, norm: str, slope: float) -> nn.Module:
    return _layer(nn.ConvTranspose1d(c_in, c_out, 2, stride=2), c_out, norm, slope)


def _layer(linear: nn.Module, channels: int, norm: str, slope: float) -> nn.Module:
    return nn.Sequential(linear, *([ChannelNorm(channels)] if norm == "layer" else []), rectifier(slope))


class ChannelNorm(nn.LayerNorm):
    """Layer norm over the channels of each point."""

    def forward(self, input: Tensor) -> Tensor:  # noqa: A002
        """Normalise (b c n)."""
        return super().forward(input.transpose(1, 2)).transpose(1, 2)
