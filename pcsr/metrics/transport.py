"""Optimal transport between large clouds: a sparse problem that grows until its solution is proven.

All points have the same mass, so the optimal plan is an assignment. Coinciding points are merged to save time, and
their masses added. Few of the n² pairs matter, and the dual potentials u and v show which. If u[i] + v[j] never
exceeds the distance of i and j, the sum of masses times potentials is a lower bound of the cost. Pairs whose distance
is much larger than u[i] + v[j] are in no good plan.

Initial potentials are computed from the centroids of small cells of both clouds. The network simplex of POT (Bonneel et
al., ACM TOG 30, 2011) then solves the problem of the most promising pairs. Its potentials are compared with all pairs.
Pairs that violate the bound are added, and the problem is solved again.
"""

from concurrent.futures import Executor, ThreadPoolExecutor

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.sparse import coo_array

from pcsr.extras import imported
from pcsr.geometry.patches import cells
from pcsr.tensors import CloudArray
from pcsr.threads import allowed, single_thread, threads

CELL = 8
"""Number of points of a cell. Larger cells give worse initial potentials, smaller cells a larger initial problem."""
FIRST, MORE = 16, 8
"""Number of pairs of each point in the first sparse problem, and number of pairs added in each round."""
BLOCK = 32
"""Number of points whose distances to all others are in memory at the same time."""
PIVOTS = 10**9
"""Largest number of steps of the network simplex, not reached in practice."""
ROUNDING = 1e-12
"""Gaps up to this share of the clouds' extent are attributed to rounding."""
USER = "the earth mover's distance of large clouds"
"""Reason for the need of POT, in the message if it is not installed."""
Prices = Float[np.ndarray, " n"]
Counts = Int[np.ndarray, " n"]
Other = Float[np.ndarray, "m 3"]
OtherPrices = Float[np.ndarray, " m"]
OtherCounts = Int[np.ndarray, " m"]
Pairs = Int[np.ndarray, " pairs"]


def mean_distance(a: CloudArray, b: CloudArray, tolerance: float) -> tuple[float, float]:
    """Compute the mean distance of a one-to-one assignment of a to b that is optimal up to a tolerance.

    Args:
        a: at least one point; finite.
        b: as many points.
        tolerance: largest difference between the mean distance and its lower bound, relative to the mean distance.

    Returns:
        The mean distance, and a lower bound for all assignments.

    Raises:
        UserError: the extra `[train]` is not installed.
    """
    # Coordinates are scaled to [0, 1], whatever their unit and origin.
    corner = np.minimum(a.min(0), b.min(0))
    extent = float(np.maximum((a - corner).max(), (b - corner).max()))
    if extent == 0:
        return 0.0, 0.0
    # Each thread works on its own blocks. Threads within operations would wait for each other most of the time.
    with threads(1), ThreadPoolExecutor(allowed(), initializer=single_thread) as pool:
        mean, bound = _mean_distance((a - corner) / extent, (b - corner) / extent, tolerance, pool)
    return extent * mean, extent * bound


def _mean_distance(a: CloudArray, b: CloudArray, tolerance: float, pool: Executor) -> tuple[float, float]:
    centres, potentials = _potentials_of_cells(a, b)
    a, count_a = np.unique(a, axis=0, return_counts=True)
    b, count_b = np.unique(b, axis=0, return_counts=True)
    v, _ = _cheapest(pool, b, centres, potentials, 1)  # the highest that the potentials of a's cells allow
    u, pairs_of_a = _cheapest(pool, a, b, v, FIRST)
    _, pairs_of_b = _cheapest(pool, b, a, u, FIRST)
    j, i = np.divmod(pairs_of_b, len(a))
    pairs = np.unique(np.concatenate([_some_plan(count_a, count_b), pairs_of_a, i * len(b) + j]))
    while True:
        mean, u, v = _solve(a, count_a, b, count_b, pairs)
        allowed, more = _cheapest(pool, a, b, v, MORE, u)
        bound = float((allowed @ count_a + v @ count_b) / count_a.sum())
        enlarged = np.union1d(pairs, more)
        if mean - bound <= tolerance * mean + ROUNDING or len(enlarged) == len(pairs):
            return mean, bound
        pairs = enlarged


