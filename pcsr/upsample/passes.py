"""Passes in which a cloud grows, and the share of each patch in the new points of a pass."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from pcsr.tensors import CloudArray
from pcsr.upsample.candidates import Candidates
from pcsr.upsample.gaps import spacing
from pcsr.upsample.neighbours import MOST, Neighbours
from pcsr.upsample.selection import pattern

GROWTH = 4.0
"""Largest growth of the cloud in one pass, if the source generates any number of candidates."""
RATE, LAST_RATE = 4, 8
"""Candidates for each point then: few, which lie well, before the last pass; many to choose from in the last."""


@dataclass(frozen=True)
class Pass:
    """One pass over the points that get new ones."""

    points: int
    """Number of these points."""
    new: int
    """Number of new points."""
    rate: int
    """Candidates for each point."""
    first: bool
    """Whether no other pass comes before it."""

    def of_margin(self, margin: int) -> "Pass":
        """Return the pass of the same growth over `margin` points."""
        return Pass(margin, round(margin * self.new / self.points), self.rate, self.first)


def passes(points: int, new: int, source: Candidates, keep: bool) -> list[Pass]:
    """Return the passes over a cloud: the fewest with which none exceeds the growth that suits the source.

    Args:
        points: number of points that get new ones.
        new: number of new points.
        source: generates the candidates.
        keep: whether the old points are part of the result.
    """
    growth = max(1.0, (points + new if keep else new) / points)
    most = GROWTH if source.any_rate else source.rate + keep
    count = max(1, math.ceil(math.log(growth) / math.log(most) - 1e-9))
    sizes = [round(points * growth ** (number / count)) for number in range(count)]
    rate, last_rate = (RATE, LAST_RATE) if source.any_rate else (source.rate, source.rate)
    before = [Pass(size, larger - size, rate, size == points) for size, larger in pairwise(sizes)]
    return [*before, Pass(sizes[-1], new, last_rate, count == 1)]


def weights(cloud: CloudArray, plan: Pass) -> Float[np.ndarray, " n"]:
    """Compute the weights of a cloud's points in the shares of new points.

    In the first pass all weigh the same: the number of given points in a region is the best measure of its density.
    After it, the cloud is even enough for the spacing to measure the area of each point. Shares by number repeat what
    the pass before made too dense; shares by area make too dense what is curved. The weight is the geometric mean of
    the two: the spacing in units of the density pattern.
    """
    if plan.first:
        return np.ones(len(cloud))
    neighbours = Neighbours.of(cloud, MOST)
    unit = spacing(neighbours)
    weight: Float[np.ndarray, " n"] = unit / pattern(neighbours, unit)
    return weight if weight.sum() > 0 else np.ones(len(cloud))
