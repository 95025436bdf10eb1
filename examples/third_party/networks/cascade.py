"""An upsampler in three stages, as research code has them: the stages are supervised in training, so that the outputs
in training and at inference differ. It knows nothing of pcsr.

In the style of PU-CRN (Du et al., ACCV 2022): each stage refines the cloud of the stage before it.
"""

import torch
from torch import nn


class Features(nn.Module):
    def __init__(self, channels, k):
        super().__init__()
        self.k = k
        self.point = nn.Sequential(nn.Conv1d(3, channels, 1), nn.BatchNorm1d(channels), nn.ReLU())
        self.edge = nn.Sequential(nn.Conv2d(channels + 3, channels, 1), nn.BatchNorm2d(channels), nn.ReLU())

    def forward(self, points):
        features = self.point(points)
        b, c, n = features.shape
        moved = points.transpose(1, 2)
        near = torch.cdist(moved, moved).topk(self.k, largest=False).indices.reshape(b, 1, -1)
        both = torch.cat([features, points], 1)
        around = both.gather(2, near.expand(-1, c + 3, -1)).view(b, c + 3, n, self.k)
        offsets = around[:, c:] - points.unsqueeze(-1)
        return features + self.edge(torch.cat([around[:, :c], offsets], 1)).amax(-1)


class Stage(nn.Module):
    """Points (b 3 n) to points (b 3 rn)."""

    def __init__(self, rate, channels, k):
        super().__init__()
        self.features = Features(channels, k)
        self.expand = nn.ConvTranspose1d(channels, channels, rate, rate, bias=False)
        self.copies = nn.Upsample(scale_factor=rate)
        self.regress = nn.Sequential(nn.Conv1d(channels, channels, 1), nn.ReLU(), nn.Conv1d(channels, 3, 1))

    def forward(self, points):
        features = torch.relu(self.expand(self.features(points)))
        return self.copies(points) + 0.1 * torch.tanh(self.regress(features))


class Cascade(nn.Module):
    """Points (b 3 n) to points (b rn 3)."""

    def __init__(self, rate=4, channels=32, k=8):
        super().__init__()
        step = int(rate**0.5)
        self.first, self.second = Stage(step, channels, k), Stage(step, channels, k)
        self.refine = Stage(1, channels, k)

    def forward(self, points, truth=None):
        one = self.first(points.float().contiguous())
        two = self.second(one)
        three = self.refine(two)
        clouds = [cloud.transpose(1, 2).contiguous() for cloud in (one, two, three)]
        return (clouds, truth) if self.training else clouds[-1]
