"""A simulated depth camera: the object as it is seen from one or more sides, with noise, its far side missing."""

import numpy as np
import trimesh
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.geometry.rays import MeshRays
from pcsr.recipe import View

FINER = 3
"""How often the image may be made twice as fine before an object is given up as too thin."""
FINEST = 4096
"""Pixels along each side that an image is made finer to."""
MARGIN = 1.02
"""The image is a little wider than the object."""


def seen_points(
    mesh: trimesh.Trimesh, count: int, view: View, rng: np.random.Generator, name: str
) -> Float[np.ndarray, "count 3"]:
    """`count` points of a mesh that its cameras see, drawn at random from all pixels that meet it.

    A camera stands `view.distance` radii from the middle and looks at it; the first from a random direction, each
    other from the direction farthest from those before among a few random ones. Pixels lie on a regular grid, so
    that slanted faces get fewer points, as from a real camera. Noise moves points along their line of sight.

    Returns:
        Points in the mesh's frame and unit.

    Raises:
        UserError: fewer than `count` pixels meet the mesh, however fine the image.
    """
    rays = MeshRays(mesh, None, name)
    corners = np.asarray(mesh.vertices, np.float64)[np.unique(mesh.faces)]
    middle = rays.to_object[:3, 3]
    radius = float(np.linalg.norm(corners - middle, axis=1).max())
    directions = spread_directions(view.cameras, rng)
    yaws = rng.uniform(0, 2 * np.pi, len(directions))
    sides = [view.pixels * 2**finer for finer in range(FINER + 1)]
    for side in [side for side in sides if side <= max(view.pixels, FINEST)]:
        grid = _grid(side, view.distance)
        clouds = []
        for direction, yaw in zip(directions, yaws, strict=True):
            axes = _axes(direction, yaw)
            starts = np.broadcast_to(view.distance * radius * direction, grid.shape)
            sight = grid @ axes.T
            depths = rays.depths(starts, sight)
            met = np.isfinite(depths)
            noisy = depths[met] + rng.normal(size=int(met.sum())) * view.noise * radius
            clouds.append(starts[met] + sight[met] * noisy[:, None] + middle)
        seen = np.concatenate(clouds)
        if len(seen) >= count:
            drawn: Float[np.ndarray, "count 3"] = seen[rng.choice(len(seen), count, replace=False)]
            return drawn
    raise UserError(
        f"{name}: {view.cameras} cameras of {side} pixels a side see {len(seen)} points of it, "
        f"not {count}: it is too thin; raise data.view.pixels or data.view.cameras, or leave it out"
    )


def spread_directions(count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    """Unit vectors that keep apart."""
    candidates = rng.normal(size=(8 * count, 3))
    candidates /= np.linalg.norm(candidates, axis=1, keepdims=True)
    chosen = [0]
    while len(chosen) < count:
        chosen.append(int((candidates @ candidates[chosen].T).max(1).argmin()))
    picked: Float[np.ndarray, "count 3"] = candidates[chosen]
    return picked


def _axes(direction: Float[np.ndarray, "3"], yaw: float) -> Float[np.ndarray, "3 3"]:
    """Right, up and towards the viewer as columns, for a camera in `direction` that is turned by `yaw`."""
    first = np.cross(np.eye(3)[np.abs(direction).argmin()], direction)
    first /= np.linalg.norm(first)
    second = np.cross(direction, first)
    right = np.cos(yaw) * first + np.sin(yaw) * second
    return np.column_stack([right, np.cross(direction, right), direction])


def _grid(pixels: int, distance: float) -> Float[np.ndarray, "rays 3"]:
    """Unit lines of sight through the pixels of a pinhole camera that looks along -z and sees a sphere whole."""
    half = MARGIN / np.sqrt(distance**2 - 1)  # the tangent of the sphere's half angle
    steps = (2 * (np.arange(pixels) + 0.5) / pixels - 1) * half
    x, y = np.meshgrid(steps, -steps)
    sight = np.stack([x.ravel(), y.ravel(), np.full(pixels**2, -1.0)], axis=1)
    unit: Float[np.ndarray, "rays 3"] = sight / np.linalg.norm(sight, axis=1, keepdims=True)
    return unit
