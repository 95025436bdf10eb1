"""Touches: contact points and poses of the fingers, and the share of a surface that touches cover."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import KDTree

from pcsr.errors import UserError


@dataclass(frozen=True)
class Touch:
    """Contact points of one touch, by a single finger or by several fingers at once (a grasp).

    Examples:
        >>> points = np.array([[0.0, 0.0, 10.0], [1.0, 0.0, 10.0]])
        >>> left = Touch.single(points, pose=None, unit=1.0, sensor="digit", contact_area=2.5)
        >>> right = Touch.single(-points, pose=None, unit=1.0, sensor="digit", contact_area=2.0)
        >>> both = Touch.grasp([left, right])
        >>> both.finger
        array([0, 0, 1, 1])
    """

    points: Float[np.ndarray, "m 3"]
    """Contact points in the object's frame and unit."""
    finger: Int[np.ndarray, " m"]
    """Finger of each point, as an index into `poses`; 0 for a single finger."""
    poses: Float[np.ndarray, "fingers 4 4"]
    """Transform of each finger from the sensor's frame, in millimetres, to the object's frame and unit.

    The origin of a sensor lies on its face, and the sensor looks along its -z axis. Empty if the poses are unknown.
    """
    unit: float
    """The object's unit in millimetres, such as 1000 for the metre."""
    sensor: str
    """Name of the sensor."""
    contact_area: float | None
    """Area of the contact in the plane of the gel, summed over fingers, in square millimetres; None if unknown."""
    view: tuple[float, float] | None = None
    """Sides, along x and y in millimetres, of the part of a flat gel that each sensor sees, centred at its origin.

    None if that is unknown or the gel is curved. Beside the contact but in view the sensor touched nothing, which tells
    where the object ends.
    """
    errors: Float[np.ndarray, " m"] | None = None
    """Expected error of each point by the sensor, one standard deviation, in the object's unit; None if unknown.

    It does not contain the error of the pose.
    """

    @classmethod
    def single(
        cls,
        points: Float[np.ndarray, "m 3"],
        pose: Float[np.ndarray, "4 4"] | None,
        unit: float,
        sensor: str,
        contact_area: float | None = None,
        view: tuple[float, float] | None = None,
        errors: Float[np.ndarray, " m"] | None = None,
    ) -> "Touch":
        """Create the touch of a single finger.

        Args:
            points: contact points in the object's frame and unit.
            pose: transform from the sensor's frame, in millimetres, to the object's frame; None if unknown.
            unit: the object's unit in millimetres.
            sensor: name of the sensor.
            contact_area: area of the contact in square millimetres; None if unknown.
            view: sides of the part of a flat gel that the sensor sees, in millimetres; None if unknown.
            errors: expected error of each point by the sensor, in the object's unit; None if unknown.

        Examples:
            >>> touch = Touch.single(np.zeros((5, 3)), pose=np.eye(4), unit=1.0, sensor="digit")
            >>> touch.points.shape, touch.poses.shape, touch.finger
            ((5, 3), (1, 4, 4), array([0, 0, 0, 0, 0]))
        """
        poses = np.zeros((0, 4, 4)) if pose is None else np.asarray(pose, np.float64)[None]
        finger = np.zeros(len(points), np.int64)
        return cls(np.asarray(points, np.float64), finger, poses, unit, sensor, contact_area, view, errors)

    @classmethod
    def grasp(cls, fingers: Sequence["Touch"]) -> "Touch":
        """Combine the touches of several fingers into one grasp.

        The contact area is the sum of the fingers' areas, or None if one of them is unknown, and so are the errors of
        the points. The view is that of all fingers, or None if they differ.

        Args:
            fingers: at least one touch; all in the same unit.

        Raises:
            UserError: there is no finger, or the units differ.

        Examples:
            >>> thumb, index = (Touch.single(np.zeros((2, 3)), None, 1.0, "digit", area) for area in (2.0, 3.0))
            >>> Touch.grasp([thumb, index]).contact_area
            5.0
        """
        if len({touch.unit for touch in fingers}) != 1:
            raise UserError(f"the fingers of a grasp need the same unit, got {[touch.unit for touch in fingers]} mm")
        before = np.cumsum([0, *(max(1, len(touch.poses)) for touch in fingers)])
        errors = [touch.errors for touch in fingers if touch.errors is not None]
        areas = [touch.contact_area for touch in fingers if touch.contact_area is not None]
        return cls(
            points=np.concatenate([touch.points for touch in fingers]),
            finger=np.concatenate([touch.finger + first for touch, first in zip(fingers, before, strict=False)]),
            poses=np.concatenate([touch.poses for touch in fingers]),
            unit=fingers[0].unit,
            sensor="+".join(dict.fromkeys(touch.sensor for touch in fingers)),
            contact_area=sum(areas) if len(areas) == len(fingers) else None,
            view=fingers[0].view if len({touch.view for touch in fingers}) == 1 else None,
            errors=np.concatenate(errors) if len(errors) == len(fingers) else None,
        )

    def subset(self, rows: Int[np.ndarray, " k"] | Bool[np.ndarray, " m"]) -> "Touch":
        """Return the touch with some of its points.

        Args:
            rows: indices of the points, or a mask of them.

        Examples:
            >>> touch = Touch.single(np.arange(9.0).reshape(3, 3), None, 1.0, "digit")
            >>> touch.subset(np.array([2, 0])).points[:, 0]
            array([6., 0.])
        """
        errors = None if self.errors is None else self.errors[rows]
        return replace(self, points=self.points[rows], finger=self.finger[rows], errors=errors)

    def resampled(self, count: int, rng: np.random.Generator) -> "Touch":
        """Draw exactly `count` of the points at random.

        If there are fewer points, each is repeated, and the numbers of repetitions differ by at most one.

        Args:
            count: number of points of the result.
            rng: source of randomness.

        Raises:
            UserError: the touch has no points.

        Examples:
            >>> touch = Touch.single(np.zeros((5, 3)), None, 1.0, "digit")
            >>> touch.resampled(64, np.random.default_rng(0)).points.shape
            (64, 3)
        """
        n = len(self.points)
        if n == 0:
            raise UserError(f"a touch by '{self.sensor}' has no points: there is nothing to draw {count} from")
        drawn = np.concatenate([rng.permutation(n) for _ in range(-(-count // n))])[:count]
        return self.subset(drawn)


def covered_area_share(touches: Sequence[Touch], area: float) -> float:
    """Compute the share of an object's surface that is covered by at least one touch, from 0 to 1.

    Each touch adds its contact area, reduced by the share of its points that lie within an earlier touch. The contact
    area is measured in the plane of the gel, so that the result is slightly low on slopes.

    Args:
        touches: touches of one object.
        area: the object's surface area in its unit squared, such as `trimesh.Trimesh.area`.

    Raises:
        UserError: the contact area of a touch is unknown.

    Examples:
        >>> square = np.stack(np.meshgrid(np.arange(10.0), np.arange(10.0), [0.0]), axis=-1).reshape(-1, 3)
        >>> touch = Touch.single(square, None, unit=1.0, sensor="pad", contact_area=100.0)
        >>> covered_area_share([touch, touch], area=400.0)
        0.25
    """
    areas = np.array([_area(touch, index) for index, touch in enumerate(touches)])
    # Each point covers a disc of four times its share of the contact area. Gaps between the discs are then rarer than
    # 2 %, and the union of the discs is little larger than the contact.
    radii = [np.sqrt(4 * a / (np.pi * len(t.points))) / t.unit for a, t in zip(areas, touches, strict=True)]
    low = np.array([touch.points.min(0) - radius for touch, radius in zip(touches, radii, strict=True)])
    high = np.array([touch.points.max(0) + radius for touch, radius in zip(touches, radii, strict=True)])
    trees: dict[int, KDTree] = {}
    covered = 0.0
    for index, touch in enumerate(touches):
        new = touch.points
        overlaps = (low[:index] <= new.max(0)) & (high[:index] >= new.min(0))
        candidates = np.flatnonzero(overlaps.all(1))
        # The nearest touches first: they are the most likely to cover all points, which ends the search.
        centres = (low[candidates] + high[candidates]) / 2
        order = np.argsort(np.linalg.norm(centres - new.mean(0), axis=1), kind="stable")
        for earlier in candidates[order].tolist():
            if earlier not in trees:
                trees[earlier] = KDTree(touches[earlier].points)
            distance, _ = trees[earlier].query(new, distance_upper_bound=radii[earlier])
            new = new[~np.isfinite(distance)]
            if len(new) == 0:
                break
        covered += areas[index] / touch.unit**2 * len(new) / len(touch.points)
    return float(min(1.0, covered / area))


def _area(touch: Touch, index: int) -> float:
    if touch.contact_area is None:
        raise UserError(
            f"the contact area of touch {index} by '{touch.sensor}' is not known: give it to compute the covered area"
        )
    return touch.contact_area
