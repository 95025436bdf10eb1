"""A DIGIT pressed onto the object, simulated by ray casting (TAPSR, Sec. 4.1; DIGIT: Lambeta et al., 2020).

Quasi-static, without a physics engine: the finger comes down along its axis onto a place of the surface, is
pressed a little further, and feels whatever then reaches into its gel. The gel is perfectly soft: it takes
the shape of what it touches and lifts off at once where nothing does. docs/touch.md says where the figures
come from.
"""

from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field
from scipy import ndimage
from scipy.spatial.transform import Rotation

from pcsr import Item, Touch, TouchSource, UserError
from pcsr_plugins.touch.rays import MeshRays

HOUSING = (27.0, 18.0)
"""Sides of the sensor's housing along the gel's width and height, in mm."""
PROTRUSION = 2.0
"""How far the gel stands out of the housing, in mm."""
CONTACT = (0.2, 0.05)
"""The camera sees contact from this share of the press on, and from this many mm on."""

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=1)]


class Digit(TouchSource):
    """Touches at random places of the surface, uniform by area.

    The pose of a touch maps the sensor's frame to the object's. The sensor's frame is in millimetres; its
    origin is the centre of the unpressed gel's face, x runs along the gel's width, y along its height, and z
    out of the object: the sensor looks along -z.
    """

    def __init__(
        self,
        *,
        object_size: Positive | None = 60.0,
        width: Positive = 16.0,
        height: Positive = 12.0,
        dome: tuple[Positive, Positive] | None = None,
        pixels: Count = 121,
        points: Count = 512,
        at_least: Count = 1000,
        press: tuple[Positive, Positive] = (0.5, 1.5),
        tilt: NotNegative = 5.0,
        depth_noise: NotNegative = 0.02,
        position_noise: NotNegative = 0.0,
        rotation_noise: NotNegative = 0.0,
        tries: Count = 100,
    ) -> None:
        """Describe the sensor and how it is used.

        Args:
            object_size: longest side of the object's bounding box, in mm: the mesh is taken to be that large.
                None: the mesh's unit is the millimetre.
            width: of the gel that the camera sees, in mm.
            height: of the same, in mm.
            dome: radii of the gel's face along its width and height, in mm; None: flat. A DIGIT: (50, 23).
            pixels: along the width; pixels are square.
            points: kept of each touch, drawn at random from the contact's pixels.
            at_least: pixels in contact that make a touch (TAPSR, Sec. 4.1).
            press: least and greatest depth that the finger is pressed, in mm.
            tilt: standard deviation of the angle between the sensor's axis and the surface normal, in
                degrees; the angle is never more than twice that.
            depth_noise: standard deviation of each point's height, in mm.
            position_noise: standard deviation of the pose's error along each axis, in mm.
            rotation_noise: standard deviation of the pose's error about each axis, in degrees.
            tries: places tried for each touch before giving up.

        Raises:
            UserError: `press` runs backwards, or fewer pixels make a touch than it keeps points.
        """
        if press[0] > press[1]:
            raise UserError(f"touch 'digit': press is {press}: give the least depth first")
        if at_least < points:
            raise UserError(
                f"touch 'digit': at_least is {at_least}, fewer than the {points} points kept: "
                f"raise it to {points} or more"
            )
        self.object_size = object_size
        self.points = points
        self.at_least = at_least
        self.press = press
        self.tilt = tilt
        self.depth_noise = depth_noise
        self.position_noise = position_noise
        self.rotation_noise = rotation_noise
        self.tries = tries
        self.pitch = width / pixels
        """Side of a pixel, in mm."""
        self.shape = (max(1, round(height / self.pitch)), pixels)
        """Rows and columns."""
        x, y = ((np.arange(n) - (n - 1) / 2) * self.pitch for n in reversed(self.shape))
        self.gel = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        """Centres of the pixels in the gel's plane, row by row, in mm."""
        self.sag = 0.0 if dome is None else (self.gel**2 / (2 * np.array(dome))).sum(1)
        """How far the gel's face falls behind its centre, in mm."""
        self.rim = _rim(width, height)

    def touches(self, item: Item, cloud: Float[np.ndarray, "n 3"], count: int, seed: int) -> list[Touch]:
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
                    f"{item.name}: touch 'digit' found {number} of {count} touches, then none of "
                    f"{self.tries} places was in reach and gave {self.at_least} pixels of contact; at "
                    f"{rays.size:.4g} mm the object is too small, thin or hollow for it: raise object_size, "
                    f"lower at_least or leave the object out"
                )
            found.append(touch)
        return found

    def _touch(self, rays: MeshRays, rng: np.random.Generator) -> Touch | None:
        """A touch at the first of `tries` random places that allows one."""
        places, normals = rays.places(self.tries, rng)
        frames = _frames(normals, self.tilt, rng)
        presses = rng.uniform(*self.press, self.tries)
        # Which side of a face is outside is asked of the rays: the faces of a careless mesh may be turned.
        above = rays.heights(places, frames[:, :, 2])
        below = rays.heights(places, -frames[:, :, 2])
        near = 1e-5 * rays.reach
        turned = np.abs(above) > near
        frames[turned] *= np.array([1.0, -1.0, -1.0])
        for k in np.flatnonzero(~turned | (np.abs(below) < near)):
            touch = self._press(rays, places[k], frames[k], float(presses[k]), rng)
            if touch is not None:
                return touch
        return None

    def _press(
        self,
        rays: MeshRays,
        place: Float[np.ndarray, "3"],
        frame: Float[np.ndarray, "3 3"],
        depth: float,
        rng: np.random.Generator,
    ) -> Touch | None:
        """Press here; None where the housing is in the way or too little is felt."""
        at = np.concatenate([self.gel, self.rim])
        axes = np.broadcast_to(frame[:, 2], (len(at), 3))
        heights = rays.heights(place + at @ frame[:, :2].T, axes)
        felt, beside = heights[: len(self.gel)], heights[len(self.gel) :]
        # What stands highest is met first, be it the place or not; from there on the gel is pressed.
        face = (felt - self.sag).max() - depth
        if not np.isfinite(face) or beside.max(initial=-np.inf) > face + PROTRUSION:
            return None
        contact = _contact((felt - self.sag - face).reshape(self.shape), max(CONTACT[0] * depth, CONTACT[1]))
        area = int(contact.sum())
        if area < self.at_least:
            return None

        chosen = rng.choice(np.flatnonzero(contact), self.points, replace=False)
        local = np.column_stack([self.gel[chosen], felt[chosen] - face])
        # Drawn whatever the noise, so that only the noise changes with it.
        local[:, 2] += rng.normal(size=len(local)) * self.depth_noise
        error = _matrix(
            Rotation.from_rotvec(rng.normal(size=3) * self.rotation_noise, degrees=True).as_matrix(),
            rng.normal(size=3) * self.position_noise,
        )
        # The pose is the one believed; the points are put where it says.
        pose = rays.to_object @ _matrix(frame, place + frame[:, 2] * face) @ error
        return Touch(local @ pose[:3, :3].T + pose[:3, 3], pose, "digit", area * self.pitch**2)


