"""Contact of a fingertip as it is expected from points of the surface."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import Delaunay, KDTree, QhullError
from scipy.special import expit

from pcsr.contracts import Fingertip
from pcsr.sensors.contact import CONTACT_SHARE

CELLS = 16
"""Cells of the gel along its longer side, in which contact is expected or not."""
BESIDE = 4.0
"""Points up to this distance beside the gel take part in the interpolation, in mm."""
BELOW = 0.5
"""Points up to this depth below the highest one take part, in mm: deeper ones belong to other surfaces."""
LONGEST = 4.0
"""Longest edge of a triangle across which the surface continues, in spacings at its corners."""
ALONE = 0.6
"""Up to this distance from a point, in its spacings, the surface continues beyond its outline."""
SOFTNESS = 0.3
"""Height in mm over which the probability of contact rises, since heights between points are uncertain."""


@dataclass(frozen=True)
class ExpectedContact:
    """Expected contact of one candidate, in cells of the gel that may touch the surface."""

    points: Float[np.ndarray, "c 3"]
    """Centres of the cells on the surface, in mm, in the frame of the cloud."""
    probability: Float[np.ndarray, " c"]
    """Probability of contact of each cell."""
    cell: float
    """Area of a cell in mm²."""
    top: float
    """Height of the highest point under the gel above the candidate's point, along the axis of the sensor, in mm."""

    @property
    def area(self) -> float:
        """Expected area of the contact in mm²."""
        return float(self.probability.sum()) * self.cell


@dataclass(frozen=True)
class ContactModel:
    """Points of the surface, known and guessed, on which fingertips are pressed."""

    points: Float[np.ndarray, "n 3"]
    spacing: Float[np.ndarray, " n"]
    """Mean distance of each point to its four nearest."""

    @classmethod
    def of(cls, points: Float[np.ndarray, "n 3"]) -> "ContactModel":
        """Create the model of at least five points, in mm."""
        return cls(points, KDTree(points).query(points, k=5)[0][:, 1:].mean(1))

    def press(
        self, point: Float[np.ndarray, "3"], frame: Float[np.ndarray, "3 3"], press: float, fingertip: Fingertip
    ) -> ExpectedContact | None:
        """Return the expected contact of a fingertip that comes down along the axis through a point.

        Heights between the points are interpolated on triangles. The face comes to rest `press` below the highest
        point under the gel, and touches what is indented by more than `CONTACT_SHARE` of the press.

        Args:
            point: point on the axis of the sensor.
            frame: axes of the sensor as columns; z points away from the object.
            press: depth in mm.
            fingertip: outline of the sensor.

        Returns:
            None if there is no point under the gel.
        """
        local = (self.points - point) @ frame
        half = np.array(fingertip.gel) / 2
        near = (np.abs(local[:, :2]) < half + BESIDE).all(1)
        local, spacing = local[near], self.spacing[near]
        under = (np.abs(local[:, :2]) < half).all(1)
        if not under.any():
            return None
        top = float(local[under, 2].max())
        upper = local[:, 2] > top - BELOW - press
        local, spacing = local[upper], spacing[upper]
        grid, cell = _cells(fingertip)
        heights = _heights(local, spacing, grid)
        hit = np.isfinite(heights)
        probability = expit((heights[hit] - (top - (1 - CONTACT_SHARE) * press)) / SOFTNESS)
        points = np.column_stack([grid[hit], heights[hit]]) @ frame.T + point
        return ExpectedContact(points, probability, cell, top)


def _cells(fingertip: Fingertip) -> tuple[Float[np.ndarray, "c 2"], float]:
    """Return the centres of the gel's cells in its own frame, and the area of one, in mm and mm²."""
    pitch = max(fingertip.gel) / CELLS
    counts = [max(1, round(side / pitch)) for side in fingertip.gel]
    x, y = (((np.arange(n) + 0.5) / n - 0.5) * side for n, side in zip(counts, fingertip.gel, strict=True))
    area = fingertip.gel[0] * fingertip.gel[1] / (counts[0] * counts[1])
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), area


def _heights(
    points: Float[np.ndarray, "n 3"], spacing: Float[np.ndarray, " n"], grid: Float[np.ndarray, "c 2"]
) -> Float[np.ndarray, " c"]:
    """Interpolate the heights of points at a grid; -inf where the surface does not continue between them."""
    heights = np.full(len(grid), -np.inf)
    if len(points) > 3:
        try:
            mesh = Delaunay(points[:, :2], qhull_options="QJ Qbb Qc")
        except QhullError:  # all in a row
            mesh = None
        if mesh is not None:
            corners = points[mesh.simplices]
            longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)
            whole = longest < LONGEST * spacing[mesh.simplices].max(1)
            inside = mesh.find_simplex(grid)
            rows = np.flatnonzero((inside >= 0) & whole[inside])
            triangles = inside[rows]
            affine = mesh.transform[triangles]
            two = np.einsum("cij,cj->ci", affine[:, :2], grid[rows] - affine[:, 2])
            weights = np.column_stack([two, 1 - two.sum(1)])
            heights[rows] = np.nan_to_num((weights * corners[triangles][:, :, 2]).sum(1), nan=-np.inf)
    distance, nearest = KDTree(points[:, :2]).query(grid)
    beside = ~np.isfinite(heights) & (distance < ALONE * spacing[nearest])
    heights[beside] = points[nearest[beside], 2]
    return heights
