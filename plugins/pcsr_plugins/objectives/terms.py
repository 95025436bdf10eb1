"""Terms that the objectives of several networks share: one-to-one matching, and points that keep apart.

Each gives a value for each cloud of the batch, so that an objective may weigh them before it takes the mean.
"""

import torch
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from pcsr import UserError
from pcsr.geometry.neighbours import gather, knn
from pcsr.metrics.nearest import require_finite
from pcsr.tensors import Points

HEAT = (0.3, 0.1, 0.03, 0.01)
"""How far the prices are from the best ones, turn by turn, in units of the costs' spread."""
ROUNDS = 4
"""Improvements of all prices in each turn."""


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
        UserError: the clouds differ in size.
        RunError: a cloud is empty, or a coordinate is not finite.
    """
    if prediction.shape[1] != target.shape[1]:
        raise UserError(
            f"one-to-one matching wants clouds of one size, got {prediction.shape[1]} predicted and "
            f"{target.shape[1]} true points: let the truth have as many, or take a Chamfer distance as the fidelity"
        )
    require_finite(prediction, target)
    with torch.no_grad():
        cost = torch.cdist(prediction, target, compute_mode="donot_use_mm_for_euclid_dist").double().cpu()
        eased = _eased(cost.square() if squared else cost)
        own = torch.stack([torch.from_numpy(linear_sum_assignment(rows)[1]) for rows in eased.numpy()])
    matched = gather(target, own.unsqueeze(-1).to(target.device)).squeeze(2)  # (b n 3)
    distance = (prediction - matched).square().sum(-1)
    return distance.mean(1) if squared else _root(distance).mean(1)


def _eased(cost: Float[Tensor, "b n n"]) -> Float[Tensor, "b n n"]:
    """Take a price off each row and each column: the best assignment stays what it was, and is found sooner. In place.

    The search is quick where the best pairs cost next to nothing and no pair costs less. Prices like that are those of
    the entropic transport between the clouds (Cuturi, "Sinkhorn Distances", NeurIPS 2013), at ever less heat. Without
    them, clouds that lie far off take up to ten times as long, and those of an untrained network do.
    """
    cost -= cost.mean(2, keepdim=True)
    cost -= cost.amin(2, keepdim=True)
    cost -= cost.amin(1, keepdim=True)
    single = cost.float()
    spread = single.std((1, 2), correction=0, keepdim=True).clamp_min(1e-30)
    row, column = torch.zeros_like(single[:, :, :1]), torch.zeros_like(single[:, :1])
    for share in HEAT:
        heat = share * spread
        kernel = torch.exp((row + column - single) / heat)
        of_row = torch.ones_like(row)
        for _ in range(ROUNDS):
            of_column = 1 / (of_row.mT @ kernel).clamp_min(1e-30)
            of_row = 1 / (kernel @ of_column.mT).clamp_min(1e-30)
        row, column = row + heat * of_row.log(), column + heat * of_column.log()
    cost -= row
    cost -= column
    cost -= cost.amin(2, keepdim=True)
    cost -= cost.amin(1, keepdim=True)
    return cost


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
    """Squared distances to the nearest other points; the way back goes to both ends."""
    near = knn(points.detach(), points.detach(), neighbours + 1)[..., 1:]
    return (gather(points, near) - points.unsqueeze(2)).square().sum(-1)


def _root(square: Tensor) -> Tensor:
    """The square root, flat near zero: where two points coincide there is no way to go."""
    return square.clamp_min(1e-12).sqrt()
