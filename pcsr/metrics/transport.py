"""Optimal transport of one large cloud to another: a sparse problem, made larger until its solution is proven.

Every point has the same mass, so the cheapest plan is an assignment (points that coincide are one of more mass, which
changes nothing but the time). Of the n² pairs very few are of use. The dual potentials u and v show which: if
u[i] + v[j] never exceeds the distance of i and j, no plan costs less than all masses times their potentials, and a pair
whose distance exceeds u[i] + v[j] by much is in no good plan.

First potentials come from a small problem, the centroids of small cells of both clouds. Then the network simplex of POT
(Bonneel et al., ACM TOG 30, 2011) solves the pairs that look best, and its potentials are held against all pairs. Where
they are too high, pairs are missing, and are added.
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
"""Points of a cell of the small problem: larger ones give worse first potentials, smaller ones a larger problem."""
FIRST, MORE = 16, 8
"""Pairs of each point: in the first sparse problem, from both sides, and added in each round."""
BLOCK = 32
"""Points whose distances to all others are held in memory at once."""
PIVOTS = 10**9
"""Steps of the network simplex: no limit in practice."""

ROUNDING = 1e-12
"""A gap of so much of the clouds' extent is the arithmetic's."""

USER = "the earth mover's distance of large clouds"
"""What needs POT, in a message to who hasn't got it."""
Prices = Float[np.ndarray, " n"]
Counts = Int[np.ndarray, " n"]
Other = Float[np.ndarray, "m 3"]
OtherPrices = Float[np.ndarray, " m"]
OtherCounts = Int[np.ndarray, " m"]
Pairs = Int[np.ndarray, " pairs"]


def mean_distance(a: CloudArray, b: CloudArray, tolerance: float) -> tuple[float, float]:
    """Mean distance of a one-to-one assignment of a to b that is proven to be near the best.

    Args:
        a: at least one point; finite.
        b: as many.
        tolerance: how much the mean distance may exceed the proven bound, as a part of itself.

    Returns:
        The mean distance, and the lower bound on that of any assignment.

    Raises:
        UserError: the extra `[train]` is not installed.
    """
    # All that follows is about numbers near 1, whatever the unit and wherever the clouds are.
    corner = np.minimum(a.min(0), b.min(0))
    extent = float(np.maximum((a - corner).max(), (b - corner).max()))
    if extent == 0:
        return 0.0, 0.0
    # Threads that work on blocks of their own: those inside of each operation would wait for one another all the time.
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
    """Centroids of small cells, and the share of the points in each."""
    rows = list(cells(cloud, CELL))
    centres = np.stack([cloud[some].mean(0) for some in rows])
    return centres, np.array([len(some) / len(cloud) for some in rows])


def _some_plan(count_a: Counts, count_b: OtherCounts) -> Pairs:
    """The pairs of a plan, however bad: so that there always is one. Both clouds are laid end to end and cut."""
    ends_a, ends_b = np.cumsum(count_a), np.cumsum(count_b)
    cuts = np.union1d(ends_a, ends_b)
    return np.searchsorted(ends_a, cuts) * len(count_b) + np.searchsorted(ends_b, cuts)


def _potentials_of_cells(a: CloudArray, b: CloudArray) -> tuple[Float[np.ndarray, "c 3"], Float[np.ndarray, " c"]]:
    """Centroids of a's cells, and their potentials in the best plan to those of b's."""
    ot = imported("ot", USER)  # takes a second
    (centres, shares), (centres_b, shares_b) = (_cells(cloud) for cloud in (a, b))
    cost = np.linalg.norm(centres[:, None] - centres_b, axis=2)
    log = ot.emd(shares, shares_b, cost, numItermax=PIVOTS, log=True, center_dual=False)[1]
    return centres, np.asarray(log["u"])


def _solve(
    a: CloudArray, count_a: Counts, b: Other, count_b: OtherCounts, pairs: Pairs
) -> tuple[float, Prices, OtherPrices]:
    """The mean distance of the best plan that uses these pairs alone, and the potentials u and v that prove it."""
    ot = imported("ot", USER)
    i, j = np.divmod(pairs, len(b))
    cost = coo_array((np.linalg.norm(a[i] - b[j], axis=1), (i, j)), shape=(len(a), len(b)))
    shares = (count / count.sum() for count in (count_a, count_b))
    log = ot.emd(*shares, cost, numItermax=PIVOTS, log=True, center_dual=False)[1]
    return float(log["cost"]), log["u"], log["v"]


def _cheapest(
    pool: Executor, a: CloudArray, b: Other, v: OtherPrices, count: int, u: Prices | None = None
) -> tuple[Prices, Pairs]:
    """For each point of a the least distance − v, and pairs with the up to `count` points of b where it is least.

    With u, each point of b that some point of a would pay more for than their distance is paired with the one that
    would pay most: that helps where many points of a are alike, and all are cheapest with the same points of b.
    """
    count = min(count, len(b))
    points, others, potentials = (torch.from_numpy(array) for array in (a, b, v))
    # Made at once: small arrays that stay, between the large ones that go, would keep the memory of all of them.
    least = torch.zeros(len(a), dtype=torch.float64)
    partners = torch.zeros((len(a), count), dtype=torch.int64)
    gain = torch.zeros(len(b), dtype=torch.float64)
    winner = torch.zeros(len(b), dtype=torch.int64)

    def look(start: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Fill a block of `least` and `partners`; which points of b gain, how much, and with whom."""
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
