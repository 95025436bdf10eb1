"""PU-GAN's objective: fidelity, uniformity, repulsion and a discriminator that learns along.

Li et al., "PU-GAN: a Point Cloud Upsampling Adversarial Network", ICCV 2019, Sec. 3.3 and 3.4; weights and details as
in its code::

    generator      100·EMD + 10·uniform + 1·repulsion + ½·(D(Q) − 1)²
    discriminator  (D(P) − 1)² + D(Q)²,  at a tenth of the generator's learning rate

Where this differs on purpose: generator and discriminator take one step each, of one optimizer, while the original
takes two steps of the generator for each of the discriminator, and its code, other than the paper, leaves the
adversarial term out of what the generator minimises. The matching is exact instead of approximate, and there is no
decay of the weights (1e-5).
"""

import math
from typing import ClassVar

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pcsr import Objective
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Points
from pcsr_plugins.layers.options import Weight
from pcsr_plugins.layers.point_losses import hinge_repulsion, matched_distance
from pcsr_plugins.layers.self_attention import SelfAttention

SHARES = (0.004, 0.006, 0.008, 0.010, 0.012)
"""Discs of these shares of a patch are looked at; a patch is taken for a disc of radius 1."""
SEEDS = 0.05
"""The share of the points that discs are laid around."""
TINY = 1e-8
"""Added to squared distances, so that the root of 0 has a gradient."""


class PuGan(Objective):
    """Trains a network and its discriminator in one step."""

    lr_multiplier: ClassVar[float] = 0.1
    needs = frozenset({"ot"})

    def __init__(
        self,
        *,
        fidelity_weight: Weight = 100.0,
        uniform_weight: Weight = 10.0,
        repulsion_weight: Weight = 1.0,
        adversarial_weight: Weight = 0.5,
    ) -> None:
        super().__init__()
        self.fidelity_weight = fidelity_weight
        self.uniform_weight = uniform_weight
        self.repulsion_weight = repulsion_weight
        self.adversarial_weight = adversarial_weight
        self.discriminator = Discriminator()

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """The generator's four terms and the discriminator's one, none of which pulls at the other's weights."""
        fixed = {name: weight.detach() for name, weight in self.discriminator.named_parameters()}
        judged = torch.func.functional_call(self.discriminator, fixed, (prediction,))
        real, generated = self.discriminator(target), self.discriminator(prediction.detach())
        return {
            "emd": self.fidelity_weight * matched_distance(prediction, target).mean(),
            "uniform": self.uniform_weight * uniformity(prediction).mean(),
            "repulsion": self.repulsion_weight * hinge_repulsion(prediction).mean(),
            "generator": self.adversarial_weight * (judged - 1).square().mean(),
            "discriminator": (real - 1).square().mean() + generated.square().mean(),
        }


class Discriminator(nn.Module):
    """How much a cloud looks like a true one: 1 if it does, 0 if it is generated (Fig. 4 of the paper)."""

    def __init__(self, channels: int = 32) -> None:
        super().__init__()
        self.single = nn.Sequential(nn.Linear(3, channels), nn.ReLU(), nn.Linear(channels, 2 * channels))
        self.attention = SelfAttention(4 * channels)
        self.joint = nn.Sequential(nn.Linear(4 * channels, 4 * channels), nn.ReLU())
        self.widen = nn.Linear(4 * channels, 8 * channels)
        self.verdict = nn.Sequential(nn.Linear(8 * channels, 8 * channels), nn.ReLU(), nn.Linear(8 * channels, 1))

    def forward(self, points: Points) -> Float[Tensor, " b"]:
        """One number for each cloud."""
        single = self.single(points)
        joint = torch.cat([single, single.amax(1, keepdim=True).expand_as(single)], dim=-1)
        whole = self.widen(self.joint(self.attention(joint))).amax(1)
        verdict: Tensor = self.verdict(whole)
        return verdict.squeeze(-1)


def uniformity(points: Points) -> Float[Tensor, " b"]:
    """How far the points of small discs are from evenly spaced: mean of (d − e)²/e, d to the nearest in the disc.

    Points that share a patch of area π evenly are e = √(π/n) apart. Sec. 3.3.2 of the paper, in the form of its code:
    instead of by how much its number of points is off, a disc counts by the square of its share in per cent. A disc of
    share p has the radius √p and holds its p·n nearest points, where fewer are inside copies of the middle one; the
    code takes the first p·n in their order in memory. Distances are straight, not along the surface.
    """
    n = points.shape[1]
    fixed = points.detach()
    rows = [torch.from_numpy(farthest_points(row.cpu().numpy(), max(1, int(SEEDS * n)))) for row in fixed]
    centres = gather(fixed, torch.stack(rows).unsqueeze(-1).to(points.device)).squeeze(2)  # (b seeds 3)
    sizes = [min(n, max(2, int(share * n))) for share in SHARES]
    index = knn(centres, fixed, max(sizes))
    away = (gather(fixed, index) - centres.unsqueeze(2)).norm(dim=-1)
    even = math.sqrt(math.pi / n)
    total = points.new_zeros(len(points))
    for share, size in zip(SHARES, sizes, strict=True):
        inside = torch.where(away[..., :size] <= math.sqrt(share), index[..., :size], index[..., :1])
        disc = gather(points, inside.flatten(1, 2).unsqueeze(-1)).view(*inside.shape, 3)
        gap = (disc - disc.gather(2, _nearest_other(disc).unsqueeze(-1).expand_as(disc))).square().sum(-1)
        uneven = ((gap + TINY).sqrt() - even).square() / even
        total = total + (100 * share) ** 2 * uneven.mean((1, 2))
    return total / len(SHARES)


@torch.no_grad()
def _nearest_other(disc: Float[Tensor, "b seeds m 3"]) -> Int[Tensor, "b seeds m"]:
    """Of each point of a disc the index of the nearest other one."""
    apart = torch.cdist(disc, disc, compute_mode="donot_use_mm_for_euclid_dist")
    return apart.diagonal_scatter(torch.full_like(disc[..., 0], math.inf), dim1=2, dim2=3).argmin(-1)
