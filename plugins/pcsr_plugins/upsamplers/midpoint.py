"""An interpolated cloud, refined: the places come from midpoints between neighbours, the network only moves them.

The interpolation is Grad-PU's (He et al., "Grad-PU: Arbitrary-Scale Point Cloud Upsampling via Gradient Descent with
Learned Distance Functions", CVPR 2023, Sec. 3.2), which separates it from what is learned and so takes any rate. Here
an MLP predicts how far to move, from the features of the nearest points. Before training it moves nothing: the
network *is* the interpolation.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pcsr import Trait, Upsampler, UserError, Widths
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.interpolation import Thin, midpoint
from pcsr.geometry.neighbours import gather, knn
from pcsr.geometry.ordering import along, hilbert_order
from pcsr.geometry.sampling import poisson_subset
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.interpolate import inverse_distance, mix
from pcsr_plugins.layers.options import Channels

SPACED = 8
"""Neighbours whose mean distance is the spacing of the points."""
LEAST = 1e-6
"""The least spacing, where points coincide; the cloud's radius is 1."""
TWICE = 16
"""From this rate on, interpolating by its root twice is far better than once."""


class Midpoint(Upsampler):
    """Moves interpolated places, in units of the spacing of the points around them."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.ANY_RATE})

    def __init__(self, widths: Widths, *, hidden: Channels = 64) -> None:
        super().__init__()
        self.carried = nn.Linear(widths.refined, hidden)
        self.placed = nn.Linear(4, hidden, bias=False)
        last = nn.Linear(hidden, 3)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        self.mlp = nn.Sequential(nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(), last)

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Interpolate and refine.

        The MLP reads the features carried to a place, its way from the points that they are of, and its distance to
        the nearest of them. That has no direction: a midpoint is as near to one end as to the other. The first
        layer's part for the features is applied before they are carried: there are fewer points than places.
        """
        # Among points that are equally near the first in this order counts, not the first in the file.
        order = hilbert_order(points)
        points, features = along(order, points), along(order, features)
        places = interpolated(points, rate, thin=evenly if self.training else farthest_points)
        near, weights = inverse_distance(places, points)
        unit = mix(spacing(points), near, weights)
        way = places - mix(points, near, weights)
        nearest = (places - gather(points, near[..., :1]).squeeze(2)).norm(dim=-1, keepdim=True)
        placed = self.placed(torch.cat([way, nearest], dim=-1) / unit)
        dense: Dense = places + unit * self.mlp(mix(self.carried(features), near, weights) + placed)
        return dense


def interpolated(points: Points, rate: int, thin: Thin = farthest_points) -> Dense:
    """Midpoints of each cloud of a batch, as evaluation sets them beside the network. They have no gradient.

    Raises:
        UserError: a graph is to be exported, or a cloud has too few points for the rate.
    """
    if torch.compiler.is_exporting():
        raise UserError(
            "upsampler 'midpoint' interpolates by trees and farthest points, which no graph knows: export a network "
            "with another upsampler, such as 'shuffle'"
        )
    passes = 2 if rate >= TWICE else 1
    with ThreadPoolExecutor(torch.get_num_threads()) as pool:
        clouds = pool.map(
            lambda cloud: torch.from_numpy(midpoint(cloud.double().numpy(), rate, passes, thin)), points.detach().cpu()
        )
        return torch.stack(list(clouds)).to(points)


def evenly(points: Float[np.ndarray, "n 3"], count: int) -> Int[np.ndarray, " count"]:
    """Blue noise instead of farthest points, for training: nearly as even, in a sixth of the time.

    Of 8 clouds of 512, 16 times as many, farthest points take more than half as long as all else in a step of training.
    """
    return poisson_subset(points, count, np.random.default_rng(0))


def spacing(points: Points) -> Float[Tensor, "b n 1"]:
    """Mean distance of each point to its nearest neighbours; `LEAST` where they coincide."""
    k = min(SPACED, points.shape[1] - 1)
    ways = gather(points, knn(points, points, k + 1)[..., 1:]) - points.unsqueeze(2)
    spaced: Tensor = ways.norm(dim=-1).mean(-1, keepdim=True)
    return spaced.clamp_min(LEAST)
