"""An upsampler as research code has them: channels first, batch normalisation, a namespace of settings, and a loss
beside the cloud. It knows nothing of pcsr.

In the style of RepKPU (Rong et al., CVPR 2024): attention over neighbours, then learned displacements of kernel points.
"""

from types import SimpleNamespace

import torch
from torch import nn


def neighbours(points, k):
    """Indices (b n k) of the nearest points of (b 3 n)."""
    moved = points.transpose(1, 2)
    return torch.cdist(moved, moved).topk(k, largest=False).indices


def gathered(features, index):
    """Features (b c n k) of neighbours, from (b c n) and (b n k)."""
    b, n, k = index.shape
    return features.gather(2, index.reshape(b, 1, n * k).expand(-1, features.shape[1], -1)).view(b, -1, n, k)


class NeighbourAttention(nn.Module):
    def __init__(self, dim, k):
        super().__init__()
        self.k = k
        self.query, self.key, self.value = (nn.Conv1d(dim, dim, 1) for _ in range(3))
        self.position = nn.Sequential(nn.Conv2d(3, dim, 1), nn.BatchNorm2d(dim), nn.ReLU(inplace=True))
        self.weigh = nn.Sequential(nn.Conv2d(dim, dim, 1), nn.BatchNorm2d(dim), nn.ReLU(inplace=True))
        self.out = nn.Sequential(nn.Conv1d(dim, dim, 1), nn.BatchNorm1d(dim))

    def forward(self, points, features):
        index = neighbours(points, self.k)
        position = self.position(gathered(points, index) - points.unsqueeze(-1))
        scores = self.weigh(self.query(features).unsqueeze(-1) - gathered(self.key(features), index) + position)
        values = gathered(self.value(features), index) + position
        return features + self.out((scores.softmax(-1) * values).sum(-1))


class Encoder(nn.Module):
    def __init__(self, cfg):
        super().__init__()
        self.stem = nn.Sequential(nn.Conv1d(3, cfg.dim, 1), nn.BatchNorm1d(cfg.dim), nn.ReLU(inplace=True))
        self.blocks = nn.ModuleList([NeighbourAttention(cfg.dim, cfg.k) for _ in range(cfg.blocks)])
        self.fuse = nn.Sequential(nn.Conv1d(2 * cfg.dim, cfg.out_dim, 1), nn.BatchNorm1d(cfg.out_dim), nn.ReLU())

    def forward(self, points):
        features = self.stem(points)
        for block in self.blocks:
            features = block(points, features)
        overall = features.amax(2, keepdim=True).expand_as(features)
        return self.fuse(torch.cat([features, overall], 1))


class Decoder(nn.Module):
    def __init__(self, cfg):
        super().__init__()
        self.rate = cfg.up_rate
        self.kernel = nn.Parameter(torch.randn(1, 3, 1, cfg.up_rate) / 2, requires_grad=False)
        self.spread = nn.Conv2d(cfg.out_dim + 3, cfg.dim, 1)
        self.offset = nn.Sequential(nn.ReLU(inplace=True), nn.Conv2d(cfg.dim, 3, 1))

    def forward(self, points, features):
        b, _, n = points.shape
        kernel = self.kernel.expand(b, -1, n, -1)
        copies = features.unsqueeze(-1).expand(-1, -1, -1, self.rate)
        offset = 0.1 * torch.tanh(self.offset(self.spread(torch.cat([copies, kernel], 1))))
        return (points.unsqueeze(-1) + offset).flatten(2), offset.square().mean()


class KernelUpsampler(nn.Module):
    """Points (b 3 n) to points (b 3 rn) and a regularisation loss."""

    def __init__(self, cfg):
        super().__init__()
        self.encoder = Encoder(cfg)
        self.decoder = Decoder(cfg)

    def forward(self, points):
        return self.decoder(points, self.encoder(points))


def network(up_rate=4, dim=32) -> nn.Module:
    """The network with its settings, which a recipe cannot write as a namespace."""
    return KernelUpsampler(SimpleNamespace(up_rate=up_rate, dim=dim, out_dim=2 * dim, k=8, blocks=2))
