"""The field's test protocol: overlapping patches, each in its own unit sphere, merged and thinned by farthest points.

Patches are cut and merged as by PU-Net (Yu et al., CVPR 2018, Sec. 3.1) and PU-GAN (Li et al., ICCV 2019). For a rate
above the network's, the network is applied repeatedly, such as twice at rate 4 for rate 16.
"""

import math
from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial import cKDTree

from pcsr.contracts import TouchBatch
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.frames import UnitSphere
from pcsr.geometry.patches import in_patch
from pcsr.network.kinds import AnyNetwork
from pcsr.recipe import Patches
from pcsr.tensors import CloudArray
from pcsr.upsample.checks import check_finite

AT_ONCE = 8
"""Number of patches in one batch of the network."""


@torch.inference_mode()
def upsample_patches(
    network: AnyNetwork, points: CloudArray, rate: int, touches: Sequence[CloudArray], patches: Patches
) -> Float[np.ndarray, "rn 3"]:
    """Upsample one cloud by patches.

    Args:
        network: in `eval` mode, of the rate of `patches`.
        points: the sparse cloud, in any frame and unit.
        rate: output points for each input point, a power of the patches' rate.
        touches: touched points in the frame and unit of `points`, the same number for each touch.
        patches: size, rate and overlap of the patches.

    Returns:
        The dense cloud in the frame and unit of `points`, float64.

    Raises:
        UserError: a cloud that is empty or not finite.
        RunError: the network generated a coordinate that is not finite.
    """
    sphere = UnitSphere.fit(points)
    cloud = sphere.normalize(points)
    touched = np.stack([sphere.normalize(touch) for touch in touches]) if touches else np.zeros((0, 1, 3), np.float32)
    goal = rate * len(points)
    while len(cloud) < goal:
        cloud = _pass(network, cloud, touched, patches)
    return sphere.denormalize(cloud)


def _pass(network: AnyNetwork, cloud: CloudArray, touched: Float[np.ndarray, "a m 3"], patches: Patches) -> CloudArray:
    """Upsample every patch once, and merge the results."""
    device = next(network.parameters()).device
    goal = patches.rate * len(cloud)
    start = network.upsampler.prepare(torch.from_numpy(cloud)[None].to(device), patches.rate)[0].float().cpu().numpy()
    n, left = len(start), goal // len(start)
    size = min(patches.points * n // len(cloud), n)
    count = min(n, math.ceil(patches.overlap * n / size)) if n > size else 1
    seeds = start[farthest_points(start, count)]
    rows = cKDTree(start).query(seeds, range(1, size + 1))[1]
    dense = []
    for some in np.array_split(rows, math.ceil(count / AT_ONCE)):
        spheres = [UnitSphere.fit(start[patch]) for patch in some]
        inside = torch.from_numpy(np.stack([s.normalize(start[p]) for s, p in zip(spheres, some, strict=True)]))
        touches = None
        if len(touched):
            clouds = torch.from_numpy(np.stack([[s.normalize(touch) for touch in touched] for s in spheres])).to(device)
            touches = TouchBatch.of(clouds, in_patch(clouds))
        outputs = network(inside.to(device), left, touches).float().cpu().numpy()
        dense += [sphere.denormalize(one) for sphere, one in zip(spheres, outputs, strict=True)]
    merged = np.concatenate(dense)
    check_finite(merged)
    thinned: CloudArray = merged[farthest_points(merged, goal)].astype(np.float32)
    return thinned
