"""Clouds of thin and troubled things whose true surface is known: plates, wires, strays, noise, uneven density."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from pcsr.clouds.cloud import Cloud
from pcsr.geometry.sampling import poisson_subset

CANDIDATES = 5
"""Random points drawn for each point of an even sample."""
PATCH = 14.0
"""Side of the square with stripes, in spacings."""
Points = Float[np.ndarray, "_ 3"]
Distance = Callable[[Points], Float[np.ndarray, " _"]]


@dataclass(frozen=True)
class Scene:
    """A cloud whose points stand one spacing apart: one point for each square of that side."""

    name: str
    cloud: Cloud
    distance: Distance
    """Distance of points to the true surface."""
    spacing: float = 1.0
    marked: Bool[np.ndarray, " n"] | None = None
    """The points of the cloud that a measure is about: those of a wire, the strays, those of dense stripes."""


def flat(
    x: tuple[float, float], y: tuple[float, float], z: float, count: int, rng: np.random.Generator, *, even: bool
) -> Points:
    """Points of a level rectangle, random or evenly sampled."""
    low, high = np.array([x[0], y[0]]), np.array([x[1], y[1]])
    drawn = rng.uniform(low, high, (CANDIDATES * count if even else count, 2))
    points = np.column_stack([drawn, np.full(len(drawn), z)])
    return points[poisson_subset(points, count, rng)] if even else points


def to_flat(x: tuple[float, float], y: tuple[float, float], z: float) -> Distance:
    """The distance to a level rectangle."""
    low, high = np.array([x[0], y[0], z]), np.array([x[1], y[1], z])
    return lambda points: np.linalg.norm(points - points.clip(low, high), axis=1)


def nearest_of(*distances: Distance) -> Distance:
    """The distance to the nearest of several surfaces."""
    return lambda points: np.min([distance(points) for distance in distances], axis=0)


def plate(thickness: float, rng: np.random.Generator, *, even: bool, normals: bool, side: float = 28) -> Scene:
    """Two parallel sheets, `thickness` spacings apart."""
    span, count = (0.0, side), round(side**2)
    points = np.concatenate([flat(span, span, z, count, rng, even=even) for z in (0.0, thickness)])
    up = np.repeat([-1.0, 1.0], count)
    columns = {"nx": 0 * up, "ny": 0 * up, "nz": up} if normals else {}
    name = f"{thickness:g} apart, {_sampled(even)}{', normals' if normals else ''}"
    distance = nearest_of(*(to_flat(span, span, z) for z in (0.0, thickness)))
    return Scene(name, Cloud(points, columns), distance)


def tube(axis: Points, radius: float, rng: np.random.Generator, *, even: bool) -> tuple[Points, Distance]:
    """Points on a tube around a finely sampled curve, one for each unit of area, and the distance to it.

    The tube is solid: the distance of points inside is 0.
    """
    along = np.gradient(axis, axis=0)
    length = np.linalg.norm(np.diff(axis, axis=0), axis=1).sum()
    count = round(2 * np.pi * radius * length)
    rows = rng.integers(0, len(axis), CANDIDATES * count if even else count)
    across = np.cross(rng.normal(size=(len(rows), 3)), along[rows])
    points = axis[rows] + radius * across / np.linalg.norm(across, axis=1, keepdims=True)
    tree = cKDTree(axis)
    chosen = poisson_subset(points, count, rng) if even else np.arange(count)
    return points[chosen], lambda asked: (tree.query(asked)[0] - radius).clip(0)


def wire_by_step(
    radius: float, gap: float, rng: np.random.Generator, *, even: bool, length: float = 36, width: float = 14
) -> Scene:
    """A straight wire in front of the edge of a step, `gap` spacings from the edge and from the lower floor."""
    y, lower, upper, away = (0.0, length), (0.0, width), (-width, 0.0), gap + radius
    axis = np.column_stack([np.full(7200, away), np.linspace(*y, 7200), np.full(7200, away)])
    wire, to_wire = tube(axis, radius, rng, even=even)
    levels = ((lower, 0.0), (upper, away))
    points = np.concatenate([wire, *(flat(x, y, z, round(width * length), rng, even=even) for x, z in levels)])
    distance = nearest_of(to_wire, *(to_flat(x, y, z) for x, z in levels))
    name = f"{gap:g} from a step, radius {radius:g}, {_sampled(even)}"
    return Scene(name, Cloud(points), distance, marked=np.arange(len(points)) < len(wire))


def helix(radius: float, rng: np.random.Generator, *, even: bool, coil: float = 5, turns: int = 6) -> Scene:
    """A wire wound into a coil, whose turns are as far apart as its radius."""
    angle = np.linspace(0, 2 * np.pi * turns, 20000)
    axis = coil * np.column_stack([np.cos(angle), np.sin(angle), angle / (2 * np.pi)])
    points, distance = tube(axis, radius, rng, even=even)
    name = f"helix, radius {radius:g}, {_sampled(even)}"
    return Scene(name, Cloud(points), distance, marked=np.ones(len(points), bool))


def strays(rng: np.random.Generator, share: float = 0.02, side: float = 40) -> Scene:
    """A square with stray points 2 to 20 spacings above and below."""
    span, count = (0.0, side), round(side**2)
    points = flat(span, span, 0.0, count, rng, even=False)
    stray = flat(span, span, 0.0, round(share * count), rng, even=False)
    stray[:, 2] = rng.uniform(2, 20, len(stray)) * rng.choice([-1, 1], len(stray))
    every = np.concatenate([points, stray])
    return Scene("2 % strays", Cloud(every), to_flat(span, span, 0.0), marked=np.arange(len(every)) >= count)


def floor(rng: np.random.Generator, spacing: float = 10, noise: float = 3, side: float = 400) -> Scene:
    """A floor in mm, whose points are off by Gaussian noise."""
    span = (0.0, side)
    points = flat(span, span, 0.0, round((side / spacing) ** 2), rng, even=True)
    points[:, 2] += rng.normal(0, noise, len(points))
    return Scene(f"floor, {noise:g} mm noise", Cloud(points), lambda asked: np.abs(asked[:, 2]), spacing)


def sphere(
    rng: np.random.Generator, radius: float = 100, count: int = 1600, share: float = 0.02, far: float = 30
) -> Scene:
    """A sphere in mm with outliers up to `far` inside and outside."""
    total = count + round(share * count)
    points = rng.normal(size=(total, 3))
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    points[count:] *= 1 + rng.uniform(-far, far, (total - count, 1)) / radius
    return Scene(
        "sphere, 2 % outliers",
        Cloud(points),
        lambda asked: np.abs(np.linalg.norm(asked, axis=1) - radius),
        float(np.sqrt(4 * np.pi * radius**2 / count)),
        np.arange(total) >= count,
    )


def camera_step(rng: np.random.Generator, depth: float = 10, spacing: float = 2) -> Scene:
    """A camera's picture in mm of a depth step: a grid of pixels, some of which fly between the two levels."""
    across, down = np.meshgrid(np.arange(-24, 24), np.arange(32), indexing="ij")
    level = np.where(across.ravel() < 0, 0.0, depth)
    flying = np.isin(across.ravel(), (-1, 0)) & (rng.random(across.size) < 0.5)
    z = np.where(flying, rng.uniform(0, depth, across.size), level)
    points = np.column_stack([spacing * (across.ravel() + 0.5), spacing * down.ravel(), z])
    ends, edge = (0.0, spacing * 31), spacing * 24
    distance = nearest_of(to_flat((-edge, 0.0), ends, 0.0), to_flat((0.0, edge), ends, depth))
    return Scene("depth step, flying pixels", Cloud(points), distance, spacing, flying)


def stripes(number: int, rng: np.random.Generator, *, even: bool, factor: int = 4) -> Scene:
    """A square as small as one patch, cut into stripes; the first, third, … are `factor` times as dense."""
    span, width = (0.0, PATCH), PATCH / number
    parts = []
    for stripe in range(number):
        count = round(PATCH * width * (1 if stripe % 2 else factor))
        parts.append(flat((stripe * width, (stripe + 1) * width), span, 0.0, count, rng, even=even))
    points = np.concatenate(parts)
    marked = in_dense(points, number)
    return Scene(f"{number} stripes, {_sampled(even)}", Cloud(points), to_flat(span, span, 0.0), marked=marked)


def in_dense(points: Points, number: int) -> Bool[np.ndarray, " _"]:
    """Which points lie in the dense ones of so many stripes, whose outer ones have no outer edge."""
    stripe = np.floor(number * points[:, 0] / PATCH).clip(0, number - 1)
    dense: Bool[np.ndarray, " _"] = stripe % 2 == 0
    return dense


def _sampled(even: bool) -> str:
    return "even" if even else "random"
