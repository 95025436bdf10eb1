"""One touch: the patch of surface that a fingertip touched, and the pose of the finger."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from pcsr.errors import UserError


@dataclass(frozen=True)
class Touch:
    """The touched points of one touch, in the object's frame and unit.

    Most touches are one finger's. A grasp is one touch too, of several fingers at once.
    """

    points: Float[np.ndarray, "m 3"]
    """Contact points in the object's frame and unit."""
    finger: Int[np.ndarray, " m"]
    """Which finger touched each point: an index into `poses`; all 0 where one finger touches."""
    poses: Float[np.ndarray, "fingers 4 4"]
    """For each finger, sensor to object: from millimetres in the sensor's frame to the object's frame and unit.

    A sensor's origin lies on its face, and it looks along its own -z. Empty where nobody recorded the poses.
    """
    unit: float
    """The object's unit in millimetres: 1000 where it is the metre."""
    sensor: str
    """Name of the sensor."""
    contact_area: float | None
    """Area of the contact in the planes of the gels, in square millimetres; None where nobody measured it."""

    @classmethod
    def single(
        cls,
        points: Float[np.ndarray, "m 3"],
        pose: Float[np.ndarray, "4 4"] | None,
        unit: float,
        sensor: str,
        contact_area: float | None = None,
    ) -> "Touch":
        """The usual case."""
        poses = np.zeros((0, 4, 4)) if pose is None else np.asarray(pose, np.float64)[None]
        return cls(np.asarray(points, np.float64), np.zeros(len(points), np.int64), poses, unit, sensor, contact_area)

    @classmethod
    def grasp(cls, fingers: Sequence["Touch"]) -> "Touch":
        """Several fingers at once: a grasp. Their units must be one.

        Raises:
            UserError: no finger at all, or fingers in different units.
        """
        if len({touch.unit for touch in fingers}) != 1:
            raise UserError(f"the fingers of a grasp need one unit, got {[touch.unit for touch in fingers]} mm")
        before = np.cumsum([0, *(max(1, len(touch.poses)) for touch in fingers)])
        areas = [touch.contact_area for touch in fingers if touch.contact_area is not None]
        return cls(
            points=np.concatenate([touch.points for touch in fingers]),
            finger=np.concatenate([touch.finger + first for touch, first in zip(fingers, before, strict=False)]),
            poses=np.concatenate([touch.poses for touch in fingers]),
            unit=fingers[0].unit,
            sensor="+".join(dict.fromkeys(touch.sensor for touch in fingers)),
            contact_area=sum(areas) if len(areas) == len(fingers) else None,
        )

    def resampled(self, count: int, rng: np.random.Generator) -> "Touch":
        """Exactly `count` of its points, drawn at random; where there are fewer, each is repeated equally often.

        Raises:
            UserError: it has no points.
        """
        n = len(self.points)
        if n == 0:
            raise UserError(f"a touch by '{self.sensor}' has no points: there is nothing to draw {count} from")
        drawn = np.concatenate([rng.permutation(n) for _ in range(-(-count // n))])[:count]
        return replace(self, points=self.points[drawn], finger=self.finger[drawn])


def coverage(touches: Sequence[Touch], area: float) -> float:
    """The share of an object's surface that its touches cover, from 0 to 1; what two of them cover counts once.

    A touch adds its contact area, less the share of its points that lie among those of an earlier touch. The
    contact is measured in the gel's plane, so that on slopes the coverage is a little low.

    Args:
        touches: of one object.
        area: the object's whole surface, in its own unit squared, as `trimesh.Trimesh.area` gives it.

    Raises:
        UserError: the contact area of a touch is unknown.
    """
    areas = np.array([_area(touch, index) for index, touch in enumerate(touches)])
    # A disc about each point, four times its share of the contact: gaps between points are rarer than 2 %, and the
    # contact grows by little.
    radii = [np.sqrt(4 * a / (np.pi * len(t.points))) / t.unit for a, t in zip(areas, touches, strict=True)]
    low = np.array([touch.points.min(0) - radius for touch, radius in zip(touches, radii, strict=True)])
    high = np.array([touch.points.max(0) + radius for touch, radius in zip(touches, radii, strict=True)])
    trees: dict[int, KDTree] = {}
    covered = 0.0
    for index, touch in enumerate(touches):
        new = touch.points
        over = (low[:index] <= new.max(0)) & (high[:index] >= new.min(0))
        overlapping = np.flatnonzero(over.all(1))
        # The nearest first: they are the likeliest to leave nothing new, and then the others need not be asked.
        middles = (low[overlapping] + high[overlapping]) / 2
        for earlier in overlapping[np.argsort(np.linalg.norm(middles - new.mean(0), axis=1), kind="stable")].tolist():
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
            f"the contact area of touch {index} by '{touch.sensor}' is not known: give it to get a coverage"
        )
    return touch.contact_area