def _cells(cloud: CloudArray) -> tuple[Float[np.ndarray, "c 3"], Float[np.ndarray, " c"]]:
    """Return the centroids of small cells, and the share of the points in each cell."""
    rows = list(cells(cloud, CELL))
    centres = np.stack([cloud[some].mean(0) for some in rows])
    return centres, np.array([len(some) / len(cloud) for some in rows])


def _some_plan(count_a: Counts, count_b: OtherCounts) -> Pairs:
    """Return the pairs of an arbitrary feasible plan: points are matched in their order. It ensures a solution."""
    ends_a, ends_b = np.cumsum(count_a), np.cumsum(count_b)
    cuts = np.union1d(ends_a, ends_b)
    return np.searchsorted(ends_a, cuts) * len(count_b) + np.searchsorted(ends_b, cuts)


def _potentials_of_cells(a: CloudArray, b: CloudArray) -> tuple[Float[np.ndarray, "c 3"], Float[np.ndarray, " c"]]:
    """Return the centroids of the cells of a, and their potentials in the optimal plan to the cells of b."""
    ot = imported("ot", USER)  # imported here, which takes a second
    (centres, shares), (centres_b, shares_b) = (_cells(cloud) for cloud in (a, b))
    cost = np.linalg.norm(centres[:, None] - centres_b, axis=2)
    log = ot.emd(shares, shares_b, cost, numItermax=PIVOTS, log=True, center_dual=False)[1]
    return centres, np.asarray(log["u"])


def _solve(
    a: CloudArray, count_a: Counts, b: Other, count_b: OtherCounts, pairs: Pairs
) -> tuple[float, Prices, OtherPrices]:
    """Return the mean distance of the optimal plan with these pairs only, and its dual potentials u and v."""
    ot = imported("ot", USER)
    i, j = np.divmod(pairs, len(b))
    cost = coo_array((np.linalg.norm(a[i] - b[j], axis=1), (i, j)), shape=(len(a), len(b)))
    shares = (count / count.sum() for count in (count_a, count_b))
    log = ot.emd(*shares, cost, numItermax=PIVOTS, log=True, center_dual=False)[1]
    return float(log["cost"]), log["u"], log["v"]


def _cheapest(
    pool: Executor, a: CloudArray, b: Other, v: OtherPrices, count: int, u: Prices | None = None
) -> tuple[Prices, Pairs]:
    """Return the least distance − v of each point of a, and its pairs with the `count` points of b of least value.

    With u, each point of b whose bound u[i] + v[j] ≤ distance is violated is also paired with the point of a that
    violates it most. This helps if many points of a are similar and have the same cheapest points of b.
    """
    count = min(count, len(b))
    points, others, potentials = (torch.from_numpy(array) for array in (a, b, v))
    # Allocated once: small arrays between large temporary ones would fragment the memory.
    least = torch.zeros(len(a), dtype=torch.float64)
    partners = torch.zeros((len(a), count), dtype=torch.int64)
    gain = torch.zeros(len(b), dtype=torch.float64)
    winner = torch.zeros(len(b), dtype=torch.int64)

    def look(start: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Fill a block of `least` and `partners`, and return points of b with violated bounds, values and partners."""
        rows = slice(start, start + BLOCK)
        cost = torch.cdist(points[rows], others, compute_mode="donot_use_mm_for_euclid_dist").sub_(potentials)
        values, partners[rows] = cost.topk(count, largest=False)
        least[rows] = values[:, 0]
        if u is None:
            return winner[:0], gain[:0], winner[:0]
        lowest = cost.sub_(torch.from_numpy(u[rows, None])).amin(0)
        new = torch.nonzero(lowest < 0)[:, 0]
        return new, lowest[new], cost[:, new].argmin(0) + start

    for new, lowest, row in pool.map(look, range(0, len(a), BLOCK)):
        better = lowest < gain[new]
        gain[new[better]] = lowest[better]
        winner[new[better]] = row[better]
    won = torch.nonzero(gain)[:, 0]
    pairs = [(torch.arange(len(a))[:, None] * len(b) + partners).flatten(), winner[won] * len(b) + won]
    return least.numpy(), torch.cat(pairs).numpy()
