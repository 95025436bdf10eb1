"""Optimal assignment of large clouds by auction (Bertsekas, Annals of Operations Research 14, 1988).

Bidders (points of one cloud) compete for objects (points of the other) whose cost is their distance plus a
price. A bidder without an object takes the one that costs least and raises its price until the second best is
as good, plus a step; whoever held it bids again. Once everyone holds something, the assignment costs at most
one step a bidder more than the best. Steps shrink from phase to phase, and prices are kept.

The prices also prove how good the result is: by duality no assignment costs less than what every bidder would
pay at its favourite object, minus all prices.
"""

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

SHORTLIST = 64
"""Objects that a bidder weighs before it looks at all of them again."""
FEWEST, MOST = 16, 256
"""Bids in one round. Where all want the same few objects, most bids are wasted, and fewer are made."""
SHRINK = 8
"""How many times smaller the step of the next phase is."""
BLOCK = 256
"""Rows of all distances that are held in memory at once."""

Cloud = Float[np.ndarray, "n 3"]
Rows = Int[np.ndarray, " r"]
Costs = Float[np.ndarray, " r"]


def assign(a: Cloud, b: Cloud, tolerance: float) -> tuple[Int[np.ndarray, " n"], float]:
    """A one-to-one assignment of a to b whose mean distance is proven to be near the least possible.

    Args:
        a: at least 3 finite points.
        b: as many.
        tolerance: how much the mean distance may exceed the proven bound, as a part of itself.

    Returns:
        For each point of a its point of b, and the lower bound on the mean distance of any assignment.
    """
    extent = float(np.linalg.norm(np.ptp(np.concatenate([a, b]), axis=0)))
    if extent == 0:  # no step would be small enough, and none is needed
        return np.arange(len(a)), 0.0
    market = _Market(a, b)
    bound = max(cKDTree(b).query(a)[0].mean(), cKDTree(a).query(b)[0].mean())
    step = extent / 16
    while True:
        held = market.sell(step)
        mean = np.linalg.norm(a - b[held], axis=1).mean()
        bound = max(bound, market.least_mean())
        if mean - bound <= tolerance * mean + 1e-12 * extent:
            return held, float(bound)
        step /= SHRINK


class _Market:
    """Prices, and for each bidder a shortlist: what cost it least when it last looked at all objects."""

    def __init__(self, a: Cloud, b: Cloud) -> None:
        self.a, self.b = a, b
        self.price = np.zeros(len(b))
        size = min(SHORTLIST, len(b) - 1)
        distance, objects = cKDTree(b).query(a, size + 1)
        self.objects, self.distance = objects[:, :size].copy(), distance[:, :size].copy()
        # What the best object off the list cost. Prices only rise, so it costs no less now.
        self.off_list = distance[:, size].copy()

    def sell(self, step: float) -> Int[np.ndarray, " n"]:
        """Auction everything anew at the present prices; the object that each bidder ends up with."""
        holder = np.full(len(self.b), -1)
        held = np.full(len(self.a), -1)
        crowd = MOST
        while len(bidders := np.flatnonzero(held < 0)[:crowd]):
            wanted, best, second = self._two_best(bidders)
            bid = self.price[wanted] + (second - best) + step
            order = np.argsort(bid, kind="stable")  # of several bids for one object the last, highest one counts
            bidders, wanted, bid = bidders[order], wanted[order], bid[order]
            outbid = holder[wanted]
            held[outbid[outbid >= 0]] = -1
            holder[wanted] = bidders
            self.price[wanted] = bid
            held[holder[wanted]] = wanted
            successful = int(np.count_nonzero(holder[wanted] == bidders))
            crowd = min(max(4 * successful, FEWEST), MOST)
        return held

    def least_mean(self) -> float:
        """The dual bound: no assignment has a lower mean distance."""
        blocks = (self.a[start : start + BLOCK] for start in range(0, len(self.a), BLOCK))
        least = sum(float((cdist(block, self.b) + self.price).min(1).sum()) for block in blocks)
        return least / len(self.a) - float(self.price.mean())

    def _two_best(self, bidders: Rows) -> tuple[Rows, Costs, Costs]:
        """The object that costs each bidder least, what it costs, and what the next one costs."""
        wanted, best, second = self._two_listed(bidders)
        unsure = second > self.off_list[bidders]
        if unsure.any():
            self._look_at_all(bidders[unsure])
            wanted, best, second = self._two_listed(bidders)
        return wanted, best, second

    def _two_listed(self, bidders: Rows) -> tuple[Rows, Costs, Costs]:
        objects = self.objects[bidders]
        cost = self.distance[bidders] + self.price[objects]
        rows = np.arange(len(bidders))
        first = cost.argmin(1)
        best = cost[rows, first]
        cost[rows, first] = np.inf
        return objects[rows, first], best, cost.min(1)

    def _look_at_all(self, bidders: Rows) -> None:
        size = self.objects.shape[1]
        distance = cdist(self.a[bidders], self.b)
        cost = distance + self.price
        near = np.argpartition(cost, size, axis=1)[:, : size + 1]  # the last of them is the greatest
        self.objects[bidders] = near[:, :size]
        self.distance[bidders] = np.take_along_axis(distance, near[:, :size], 1)
        self.off_list[bidders] = cost[np.arange(len(bidders)), near[:, size]]
