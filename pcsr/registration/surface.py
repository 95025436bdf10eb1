"""Touched surface of one finger: a height field over the plane of the gel, with tangent planes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

NEIGHBOURS = 16
"""Number of touched points to which each tangent plane is fitted."""
INSIDE = 1.5
"""A place belongs to the contact if a touched point is closer than `INSIDE` spacings, in the plane of the gel."""
MOST_CELLS = 200
"""Largest number of cells of the grid along one side."""


@dataclass(frozen=True)
class TouchedSurface:
    """Height field of the points that one finger touched. Lengths are in millimetres."""

    origin: Float[np.ndarray, "3"]
    """Centroid of the points, in the frame of the touch."""
    axes: Float[np.ndarray, "3 3"]
    """Axes as columns, in the frame of the touch; the last is the direction out of the object."""
    oriented: bool
    """Whether the sign of the last axis is known."""
    flat: Float[np.ndarray, "m 2"]
    """Touched points in the plane."""
    planes: Float[np.ndarray, "m 3"]
    """Tangent plane at each point: height there, and slope along both axes."""
    normals: Float[np.ndarray, "m 3"]
    """Unit normals of the planes, in the frame of the touch."""
    noise: float
    """Standard deviation of the points from their planes."""
    spacing: float
    """Mean distance between neighbouring points in the plane."""
    corner: Float[np.ndarray, "2"]
    """Corner of the grid."""
    cell: float
    """Side of a cell."""
    nearest: Int[np.ndarray, "rows columns"]
    """Touched point nearest to each cell."""
    window: tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]] | None
    """Lowest and highest coordinates of what the sensor sees; None if they are unknown."""
    level: float
    """Height above which the sensor would have been touched beside the contact."""
    outside: Float[np.ndarray, "rows columns"]
    """Distance of each cell from the contact; 0 inside."""

    @classmethod
    def of(
        cls, points: Float[np.ndarray, "m 3"], axes: Float[np.ndarray, "3 3"], oriented: bool, margin: float, sensor=None
    ) -> "TouchedSurface":
        """Fit the surface of one finger.

        Args:
            points: touched points in the frame of the touch, (m 3).
            axes: axes as columns; the last points out of the object.
            oriented: whether the sign of the last axis is known.
            margin: width of the strip around the contact in which distances from it are known.
        """
        origin = points.mean(0)
        local = np.unique((points - origin) @ axes, axis=0)
        flat = local[:, :2]
        tree = cKDTree(flat)
        k = min(NEIGHBOURS, len(flat))
        index = tree.query(flat, k=range(1, k + 1))[1]
        extent = np.ptp(flat, axis=0)
        spacing = float(np.sqrt(max(np.prod(extent), 1e-12) / len(flat)))
        planes, residuals = _planes(local, index, spacing)
        normals = np.column_stack([-planes[:, 1:], np.ones(len(planes))])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        cell = max(spacing / 2, float((extent + 2 * margin).max()) / MOST_CELLS)
        corner = flat.min(0) - margin
        shape = np.ceil((extent + 2 * margin) / cell).astype(int) + 1
        x, y = (corner[side] + (np.arange(shape[side]) + 0.5) * cell for side in (0, 1))
        centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        away, nearest = tree.query(centres)
        window, level = None, np.inf
        if sensor is not None:
            face = (sensor[0] - origin) @ axes
            half = np.array(sensor[1]) / 2
            window = face[:2] - half, face[:2] + half
            heights = local[:, 2] - face[2]
            level = face[2] + min(np.quantile(heights, 0.02), 0.5 * heights.max())
        return cls(
            window=window,
            level=level,
            origin=origin,
            axes=axes,
            oriented=oriented,
            flat=flat,
            planes=planes,
            normals=normals @ axes.T,
            noise=residuals,
            spacing=spacing,
            corner=corner,
            cell=cell,
            nearest=nearest,
            outside=np.maximum(0.0, away - INSIDE * spacing),
        )

    @property
    def area(self) -> float:
        """Area of the contact in the plane of the gel, in square millimetres."""
        return float((self.outside == 0).sum()) * self.cell**2

    def distances(
        self, points: Float[np.ndarray, "*k 3"]
    ) -> tuple[Float[np.ndarray, "*k"], Float[np.ndarray, "*k 3"], Float[np.ndarray, "*k"], Float[np.ndarray, "*k"]]:
        """Compute where points lie relative to the touched surface.

        Args:
            points: in the frame of the touch.

        Returns:
            The signed distance from the nearest tangent plane, positive towards the finger; that plane's normal, in
            the frame of the touch; and the distance from the contact in the plane of the gel, infinite beyond the
            margin.
        """
        local = (points - self.origin) @ self.axes
        at = np.floor((local[..., :2] - self.corner) / self.cell)
        shape = self.nearest.shape
        known: Bool[np.ndarray, "*k"] = ((at >= 0) & (at < shape)).all(-1)
        row, column = np.where(known[..., None], at, 0).astype(np.int64).transpose(-1, *range(at.ndim - 1))
        index = self.nearest[row, column]
        plane = self.planes[index]
        offset = local[..., :2] - self.flat[index]
        height = local[..., 2] - plane[..., 0] - (offset * plane[..., 1:]).sum(-1)
        beside = np.zeros(known.shape, bool)
        if self.window is not None:
            flat = local[..., :2]
            beside = ((flat > self.window[0]) & (flat < self.window[1])).all(-1)
        distance = height / np.sqrt(1 + (plane[..., 1:] ** 2).sum(-1))
        return distance, self.normals[index], np.where(known, self.outside[row, column], np.inf), np.where(beside, local[..., 2] - self.level, -np.inf)


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
