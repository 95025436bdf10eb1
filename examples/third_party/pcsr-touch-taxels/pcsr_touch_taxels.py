"""The touch source `taxels`: a round fingertip whose soft skin holds an array of resistive taxels.

A taxel says how far it gave way, so that a touch is a few contact points: one for each taxel that is pressed. The
figures are our own choice and no product's; README.md describes the model and what it leaves out.
"""

import math
from typing import Annotated

import numpy as np
from jaxtyping import Float
from pydantic import Field

from pcsr import Register, ShapeItem, Touch, TouchSource, UserError, hookimpl
from pcsr.geometry.rays import MeshRays

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=1)]


class Taxels(TouchSource):
    """Touches at random points of the surface.

    The pose of a touch maps the finger's frame to the object's. The finger's frame is in millimetres; its origin is the
    tip of the unpressed skin, and z points out of the object, along the finger.
    """

    def __init__(
        self,
        *,
        object_size: Positive | None = 60.0,
        radius: Positive = 8.0,
        cap: Annotated[float, Field(gt=0, lt=90)] = 60.0,
        pitch: Positive = 2.0,
        press: Positive = 1.0,
        least: NotNegative = 0.1,
        depth_noise: NotNegative = 0.1,
        tilt: NotNegative = 10.0,
        at_least: Count = 3,
        points: Count = 32,
        tries: Count = 100,
    ) -> None:
        """Choose the finger and how it is used; lengths in mm, angles in degrees.

        Args:
            object_size: longest side of the object's bounding box: the mesh is taken to be that large. None: the
                mesh's unit is the millimetre.
            radius: of the fingertip, a ball.
            cap: taxels cover the ball up to so far from its tip.
            pitch: between taxels, along the skin.
            press: how far the finger goes on after it has met the object.
            least: a taxel that is pressed in by less measures nothing.
            depth_noise: standard deviation of the measured depth of a taxel.
            tilt: standard deviation of the angle to the surface normal, which is never more than twice that.
            at_least: taxels that make a touch.
            points: of each touch: those of the taxels, repeated or drawn until there are so many.
            tries: contact points tried for each touch before giving up.

        Raises:
            UserError: a press that no taxel can measure.
        """
        if press <= least:
            raise UserError(
                f"touch 'taxels': press is {press} mm, but a taxel measures {least} mm or more: press deeper"
            )
        self.object_size, self.press, self.least, self.depth_noise = object_size, press, least, depth_noise
        self.tilt, self.at_least, self.points, self.tries = tilt, at_least, points, tries
        self.taxels, self.area = lay_out(radius, math.radians(cap), pitch)

    def touches(self, item: ShapeItem, cloud: Float[np.ndarray, "n 3"], count: int, seed: int) -> list[Touch]:
        """`count` touches, each with a random stream of its own, so that fewer are a prefix of more.

        Raises:
            UserError: the mesh has no surface, or a touch found no place in `tries`.
        """
        rays = MeshRays(item.mesh, self.object_size, item.name)
        found: list[Touch] = []
        for number in range(count):
            touch = self._touch(rays, np.random.default_rng((seed, number)))
            if touch is None:
                raise UserError(
                    f"{item.name}: touch 'taxels' found {number} of {count} touches, then none of {self.tries} points "
                    f"with {self.at_least} taxels in contact: raise object_size, lower at_least or leave the object out"
                )
            found.append(touch)
        return found

    def _touch(self, rays: MeshRays, rng: np.random.Generator) -> Touch | None:
        """One touch at the first point where enough taxels are pressed."""
        contacts, normals = rays.surface_points(self.tries, rng)
        for contact, normal in zip(contacts, normals, strict=True):
            frame = _frame(_tilted(normal, self.tilt, rng), rng)
            # How high the object stands at each taxel, along the finger; what is met first stops the finger.
            starts = contact + self.taxels[:, :2] @ frame[:, :2].T
            heights = rays.heights(starts, np.broadcast_to(frame[:, 2], starts.shape))
            tip = float((heights - self.taxels[:, 2]).max()) - self.press
            if not np.isfinite(tip):
                continue  # it came down beside the object
            depth = heights - self.taxels[:, 2] - tip
            pressed = depth > self.least
            if pressed.sum() < self.at_least:
                continue
            measured = depth[pressed] + rng.normal(0, self.depth_noise, int(pressed.sum()))
            local = self.taxels[pressed] + np.outer(measured, (0, 0, 1))
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = frame, contact + tip * frame[:, 2]
            pose = rays.to_object @ pose
            points = local @ pose[:3, :3].T + pose[:3, 3]
            area = float(self.area[pressed].sum())
            return Touch.single(points, pose, rays.unit, "taxels", area).resampled(self.points, rng)
        return None


def lay_out(
    radius: float, cap: float, pitch: float
) -> tuple[Float[np.ndarray, "taxels 3"], Float[np.ndarray, " taxels"]]:
    """Taxels in rings around the tip of a ball, each about `pitch` from the next along the skin.

    Args:
        radius: of the ball, in mm.
        cap: angle from the tip to the outermost ring's edge, in radians.
        pitch: in mm.

    Returns:
        Their positions in the finger's frame, in mm, and the part of the plane below that each covers, in mm².
    """
    rings = [(0.0, 1)]
    for number in range(1, int(cap * radius / pitch) + 1):
        angle = number * pitch / radius
        rings.append((angle, max(1, round(2 * math.pi * math.sin(angle) * radius / pitch))))
    angle = np.concatenate([np.full(many, angle) for angle, many in rings])
    # Every second ring is turned by half a taxel, so that no spokes arise.
    around = np.concatenate(
        [2 * np.pi * (np.arange(many) + number % 2 / 2) / many for number, (_, many) in enumerate(rings)]
    )
    ball = [np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), 1 - np.cos(angle)]
    return radius * np.stack(ball, axis=1), pitch**2 * np.cos(angle)


def _tilted(normal: Float[np.ndarray, "3"], tilt: float, rng: np.random.Generator) -> Float[np.ndarray, "3"]:
    """The normal, turned a little towards a random side; `tilt` in degrees."""
    angle = math.radians(float(np.clip(rng.normal(0, tilt), -2 * tilt, 2 * tilt)))
    side = _frame(normal, rng)[:, 0]
    return np.asarray(math.cos(angle) * normal + math.sin(angle) * side)


def _frame(axis: Float[np.ndarray, "3"], rng: np.random.Generator) -> Float[np.ndarray, "3 3"]:
    """Unit axes as columns: z is `axis`, x and y are turned at random."""
    x = np.cross(axis, rng.normal(size=3))
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


@hookimpl
def pcsr_register(register: Register) -> None:
    """Register the touch source."""
    register.touch("taxels", Taxels)
