"""Terms that the objectives of several networks share: one-to-one matching, and points that keep apart.

Each gives a value for each cloud of the batch, so that an objective may weigh them before it takes the mean.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcsr import UserError
from pcsr.extras import imported
from pcsr.geometry.neighbours import gather, knn
from pcsr.metrics.nearest import require_finite
from pcsr.tensors import Points

PIVOTS = 10**9
"""Steps of the network simplex: no limit in practice."""


def matched_distance(
    prediction: Float[Tensor, "b n 3"], target: Float[Tensor, "b m 3"], *, squared: bool = False
) -> Float[Tensor, " b"]:
    """Mean distance of each point to its own target, when all are matched one to one at the least cost (EMD).

    The matching is exact and takes no part in the gradient. It takes a time of about n³ in the worst case: meant for
    patches of some 1024 points. The publications match approximately: PU-Net by an auction, then squared
    distances; PU-GAN softly, then plain distances.

    Args:
        prediction: (b n 3).
        target: (b n 3).
        squared: the cost is the squared distance, in the square of the coordinates' unit.

    Raises:
        UserError: the clouds differ in size, or the extra `[train]` is not installed.
        RunError: a cloud is empty, or a coordinate is not finite.
    """
    if prediction.shape[1] != target.shape[1]:
        raise UserError(
            f"one-to-one matching wants clouds of one size, got {prediction.shape[1]} predicted and "
            f"{target.shape[1]} true points: let the truth have as many, or take objective 'chamfer'"
        )
    require_finite(prediction, target)
    with torch.no_grad():
        cost = torch.cdist(prediction, target, compute_mode="donot_use_mm_for_euclid_dist").double().cpu()
        own = torch.stack([_matching(rows) for rows in (cost.square() if squared else cost)])
    matched = gather(target, own.unsqueeze(-1).to(target.device)).squeeze(2)  # (b n 3)
    distance = (prediction - matched).square().sum(-1)
    return distance.mean(1) if squared else _root(distance).mean(1)


def _matching(cost: Float[Tensor, "n n"]) -> Int[Tensor, " n"]:
    """The best one-to-one assignment, by POT's network simplex: all masses are equal, so each point has one target.

    scipy's takes several times as long where clouds lie far off, as those of an untrained network do.
    """
    ot = imported("ot", "one-to-one matching")  # takes a second
    plan = ot.emd([], [], cost.numpy(), numItermax=PIVOTS)
    return torch.from_numpy(plan.argmax(1))


def repulsion(points: Points, *, neighbours: int = 4, radius: float = 0.07, width: float = 0.03) -> Float[Tensor, " b"]:
    """PU-Net's: the mean of radius − d·exp(−d²/width²) over the distances d to each point's nearest neighbours.

    Yu et al., "PU-Net: Point Cloud Upsampling Network", CVPR 2018, in the form of its code. The code
    takes the neighbours from at most 20 points of the ball of `radius`; beyond it the term is flat (exp(−5.4) at
    the published values), so that here they are simply the nearest ones. It falls as points part up to
    d = width/√2, and beyond that it rises again.
    """
    square = _nearest_squared(points, neighbours)
    return (radius - _root(square) * torch.exp(-square / width**2)).mean((1, 2))


def hinge_repulsion(points: Points, *, neighbours: int = 4, gap: float = 0.001) -> Float[Tensor, " b"]:
    """PU-GAN's: the mean of max(0, gap − d²) over the distances d to each point's nearest neighbours.

    Li et al., "PU-GAN: a Point Cloud Upsampling Adversarial Network", ICCV 2019, in the form of its code. `gap` is in
    the square of the coordinates' unit; √0.001 lies inside the ball of 0.07 from which the code takes them.
    """
    return (gap - _nearest_squared(points, neighbours)).clamp_min(0).mean((1, 2))


def _nearest_squared(points: Points, neighbours: int) -> Float[Tensor, "b n k"]:
    """Squared distances to the nearest other points; the gradient goes to both ends."""
    index = knn(points.detach(), points.detach(), neighbours + 1)[..., 1:]
    return (gather(points, index) - points.unsqueeze(2)).square().sum(-1)


def _root(square: Tensor) -> Tensor:
    """The square root, flat index zero: where two points coincide the gradient has no direction."""
    return square.clamp_min(1e-12).sqrt()
