"""One object of the data set: truth, sparse cloud and touches (TAPSR, Sec. 4.1)."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.spatial import KDTree

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.contracts import ShapeItem, TouchSource
from pcsr.data.view import seen_points
from pcsr.errors import UserError
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.frames import UnitSphere
from pcsr.geometry.sampling import CANDIDATES, poisson_points, poisson_subset, surface_points
from pcsr.recipe import Data
from pcsr.registration import register

MAX_TOUCH_DISTANCE = 0.25
"""Greatest median distance of a touch's points from the surface, in radii of the object; a farther touch is refused."""
COVERAGE_RADIUS = 2.0
"""A touched point covers the truth's points within this multiple of the mean spacing of the touched points."""

KINDS = ("random", "poisson", "fps", "view")
"""Samplings that `mixed` chooses from at random for each object."""


@dataclass(frozen=True)
class Sample:
    """Clouds of one object, normalised so that the truth fills the unit sphere."""

    name: str
    group: str
    truth: Float[np.ndarray, "g 3"]
    points: Float[np.ndarray, "n 3"]
    touches: Float[np.ndarray, "a m 3"]
    """Touches, without those that could not be registered."""
    sphere: UnitSphere
    """Normalisation, from the object's own frame to that of the clouds."""
    coverage: tuple[float, ...]
    """Share of the truth's points that the first 1, 2, … touches cover. It has a value for each touch that was asked
    for; where some could not be registered, the last values are equal."""
    sensor: str


@dataclass(frozen=True)
class Rejection:
    """Reason why an object could not be used."""

    reason: str
    fault: bool = False
    """Whether a part or library failed unexpectedly. The object is then tried again by the next build."""


def make_sample(item: ShapeItem, source: TouchSource, data: Data, touches: int, seed: int) -> Sample:
    """Sample the surface of an object, and touch it.

    Args:
        item: object with its mesh.
        source: touch source.
        data: section `data` of the recipe, with the sizes and samplings of the clouds.
        touches: number of touches.
        seed: seed of the data set.

    Raises:
        UserError: the object has no usable surface or cannot be touched. The message names the object.
    """
    rng = np.random.default_rng(item_seed(seed, item.name))
    truth = _truth(item.mesh, data, rng)
    points = _sparse(item, truth, data, rng)
    recorded = source.touches(item, points.copy(), touches, int(rng.integers(2**31))) if touches else []
    sizes = {len(touch.points) for touch in recorded}
    if len(recorded) != touches or len(sizes) > 1 or 0 in sizes:
        raise UserError(
            f"{item.name}: its touch source returned touches of {[len(touch.points) for touch in recorded]} points "
            f"instead of {touches} touches of equal size"
        )
    with np.errstate(all="ignore"):
        sphere = UnitSphere.fit(truth)
    if not (np.isfinite(sphere.radius) and sphere.radius > 0):
        raise UserError(
            f"{item.name}: its size, {np.ptp(truth, axis=0).max():.3g}, is too large or small to be squared in "
            f"64-bit arithmetic: scale it"
        )
    surface = KDTree(truth)
    for number, touch in enumerate(recorded):
        finite = bool(np.isfinite(touch.points).all())
        distance = float(np.median(surface.query(touch.points)[0])) / sphere.radius if finite else np.inf
        # A sparse truth has wide gaps.
        if distance > MAX_TOUCH_DISTANCE and distance > 3 * _spacing(surface) / sphere.radius:
            raise UserError(
                f"{item.name}: touch {number} lies {distance:.3g} radii off the surface, or is not finite: its source "
                f"returns it in another unit or frame"
            )
    usable = _registered(item.name, recorded, points, data, seed) if data.registration and recorded else recorded
    clouds = [sphere.normalize(touch.points) for touch in usable]
    shares = covered(sphere.normalize(truth), clouds) or (0.0,)
    return Sample(
        name=item.name,
        group=item.group,
        truth=sphere.normalize(truth),
        points=sphere.normalize(points),
        touches=np.stack(clouds) if clouds else np.zeros((0, *sizes, 3) if sizes else (0, 0, 3), np.float32),
        sphere=sphere,
        coverage=(*shares, *[shares[-1]] * touches)[:touches],
        sensor="+".join(dict.fromkeys(touch.sensor for touch in recorded)),
    )


def item_seed(seed: int, name: str) -> int:
    """Return the seed of one object, which depends neither on other objects nor on the machine."""
    return int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest()[:8], "big")


def _registered(
    name: str, recorded: Sequence[Touch], points: Float[np.ndarray, "n 3"], data: Data, seed: int
) -> list[Touch]:
    """Return the touches that could be registered to the sparse cloud, each with as many points as before."""
    assert data.registration
    error = PoseError(data.registration.position, data.registration.rotation)
    found = register(recorded, points.copy(), pose_error=error).touches
    usable = []
    for number, (before, after) in enumerate(zip(recorded, found, strict=True)):
        count = len(before.points)
        if len(after.touch.points) == count:
            usable.append(after.touch)
        elif len(after.touch.points):
            # The stream is the touch's own, so that registration changes no other random number.
            usable.append(after.touch.resampled(count, np.random.default_rng([item_seed(seed, name), 2, number])))
    return usable


def covered_points(
    truth: Float[np.ndarray, "g 3"], touches: Sequence[Float[np.ndarray, "m 3"]]
) -> Bool[np.ndarray, "a g"]:
    """Return, for each touch, which points of the truth it covers.

    A point is covered if a touched point lies within `COVERAGE_RADIUS` times the mean distance from a touched point to
    its nearest neighbour. The definition uses the clouds alone, so that it is the same for every touch source.
    """
    covers = np.zeros((len(touches), len(truth)), bool)
    for row, touch in zip(covers, touches, strict=True):
        tree = KDTree(np.unique(touch, axis=0))  # a touch of too few points repeats some
        if tree.n > 1:
            radius = COVERAGE_RADIUS * _spacing(tree)
            # Only points in the touch's bounding box are queried; most of the truth is far away.
            inside = ((truth >= tree.mins - radius) & (truth <= tree.maxes + radius)).all(1)
            row[inside] = np.isfinite(tree.query(truth[inside], distance_upper_bound=radius)[0])
    return covers


def covered(truth: Float[np.ndarray, "g 3"], touches: Sequence[Float[np.ndarray, "m 3"]]) -> tuple[float, ...]:
    """Return the share of the truth's points that the first 1, 2, … touches cover, as `covered_points` defines it."""
    by_any = np.logical_or.accumulate(covered_points(truth, touches))
    return tuple(by_any.mean(1).tolist())


def _spacing(tree: KDTree) -> float:
    """Return the mean distance from a point to its nearest neighbour."""
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
    """Return the sparse cloud: a subset of the truth, as in the paper, or points that a simulated camera sees."""
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
