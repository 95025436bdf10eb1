"""Upsampling of a whole cloud in one pass of a network."""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float

from pcsr.contracts import TouchBatch
from pcsr.errors import UserError
from pcsr.geometry.frames import UnitSphere
from pcsr.network.kinds import AnyNetwork
from pcsr.upsample.checks import check_finite


@torch.inference_mode()
def upsample(
    network: AnyNetwork,
    points: Float[np.ndarray, "n 3"],
    rate: int,
    touches: Sequence[Float[np.ndarray, "m 3"]] = (),
) -> Float[np.ndarray, "rn 3"]:
    """Upsample one cloud in one pass, as TAPSR does.

    Args:
        network: in `eval` mode.
        points: the sparse cloud, in any frame and unit.
        rate: output points for each input point.
        touches: touched points in the frame and unit of `points`, the same number for each touch.

    Returns:
        The dense cloud in the frame and unit of `points`, float64.

    Raises:
        UserError: a cloud that is empty or not finite, or touches of different sizes.
        RunError: the network generated a coordinate that is not finite.
    """
    if len({len(touch) for touch in touches}) > 1:
        raise UserError(f"touches: expected one size, got {[len(touch) for touch in touches]} points")
    sphere = UnitSphere.fit(points)
    device = next(network.parameters()).device
    cloud = torch.from_numpy(sphere.normalize(points))[None].to(device)
    touched = np.stack([sphere.normalize(touch) for touch in touches]) if len(touches) else None
    batch = None if touched is None else TouchBatch.of(torch.from_numpy(touched)[None].to(device))
    dense = sphere.denormalize(network(cloud, rate, batch)[0].float().cpu().numpy())
    check_finite(dense)
    return dense
