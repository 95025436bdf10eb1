"""Copies of points that differ by rounding, as after a conversion between single precision, doubles and text."""

import numpy as np
from jaxtyping import Bool, Float64, Int
from scipy.spatial import cKDTree

ROUNDING = 3e-7
"""Largest difference of a coordinate of two copies, relative to the largest coordinate: two steps of float32."""
OF_SIZE = 3e-5
"""Largest difference of a coordinate of two copies, relative to the size of the cloud."""
GAP = 10.0
"""Other points are farther away than this many times the largest difference of copies."""
MOST = 27
"""Largest number of positions that are copies of one another: three steps of rounding on each axis. More are an object,
as small as it may be beside the cloud."""
SAMPLE = 500
"""Positions among which copies are looked for first; without any there, none are looked for."""


def near_copies(positions: Float64[np.ndarray, "p 3"]) -> Bool[np.ndarray, " p"]:
    """Return which of the distinct positions equal an earlier one but for rounding.

    Positions are copies of one another only if they lie apart from all others. So points that are as close together as
    rounding, such as those of a fine scan with map coordinates, are none.

    Args:
        positions: finite coordinates, each once.
    """
    copies = np.zeros(len(positions), bool)
    if len(positions) < 2:
        return copies
    points = positions / np.abs(positions).max()
    size = float(np.quantile(np.abs(points - np.median(points, axis=0)).max(axis=1), 0.9))
    reach = min(ROUNDING, OF_SIZE * size)
    tree = cKDTree(points)

    def one_of_several(rows: Int[np.ndarray, " m"]) -> Bool[np.ndarray, " m"]:
        """Return which of the rows have others within reach, and no more within `GAP` times the reach."""
        near = tree.query_ball_point(points[rows], reach, p=np.inf, return_length=True)
        around = tree.query_ball_point(points[rows], GAP * reach, p=np.inf, return_length=True)
        found: Bool[np.ndarray, " m"] = (near > 1) & (near <= MOST) & (near == around)
        return found

    left = np.arange(len(points))
    if not one_of_several(left[:: -(-len(points) // SAMPLE)]).any():
        return copies
    left = left[one_of_several(left)]
    while len(left) > 1:  # each pass removes at least one of the closest two
        distance, closest = cKDTree(points[left]).query(points[left], k=[2], p=np.inf)
        late = (distance[:, 0] <= reach) & (closest[:, 0] < np.arange(len(left)))
        if not late.any():
            break
        copies[left[late]] = True
        left = left[~late]
    return copies
