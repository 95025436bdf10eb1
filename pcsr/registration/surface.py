"""Touched surface of one finger: a height field over the plane of the gel, with tangent planes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

NEIGHBOURS = 16
"""Number of touched points to which each tangent plane is fitted."""
INSIDE = 1.5
"""A place belongs to the contact if a touched point is closer than `INSIDE` spacings, in the plane of the gel."""
MOST_POINTS = 2048
"""Largest number of touched points that the surface is fitted to; of more a random part is taken."""
MOST_CELLS = 160
"""Largest number of cells of the grid along one side."""
SLOPE = 0.5
"""Growth of the surface's deviation beyond the contact, where it is extrapolated, per unit of length."""
LOWEST = 0.02
"""Share of the touched points below the height that counts as that of the contact's border."""
BORDER = 0.5
"""Height of the contact's border in a flat contact, as a share of its greatest height above the sensor's face."""


@dataclass(frozen=True)
class View:
    """What a sensor sees: a rectangle of its face, in the frame of the touch. Lengths are in millimetres."""

    centre: Float[np.ndarray, "3"]
    """Centre of the unpressed face."""
    sides: tuple[float, float]
    """Sides of the rectangle along the first two axes."""


@dataclass(frozen=True)
class Planes:
    """Tangent planes at points, and where those points lie relative to them."""

    height: Float[np.ndarray, "*k"]
    """Height of the point above the plane, along the last axis."""
    slope_x: Float[np.ndarray, "*k"]
    slope_y: Float[np.ndarray, "*k"]
    flatness: Float[np.ndarray, "*k"]
    """Squared cosine of the plane's slope: 1 / (1 + slope_x² + slope_y²)."""
    widening: Float[np.ndarray, "*k"]
    """Variance of the plane beyond the contact, where it is extrapolated: 0 inside, infinite where there is none."""
    level: Float[np.ndarray, "*k"]
    """Coordinate above which there was the finger; minus infinity inside the contact, where the plane itself is it."""


