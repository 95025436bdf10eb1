"""Networks in other people's styles, and others that show one thing each."""

from dataclasses import dataclass, field
from typing import Any

import torch
from torch import nn

from pcsr.contracts import Fusion
from pcsr.grafting import graft
from pcsr.plugins.loading import load_plugins

N = 24
PLUGINS = load_plugins()


class PUNetLike(nn.Module):
    """(b 3 n) through 2D convolutions, (b c n 1) in between, to (b 3 rn)."""

    def __init__(self):
        super().__init__()
        self.mlp1 = nn.Sequential(nn.Conv2d(3, 16, 1), nn.BatchNorm2d(16), nn.ReLU(inplace=True))
        self.mlp2 = nn.Sequential(nn.Conv2d(16, 32, 1), nn.ReLU(inplace=True))
        self.expand = nn.ModuleList([nn.Conv2d(32, 16, 1) for _ in range(4)])
        self.coordinates = nn.Sequential(nn.ReLU(inplace=True), nn.Conv2d(16, 3, 1))

    def forward(self, xyz, rate):
        features = self.mlp2(self.mlp1(xyz.unsqueeze(-1)))
        features = features.view(xyz.shape[0], -1).view(xyz.shape[0], 32, -1, 1)  # goes with contiguous ones only
        offsets = [self.coordinates(self.expand[i](features)).squeeze(-1) for i in range(rate)]
        return torch.cat([xyz + offset for offset in offsets], dim=2)


class TransformerLike(nn.Module):
    """(b n 3) through a transformer to a coarse and a fine cloud; it centres its input in place."""

    def __init__(self):
        super().__init__()
        self.embed = nn.Linear(3, 16)
        layer = nn.TransformerEncoderLayer(16, 2, 32, dropout=0.1, batch_first=True)
        self.body = nn.TransformerEncoder(layer, 2, enable_nested_tensor=False)
        self.coarse, self.fine = nn.Linear(16, 3), nn.Linear(16, 6)

    def forward(self, points):
        middle = points.mean(1, keepdim=True)
        points -= middle
        features = self.body(self.embed(points))
        coarse = points + self.coarse(features)
        fine = coarse.repeat_interleave(2, 1) + self.fine(features).view(points.shape[0], -1, 3)
        return coarse + middle, fine + middle


class EdgeConvLike(nn.Module):
    """Keywords only, neighbours by distance, 1D convolutions, (b c n) in between, to a dictionary."""

    def __init__(self):
        super().__init__()
        self.edge = nn.Conv2d(6, 16, 1)
        self.point = nn.Conv1d(16, 24, 1)
        self.head = nn.Conv1d(24, 6, 1)

    def forward(self, *, cloud, k=4, flag=False):
        b, n, _ = cloud.shape
        near = torch.cdist(cloud, cloud).topk(k, largest=False).indices
        neighbours = cloud.gather(1, near.flatten(1)[..., None].expand(-1, -1, 3)).view(b, n, k, 3)
        edges = torch.cat([neighbours - cloud[:, :, None], cloud[:, :, None].expand(-1, -1, k, -1)], -1)
        features = self.edge(edges.permute(0, 3, 1, 2)).amax(-1)
        offsets = self.head(self.point(features).relu()).view(b, 2, 3, n)
        return {"dense": (cloud.transpose(1, 2)[:, None] + offsets).permute(0, 3, 1, 2).flatten(1, 2), "flag": flag}


@dataclass
class Case:
    network: type[nn.Module]
    at: str
    layout: str
    width: int
    call: Any
    options: dict[str, Any] = field(default_factory=dict)

    def make(self, seed=0):
        torch.manual_seed(seed)
        return self.network().eval()

    def graft(self, network=None, **options):
        return graft(network or self.make(), self.at, **({"registry": PLUGINS} | self.options | options))


CASES = {
    "pu-net": Case(
        PUNetLike,
        "mlp2",
        "bcn1",
        32,
        lambda net, x, **touch: net(x.transpose(1, 2), 4, **touch).transpose(1, 2),
        {"probe": (1, 3, 32), "arguments": (4,)},
    ),
    "transformer": Case(
        TransformerLike, "body", "bnc", 16, lambda net, x, **touch: net(x.clone(), **touch)[1], {"probe": (1, 32, 3)}
    ),
    "edge-conv": Case(
        EdgeConvLike,
        "point",
        "bcn",
        24,
        lambda net, x, **touch: net(cloud=x, flag=True, **touch)["dense"],
        {"probe": (1, 32, 3), "points": "cloud", "keywords": {"k": 4}},
    ),
}


class Meeting(nn.Module):
    """Waits behind its entrance until another thread is there too."""

    def __init__(self, barrier):
        super().__init__()
        self.barrier, self.layer, self.head = barrier, nn.Linear(3, 8), nn.Linear(8, 3)

    def forward(self, points):
        if self.barrier is not None:
            self.barrier.wait(10)
        features = self.layer(points)
        if self.barrier is not None:
            self.barrier.wait(10)
        return self.head(features)


class Second(Meeting):
    def __init__(self):
        super().__init__(None)

    def forward(self, factor, points):
        return factor * super().forward(points)


class Layers(nn.Module):
    """One layer for each thing that a layer can give."""

    def __init__(self):
        super().__init__()
        self.lift, self.again, self.never = nn.Linear(3, 8), nn.Linear(8, 8), nn.Linear(8, 8)
        self.sampled, self.pooled, self.square, self.flat = (nn.Identity() for _ in range(4))
        self.edges, self.growing, self.merged, self.frozen = *(nn.Identity() for _ in range(3)), nn.Linear(8, 8)
        self.pair = nn.GRU(8, 8, batch_first=True)
        self.inner = nn.ModuleDict({"lift": nn.Linear(8, 8)})

    def forward(self, points, skip=False, fail=False):
        x = self.lift(points)
        x = self.again(self.again(self.again(x)))
        self.sampled(x[:, ::2]), self.pooled(x.amax(1)), self.square(x @ x.transpose(1, 2)), self.flat(x.flatten(0, 1))
        self.edges(x.transpose(1, 2)[..., None].expand(-1, -1, -1, 4)), self.growing(x.repeat(1, 1, x.shape[1]))
        self.pair(x), self.merged(x.flatten(0, 1)[None])
        with torch.no_grad():
            x = x + self.frozen(x)
        if fail:
            raise ValueError("a slip\nof theirs")
        return x if skip else self.inner["lift"](x)


class Bias(Fusion):
    """A fusion without weights: adds the mean of the touched coordinates to every channel."""

    def __init__(self, widths, times=1):
        super().__init__()
        self.times = times

    def forward(self, points, features, touches):
        return features.repeat(1, 1, self.times) + touches.flat_points.mean((1, 2), keepdim=True)


def same(first, second):
    return all(torch.equal(a, b) for a, b in zip(first, second, strict=True))
