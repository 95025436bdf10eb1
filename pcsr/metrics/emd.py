"""Earth mover's distance: mean distance when each point of one cloud is carried to its own of the other."""

import numpy as np
import torch
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist
from torch import Tensor

from pcsr.errors import UserError
from pcsr.metrics.nearest import require_finite
from pcsr.metrics.transport import mean_distance

EXACT = 1024
"""Up to so many points a dense solver is faster."""
TOLERANCE = 1e-4
"""Above, the value is proven to be at most this part of itself too high."""


def emd(prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b t 3"]) -> Float[Tensor, " b"]:
    """Mean distance (not squared) of the best one-to-one assignment; not differentiable.

    Exact up to 1024 points. Above, proven to be at most 0.01 % above the exact value, and never below it.

    Raises:
        UserError: the clouds differ in size.
        RunError: a cloud is empty, or a coordinate is not finite.
    """
    require_finite(prediction, target)
    if prediction.shape[1] != target.shape[1]:
        raise UserError(
            f"emd compares clouds of one size, got {prediction.shape[1]} and {target.shape[1]} points: thin one of them"
        )
    pairs = zip(prediction.detach().cpu().double(), target.detach().cpu().double(), strict=True)
    rows = [_mean_distance(p.numpy(), t.numpy()) for p, t in pairs]
    return torch.tensor(rows, dtype=prediction.dtype, device=prediction.device)


def _mean_distance(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> float:
    if len(a) <= EXACT:
        cost = cdist(a, b)
        return float(cost[linear_sum_assignment(cost)].mean())
    return mean_distance(a, b, TOLERANCE)[0]
