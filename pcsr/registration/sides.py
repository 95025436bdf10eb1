"""Whether a cloud shows an object from all sides, so that a touch away from it cannot be of a hidden side."""

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

POINTS, LINES = 2048, 256
"""Largest numbers of points that are looked at, and of those from which a line is drawn."""
NEIGHBOURS = 12
"""Number of neighbours to which a tangent plane is fitted."""
AWAY = 2.0
"""Points closer to the tangent plane than this, in spacings, are of the same side."""
WIDTH, OPENING = 1.5, 0.1
"""Radius of a line in spacings, and its growth with the distance: normals of sparse clouds are inexact."""
MOST = 0.9
"""Share of the lines that meet another side if the cloud shows all sides. It is large, since one hidden side, such as
that on a table, is met by few lines."""


def shows_all_sides(cloud: Float[np.ndarray, "n 3"]) -> bool:
    """Return whether a cloud shows an object from all sides, as far as the cloud itself tells.

    From points of the cloud, lines are drawn along the normals, in both directions. If there is an opposite side, most
    of them meet it.

    Args:
        cloud: points in any frame and unit.
    """
    some = cloud[np.random.default_rng(0).permutation(len(cloud))[:POINTS]]
    points = some[np.sort(np.unique(some, axis=0, return_index=True)[1])]  # in their order, whatever the frame
    if len(points) <= NEIGHBOURS:
        return False
    distance, index = cKDTree(points).query(points, k=range(1, NEIGHBOURS + 2))
    spacing = float(np.median(distance[:, 1:5].mean(1)))
    starts = points[:LINES]
    around = points[index[:LINES]]
    around = around - around.mean(1, keepdims=True)
    normals = np.linalg.eigh(around.transpose(0, 2, 1) @ around)[1][:, :, 0]
    offsets = points - starts[:, None]
    along = np.abs((offsets * normals[:, None]).sum(-1))
    beside = np.sqrt(np.maximum((offsets**2).sum(-1) - along**2, 0.0))
    meets = ((along > AWAY * spacing) & (beside < WIDTH * spacing + OPENING * along)).any(1)
    return bool(meets.mean() > MOST)