def _rim(width: float, height: float) -> Float[np.ndarray, "p 2"]:
    """Places on the housing around the gel, at most 1.5 mm apart, in mm."""
    x, y = (np.linspace(-side / 2, side / 2, round(side / 1.5) + 1) for side in HOUSING)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return grid[(np.abs(grid[:, 0]) > width / 2) | (np.abs(grid[:, 1]) > height / 2)]


def _frames(normals: Float[np.ndarray, "p 3"], tilt: float, rng: np.random.Generator) -> Float[np.ndarray, "p 3 3"]:
    """Sensor axes as columns: z along the normal but for a small tilt in a random direction; a random yaw."""
    angle = np.radians(np.clip(rng.normal(size=len(normals)), -2, 2) * tilt)[:, None]
    towards, yaw = rng.uniform(0, 2 * np.pi, (2, len(normals)))
    z = np.cos(angle) * normals + np.sin(angle) * _across(normals, towards)
    x = _across(z, yaw)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _across(axes: Float[np.ndarray, "p 3"], angles: Float[np.ndarray, " p"]) -> Float[np.ndarray, "p 3"]:
    """Unit vectors at right angles to unit vectors, turned about these by `angles`, in radians."""
    first = np.cross(np.eye(3)[np.abs(axes).argmin(1)], axes)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(axes, first)
    turned: Float[np.ndarray, "p 3"] = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
    return turned


def _contact(penetration: Float[np.ndarray, "rows columns"], least: float) -> Bool[np.ndarray, "rows columns"]:
    """Where the gel is pressed, as far as it is connected with the deepest point."""
    labels, _ = ndimage.label(penetration > least)
    deepest = np.unravel_index(np.argmax(penetration), penetration.shape)
    contact: Bool[np.ndarray, "rows columns"] = labels == labels[deepest]
    return contact


def _matrix(frame: Float[np.ndarray, "3 3"], origin: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
    matrix = np.eye(4)
    matrix[:3, :3] = frame
    matrix[:3, 3] = origin
    return matrix
