"""One object of the data set: truth, sparse cloud and touches (TAPSR, Sec. 4.1)."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.spatial import KDTree

from pcsr.contracts import ShapeItem, TouchSource
from pcsr.data.view import seen_points
from pcsr.errors import UserError
from pcsr.geometry.checks import check_frame
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.frames import UnitSphere
from pcsr.geometry.sampling import CANDIDATES, poisson_points, poisson_subset, surface_points
from pcsr.recipe import Data

FAR = 0.25
"""The largest median distance of a touch from the surface, in radii of the object."""
REACH = 2.0
"""The reach of a touched point, in mean distances between neighbouring touched points."""

KINDS = ("random", "poisson", "fps", "view")
"""Of sparse clouds: what `mixed` draws from, object by object."""


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
    coverage: tuple[float, ...]
    """The share of the truth that the first touch reaches, that the first two reach, and so on."""
    sensor: str


@dataclass(frozen=True)
class Rejected:
    """An object that could not be used."""

    reason: str
    fault: bool = False
    """Not the object's doing but a fault of a part or a library: it is tried again when the build is run again."""


def make_sample(item: ShapeItem, source: TouchSource, data: Data, touches: int, seed: int) -> Sample:
    """Sample an object's surface and touch it.

    Raises:
        UserError: the object has no usable surface or cannot be touched; the message names it and says why.
    """
    rng = np.random.default_rng(item_seed(seed, item.name))
    truth = _truth(item.mesh, data, rng)
    points = _sparse(item, truth, data, rng)
    touched = source.touches(item, points.copy(), touches, int(rng.integers(2**31))) if touches else []
    sizes = {len(touch.points) for touch in touched}
    if len(touched) != touches or len(sizes) > 1 or 0 in sizes:
        raise UserError(
            f"{item.name}: its touch source gave {[len(touch.points) for touch in touched]} points, "
            f"where {touches} touches of one size were asked for"
        )
    with np.errstate(all="ignore"):
        sphere = UnitSphere.fit(truth)
    if not (np.isfinite(sphere.radius) and sphere.radius > 0):
        raise UserError(
            f"{item.name}: its size, {np.ptp(truth, axis=0).max():.3g}, is beyond what numbers of 64 bits can be "
            f"squared to: scale it"
        )
    surface = KDTree(truth)
    for number, touch in enumerate(touched):
        finite = bool(np.isfinite(touch.points).all())
        away = float(np.median(surface.query(touch.points)[0])) / sphere.radius if finite else np.inf
        if away > FAR:
            check_frame(
                f"{item.name}: touch {number}",
                "the surface",
                distance=away * sphere.radius,
                extent=2 * sphere.radius,
                most_distance=max(FAR / 2, 1.5 * _gap(surface) / sphere.radius),  # few points have wide gaps
            )
    clouds = [sphere.normalize(touch.points) for touch in touched]
    return Sample(
        name=item.name,
        group=item.group,
        truth=sphere.normalize(truth),
        points=sphere.normalize(points),
        touches=np.stack(clouds) if clouds else np.zeros((0, 0, 3), np.float32),
        sphere=sphere,
        coverage=covered(sphere.normalize(truth), clouds),
        sensor="+".join(dict.fromkeys(touch.sensor for touch in touched)),
    )


def item_seed(seed: int, name: str) -> int:
    """A seed for one object that depends neither on the others nor on the machine."""
    return int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest()[:8], "big")


def touched_points(
    truth: Float[np.ndarray, "g 3"], touches: Sequence[Float[np.ndarray, "m 3"]]
) -> Bool[np.ndarray, "a g"]:
    """For each touch, a mask of the truth points that it reaches.

    A point is reached if a touched point lies within twice the mean distance from a touched point to its nearest.
    Measured on the clouds themselves, so that it means the same for every touch source.
    """
    within = np.zeros((len(touches), len(truth)), bool)
    for row, touch in zip(within, touches, strict=True):
        tree = KDTree(np.unique(touch, axis=0))  # where a touch had too few points they are repeated
        if tree.n > 1:
            reach = REACH * _gap(tree)
            # Most of the truth is far from a touch: what a box tells need not be asked.
            around = ((truth >= tree.mins - reach) & (truth <= tree.maxes + reach)).all(1)
            row[around] = np.isfinite(tree.query(truth[around], distance_upper_bound=reach)[0])
    return within


def covered(truth: Float[np.ndarray, "g 3"], touches: Sequence[Float[np.ndarray, "m 3"]]) -> tuple[float, ...]:
    """The share of the truth's points that the first touch reaches (`touched_points`), the first two, and so on."""
    by_any = np.logical_or.accumulate(touched_points(truth, touches))
    return tuple(by_any.mean(1).tolist())


def _gap(tree: KDTree) -> float:
    """Mean distance from a point to its nearest."""
    return float(tree.query(tree.data, k=2)[0][:, 1].mean())


def _truth(mesh: trimesh.Trimesh, data: Data, rng: np.random.Generator) -> Float[np.ndarray, "g 3"]:
    count = data.points * data.rate
    if data.truth == "poisson":
        return poisson_points(mesh, count, rng)
    candidates = surface_points(mesh, CANDIDATES * count, rng)
    chosen: Float[np.ndarray, "g 3"] = candidates[farthest_points(candidates, count)]
    return chosen


def _sparse(
    item: ShapeItem, truth: Float[np.ndarray, "g 3"], data: Data, rng: np.random.Generator
) -> Float[np.ndarray, "n 3"]:
    """A subset of the truth, as in the paper, or what a camera sees."""
    sampling = str(rng.choice(KINDS)) if data.sampling == "mixed" else data.sampling
    if sampling == "view":
        return seen_points(item.mesh, data.points, data.view, rng, item.name)
    chosen: Float[np.ndarray, "n 3"] = truth[_subset(truth, data.points, sampling, rng)]
    return chosen


def _subset(
    truth: Float[np.ndarray, "g 3"], count: int, sampling: str, rng: np.random.Generator
) -> Int[np.ndarray, " n"]:
    if sampling == "poisson":
        return poisson_subset(truth, count, rng)
    if sampling == "fps":
        return farthest_points(truth, count)
    return rng.choice(len(truth), count, replace=False)
