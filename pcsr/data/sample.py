"""One object of the data set: truth, sparse cloud and touches (TAPSR, Sec. 4.1)."""

import hashlib
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.contracts import Item, TouchSource
from pcsr.errors import UserError
from pcsr.geometry.frames import UnitSphere
from pcsr.geometry.sampling import farthest_points, poisson_points, poisson_subset
from pcsr.recipe import Data


@dataclass(frozen=True)
class Sample:
    """Clouds in the frame in which the truth fills the unit sphere."""

    name: str
    group: str
    truth: Float[np.ndarray, "g 3"]
    points: Float[np.ndarray, "n 3"]
    touches: Float[np.ndarray, "a m 3"]
    sphere: UnitSphere
    """Maps the object's own frame to this one."""


def make_sample(item: Item, source: TouchSource, data: Data, touches: int, seed: int) -> Sample:
    """Sample an object's surface and touch it.

    The truth is blue noise, points·rate of it; the sparse cloud is a subset of the truth, as in the paper.

    Raises:
        UserError: the object has no usable surface or cannot be touched; the message names it and says why.
    """
    rng = np.random.default_rng(item_seed(seed, item.name))
    truth = poisson_points(item.mesh, data.points * data.rate, rng)
    chosen = _subset(truth, data.points, data.sampling, rng)
    felt = source.touches(item, truth[chosen], touches, int(rng.integers(2**31))) if touches else []
    if len(felt) != touches or len({len(touch.points) for touch in felt}) > 1:
        raise UserError(
            f"{item.name}: its touch source gave {[len(touch.points) for touch in felt]} points, "
            f"where {touches} touches of one size were asked for"
        )
    sphere = UnitSphere.fit(truth)
    return Sample(
        name=item.name,
        group=item.group,
        truth=sphere.apply(truth),
        points=sphere.apply(truth[chosen]),
        touches=np.stack([sphere.apply(touch.points) for touch in felt]) if felt else np.zeros((0, 0, 3), np.float32),
        sphere=sphere,
    )


def item_seed(seed: int, name: str) -> int:
    """A seed for one object that depends neither on the others nor on the machine."""
    return int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest()[:8], "big")


def _subset(truth: Float[np.ndarray, "g 3"], count: int, sampling: str, rng: np.random.Generator) -> np.ndarray:
    if sampling == "poisson":
        return poisson_subset(truth, count, rng)
    if sampling == "fps":
        return farthest_points(truth, count)
    return rng.choice(len(truth), count, replace=False)
