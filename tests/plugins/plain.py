"""TAPSR's network as the papers state it, tensor by tensor: the twin of the fast one, with the same weights.

PU-Transformer, Sec. 3 (edge MLPs, SC-MSA); TAPSR, Algorithm 1 (the FF block).
"""

import copy

import torch
from torch import nn
from torch.nn import functional as F

from pcsr.geometry.ordering import along, back, hilbert_order
from pcsr_plugins.backbones.pu_transformer import EdgeMax, PUTransformer, ShiftedChannelAttention
from pcsr_plugins.fusions.iterative import Iterative
from pcsr_plugins.layers.pairing import pair
from pcsr_plugins.upsamplers.shuffle import Shuffle


def plain(network):
    """A copy of a network, or of a part of one, that computes the same without any short cut."""
    twin = copy.deepcopy(network)
    for module in twin.modules():
        module.__class__ = TWINS.get(type(module), type(module))
    return twin


def neighbours(points, k):
    """Of all distances the k least."""
    distance = torch.cdist(points, points, compute_mode="donot_use_mm_for_euclid_dist")
    return distance.topk(k, dim=-1, largest=False).indices


def edges(x, near):
    """[xᵢ, xⱼ − xᵢ], (b n k 2c)."""
    b, n, c = x.shape
    flat = (near + n * torch.arange(b, device=x.device).view(b, 1, 1)).flatten()
    centre = x.unsqueeze(2).expand(-1, -1, near.shape[-1], -1)
    return torch.cat([centre, x.reshape(b * n, c)[flat].view(centre.shape) - centre], dim=-1)


class PlainEdgeMax(EdgeMax):
    def forward(self, x, near):
        return F.relu(self.edge(edges(x, near))).max(2).values


class PlainAttention(ShiftedChannelAttention):
    def forward(self, x):
        starts = range(0, x.shape[-1] - self.width + 1, self.shift)
        q, k, v = (
            torch.stack([layer(x)[..., start : start + self.width] for start in starts], 1)
            for layer in (self.query, self.key, self.value)
        )
        messages = torch.softmax(q @ k.transpose(-1, -2), dim=-1) @ v  # (b heads n w)
        return self.out(messages.transpose(1, 2).flatten(2))


class PlainPUTransformer(PUTransformer):
    def forward(self, points, features):
        near = neighbours(points, self.neighbours)
        for encoder in self.encoders:
            features = encoder(points, features, near)
        return features


class PlainIterative(Iterative):
    def forward(self, points, features, touches):
        order = hilbert_order(points)
        fp, messages = along(order, features), pair(points, touches)
        f = fp
        for i in range(touches.mask.shape[1]):
            fm = self.mlp(torch.cat([along(order, messages[:, i]), f], dim=-1))
            if self.pool == "global":
                fm = fm.amax(1, keepdim=True).expand_as(fm)
            fused = self.deconv(torch.cat([fm, fp], dim=-1).transpose(1, 2)).transpose(1, 2)
            f = torch.where(touches.mask[:, i, None, None], fused, f)
        return back(order, f)


class PlainShuffle(Shuffle):
    """From `neighbours`, to a rate that is a multiple of 8: back from the positions of a fan, point by point."""

    def forward(self, points, features, rate):
        assert self.start == "neighbours"
        assert rate % 8 == 0
        b, n, _ = features.shape
        moves = self.mlp(features.reshape(b, n, rate, -1))
        offsets = edges(points, neighbours(points, 9)[..., 1:])[..., 3:]  # (b n 8 3)
        spacing = offsets.norm(dim=-1).mean(-1)[..., None, None]
        shares = [0.4 * (1 - ring * 8 / rate) for ring in range(rate // 8)]
        starts = points.unsqueeze(2) + torch.cat([share * offsets for share in shares], dim=2)
        return (starts + spacing * moves).flatten(1, 2)


TWINS: dict[type[nn.Module], type[nn.Module]] = {
    EdgeMax: PlainEdgeMax,
    ShiftedChannelAttention: PlainAttention,
    PUTransformer: PlainPUTransformer,
    Iterative: PlainIterative,
    Shuffle: PlainShuffle,
}