@dataclass(frozen=True)
class TouchedSurface:
    """Height field of the points that one finger touched. Lengths are in millimetres."""

    origin: Float[np.ndarray, "3"]
    """Centroid of the points, in the frame of the touch."""
    axes: Float[np.ndarray, "3 3"]
    """Axes as columns, in the frame of the touch; the last is the direction out of the object."""
    oriented: bool
    """Whether the sign of the last axis is known."""
    noise: float
    """Standard deviation of the touched points from their tangent planes."""
    area: float
    """Area of the contact in the plane of the gel."""
    corner: Float[np.ndarray, "2"]
    """Corner of the grid."""
    cell: float
    """Side of a cell."""
    shape: tuple[int, int]
    """Number of cells along both axes."""
    table: Float[np.ndarray, "cells 6"]
    """For each cell the plane z = a + b x + c y as a, b and c; then `Planes.flatness`, `widening` and `level`."""
    outside: Float[np.ndarray, " cells"]
    """Distance of each cell from the contact in the plane of the gel; 0 inside, infinite beyond the margin."""

    @classmethod
    def of(
        cls,
        points: Float[np.ndarray, "m 3"],
        axes: Float[np.ndarray, "3 3"],
        margin: float,
        *,
        oriented: bool,
        view: View | None = None,
    ) -> "TouchedSurface":
        """Fit the surface of one finger.

        Args:
            points: touched points in the frame of the touch, (m 3).
            axes: axes as columns; the last points out of the object.
            margin: width of the strip around the contact in which distances from it are known.
            oriented: whether the sign of the last axis is known.
            view: what the sensor sees; None if that is unknown.
        """
        origin = points.mean(0)
        some = np.random.default_rng(0).permutation(len(points))[:MOST_POINTS]
        local = np.unique((points[some] - origin) @ axes, axis=0)
        tree = cKDTree(local[:, :2])
        extent = np.ptp(local[:, :2], axis=0)
        spacing = float(np.sqrt(max(np.prod(extent), 1e-12) / len(local)))
        index = tree.query(local[:, :2], k=range(1, min(NEIGHBOURS, len(local)) + 1))[1]
        planes, noise = _planes(local, index, spacing)
        cell = max(spacing / 2, float((extent + 2 * margin).max()) / MOST_CELLS)
        corner = local[:, :2].min(0) - margin
        shape = np.ceil((extent + 2 * margin) / cell).astype(int) + 1
        x, y = (corner[side] + (np.arange(shape[side]) + 0.5) * cell for side in (0, 1))
        centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        away, nearest = tree.query(centres)
        outside = np.maximum(0.0, away - INSIDE * spacing)
        outside[[0, -1]] = outside[:, [0, -1]] = np.inf
        inside = outside == 0
        widening = (SLOPE * outside) ** 2
        level = np.where(inside, -np.inf, np.inf)
        if view is not None:
            face = (view.centre - origin) @ axes
            half = np.array(view.sides) / 2
            seen = (np.abs(centres - face[:2]) < half).all(-1)
            heights = local[:, 2] - face[2]
            level[seen & ~inside] = face[2] + min(np.quantile(heights, LOWEST), BORDER * heights.max())
            # The sensor saw that the surface is not where the contact would continue.
            widening[seen & ~inside] = np.inf
        plane = planes[nearest]
        constant = plane[..., 0] - (plane[..., 1:] * local[nearest, :2]).sum(-1)
        flatness = 1 / (1 + (plane[..., 1:] ** 2).sum(-1))
        table = np.stack([constant, plane[..., 1], plane[..., 2], flatness, widening, level], axis=-1)
        area = float(inside.sum()) * cell**2
        size = int(shape[0]), int(shape[1])
        return cls(
            origin, axes, oriented, noise, area, corner, cell, size, table.reshape(-1, table.shape[-1]), outside.ravel()
        )

    def find(self, points: Float[np.ndarray, "*k 3"]) -> tuple[Float[np.ndarray, "*k"], Float[np.ndarray, "*k"]]:
        """Compute where points lie relative to the touched surface.

        Args:
            points: in the frame of the touch.

        Returns:
            The signed distance from the nearest tangent plane, positive towards the finger; and the distance from the
            contact in the plane of the gel: 0 inside, infinite beyond the margin.
        """
        x, y, z = np.moveaxis((points - self.origin) @ self.axes, -1, 0)
        planes = self.planes(x, y, z)
        return planes.height * np.sqrt(planes.flatness), self.outside[self._cells(x, y)]

    def planes(self, x: Float[np.ndarray, "*k"], y: Float[np.ndarray, "*k"], z: Float[np.ndarray, "*k"]) -> Planes:
        """Look up the nearest tangent plane of each point.

        Args:
            x: first coordinate along the axes of the surface, from its origin.
            y: second coordinate.
            z: third coordinate.
        """
        constant, slope_x, slope_y, flatness, widening, level = np.moveaxis(
            self.table.take(self._cells(x, y), axis=0), -1, 0
        )
        return Planes(z - constant - slope_x * x - slope_y * y, slope_x, slope_y, flatness, widening, level)

    def _cells(self, x: Float[np.ndarray, "*k"], y: Float[np.ndarray, "*k"]) -> Int[np.ndarray, "*k"]:
        """Return the number of the cell of each point, of the nearest cell for points beyond the grid."""
        row = np.clip((x - self.corner[0]) / self.cell, 0, self.shape[0] - 1).astype(np.int64)
        column = np.clip((y - self.corner[1]) / self.cell, 0, self.shape[1] - 1).astype(np.int64)
        cells: Int[np.ndarray, "*k"] = row * self.shape[1] + column
        return cells


def _planes(
    local: Float[np.ndarray, "m 3"], index: Int[np.ndarray, "m k"], spacing: float
) -> tuple[Float[np.ndarray, "m 3"], float]:
    """Fit a plane z = a + b x + c y around each point, and return the planes and the deviation from them."""
    around = local[index] - np.concatenate([local[:, None, :2], np.zeros((len(local), 1, 1))], axis=2)
    design = np.concatenate([np.ones((*index.shape, 1)), around[..., :2] / spacing], axis=2)
    normal = design.transpose(0, 2, 1) @ design + 1e-6 * np.eye(3)
    fitted = np.linalg.solve(normal, design.transpose(0, 2, 1) @ around[..., 2:])[..., 0]
    residual = around[..., 2] - (design @ fitted[..., None])[..., 0]
    freedom = max(1, index.shape[1] - 3)
    deviation = float(np.sqrt(np.median((residual**2).sum(1) / freedom)))
    return fitted / np.array([1.0, spacing, spacing]), deviation
