"""Simulated depth camera, which samples the visible surface of an object from one or more sides, with noise."""

import numpy as np
import trimesh
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.geometry.rays import MeshRays
from pcsr.recipe import View

MAX_DOUBLINGS = 3
"""Number of times that the resolution is doubled before an object is rejected as too thin."""
MAX_SIDE = 4096
"""Greatest width and height, in pixels, that doubling leads to."""
MARGIN = 1.02
"""Half width of the image, relative to that of the object's bounding sphere."""


def seen_points(
    mesh: trimesh.Trimesh, count: int, view: View, rng: np.random.Generator, name: str
) -> Float[np.ndarray, "count 3"]:
    """Sample points of a mesh that its cameras see, at random among the pixels whose rays meet it.

    Each camera stands `view.distance` radii from the centre of the object and looks at it. The direction of the first
    is random; that of each other is, among a few random ones, the farthest from those before. Pixels lie on a regular
    grid, so that slanted faces get fewer points, as with a real camera. Noise displaces points along their rays.

    Args:
        mesh: mesh of the object.
        count: number of points.
        view: number, distance, resolution and noise of the cameras.
        rng: source of randomness.
        name: name of the object in messages.

    Returns:
        Points in the mesh's frame and unit.

    Raises:
        UserError: fewer than `count` rays meet the mesh at the greatest resolution.
    """
    rays = MeshRays(mesh, None, name)
    corners = np.asarray(mesh.vertices, np.float64)[np.unique(mesh.faces)]
    centre = rays.to_object[:3, 3]
    radius = float(np.linalg.norm(corners - centre, axis=1).max())
    directions = spread_directions(view.cameras, rng)
    yaws = rng.uniform(0, 2 * np.pi, len(directions))
    sides = [view.pixels * 2**doublings for doublings in range(MAX_DOUBLINGS + 1)]
    for side in [side for side in sides if side <= max(view.pixels, MAX_SIDE)]:
        grid = _grid(side, view.distance)
        clouds = []
        for direction, yaw in zip(directions, yaws, strict=True):
            axes = _axes(direction, yaw)
            starts = np.broadcast_to(view.distance * radius * direction, grid.shape)
            sight = grid @ axes.T
            depths = rays.depths(starts, sight)
            met = np.isfinite(depths)
            noisy = depths[met] + rng.normal(size=int(met.sum())) * view.noise * radius
            clouds.append(starts[met] + sight[met] * noisy[:, None] + centre)
        seen = np.concatenate(clouds)
        if len(seen) >= count:
            drawn: Float[np.ndarray, "count 3"] = seen[rng.choice(len(seen), count, replace=False)]
            return drawn
    raise UserError(
        f"{name}: {view.cameras} cameras of {side} × {side} pixels see only {len(seen)} of {count} points: "
        f"it is too thin; raise data.view.pixels or data.view.cameras, or remove it"
    )


def spread_directions(count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    """Return unit vectors that point far apart, chosen among random ones."""
    candidates = rng.normal(size=(8 * count, 3))
    candidates /= np.linalg.norm(candidates, axis=1, keepdims=True)
    chosen = [0]
    while len(chosen) < count:
        chosen.append(int((candidates @ candidates[chosen].T).max(1).argmin()))
    picked: Float[np.ndarray, "count 3"] = candidates[chosen]
    return picked


def _axes(direction: Float[np.ndarray, "3"], yaw: float) -> Float[np.ndarray, "3 3"]:
    """Return the axes of a camera in `direction`, rotated by `yaw`, as columns: right, up, towards the camera."""
    first = np.cross(np.eye(3)[np.abs(direction).argmin()], direction)
    first /= np.linalg.norm(first)
    second = np.cross(direction, first)
    right = np.cos(yaw) * first + np.sin(yaw) * second
    return np.column_stack([right, np.cross(direction, right), direction])


def _grid(pixels: int, distance: float) -> Float[np.ndarray, "rays 3"]:
    """Return unit rays through the pixels of a pinhole camera that looks along -z at the unit sphere."""
    half = MARGIN / np.sqrt(distance**2 - 1)  # tangent of the half angle at which the sphere is seen
    steps = (2 * (np.arange(pixels) + 0.5) / pixels - 1) * half
    x, y = np.meshgrid(steps, -steps)
    sight = np.stack([x.ravel(), y.ravel(), np.full(pixels**2, -1.0)], axis=1)
    unit: Float[np.ndarray, "rays 3"] = sight / np.linalg.norm(sight, axis=1, keepdims=True)
    return unit
