"""A DIGIT pressed onto the object, simulated by ray casting (TAPSR, Sec. 4.1; DIGIT: Lambeta et al., 2020).

Quasi-static, no physics engine: a finger comes down along its axis onto a place of the surface, is pressed
0.5 to 1.5 mm further, and feels whatever then reaches into its gel. The gel is flat and perfectly soft: it takes
the shape of what it touches and lifts off at once where nothing does.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage
from scipy.spatial.transform import Rotation

from pcsr import Item, Touch, TouchSource, UserError
from pcsr_plugins.touch.rays import MeshRays

HOUSING = (27.0, 18.0)
"""Width and height of the sensor's housing, in mm."""
PROTRUSION = 2.0
"""How far the gel stands out of the housing, in mm."""
LEAST_PENETRATION = 0.05
"""Below this, in mm, or a fifth of the press, the camera sees no contact."""


class Digit(TouchSource):
    """Touches at random places of the surface, uniform by area."""

    def __init__(
        self,
        *,
        object_size: float = 60.0,
        width: float = 16.0,
        height: float = 12.0,
        pixels: int = 121,
        points: int = 512,
        at_least: int = 1000,
        press: tuple[float, float] = (0.5, 1.5),
        tilt: float = 5.0,
        depth_noise: float = 0.02,
        pose_noise: float = 0.0,
        tries: int = 100,
    ) -> None:
        """Describe the sensor and how it is used.

        Args:
            object_size: the longest side of the object's bounding box, in mm: the mesh is taken to be that large.
            width: of the gel that the camera sees, in mm.
            height: of the same, in mm.
            pixels: along the width; pixels are square.
            points: kept of each touch, drawn at random.
            at_least: contact pixels that make a touch (TAPSR, Sec. 4.1).
            press: least and greatest depth, in mm.
            tilt: standard deviation of the angle between the sensor's axis and the surface normal, in degrees.
            depth_noise: standard deviation of each point's height, in mm.
            pose_noise: standard deviation of the sensor's unnoticed displacement along each axis, in mm.
            tries: places tried for each touch before giving up.
        """
        if at_least < points:
            raise UserError(f"touch 'digit': at_least is {at_least}, fewer than the {points} points kept: raise it")
        self.object_size = object_size
        self.points = points
        self.at_least = at_least
        self.press = press
        self.tilt = tilt
        self.depth_noise = depth_noise
        self.pose_noise = pose_noise
        self.tries = tries
        self.pitch = width / pixels
        self.rows = max(1, round(height / self.pitch))
        self.columns = pixels

    def touches(self, item: Item, cloud: Float[np.ndarray, "n 3"], count: int, seed: int) -> list[Touch]:
        """`count` touches, each with a random stream of its own, so that fewer are a prefix of more."""
        rays = MeshRays(item.mesh, self.object_size, item.name)
        found: list[Touch] = []
        for number in range(count):
            rng = np.random.default_rng((seed, number))
            touch = next(filter(None, (self._try(rays, rng) for _ in range(self.tries))), None)
            if touch is None:
                raise UserError(
                    f"{item.name}: {number} of {count} touches found, then none of {self.tries} places gave "
                    f"{self.at_least} contact pixels: the object is too thin, rough or hidden for the sensor at "
                    f"{self.object_size:g} mm; lower at_least or raise object_size"
                )
            found.append(touch)
        return found

    def _try(self, rays: MeshRays, rng: np.random.Generator) -> Touch | None:
        """One place; None if the finger can't get there or feels too little."""
        place, normal = rays.place(rng)
        frame = _frame(normal, self.tilt, rng)
        depth = float(rng.uniform(*self.press))
        gel = _grid(self.columns, self.rows, self.pitch)
        rim = _rim(self.columns * self.pitch, self.rows * self.pitch)
        height = rays.heights(place, frame, np.concatenate([gel, rim]))
        felt = height[: len(gel)].reshape(self.rows, self.columns)
        peak = felt.max()
        centre = felt[self.rows // 2, self.columns // 2]
        # The finger comes from outside: whatever stands higher stops it before it reaches the place.
        if not np.isfinite(peak) or not np.isfinite(centre) or abs(centre) > self.pitch + 0.1:
            return None
        surface = peak - depth  # height of the gel's face when pressed
        if height[len(gel) :].max(initial=-np.inf) > surface + PROTRUSION:
            return None
        contact = _contact(felt - surface, max(0.2 * depth, LEAST_PENETRATION))
        if contact.sum() < self.at_least:
            return None
        return self._touch(rays, place, frame, gel, felt, surface, contact, rng)

    def _touch(
        self,
        rays: MeshRays,
        place: Float[np.ndarray, "3"],
        frame: Float[np.ndarray, "3 3"],
        gel: Float[np.ndarray, "p 2"],
        felt: Float[np.ndarray, "rows columns"],
        surface: float,
        contact: Bool[np.ndarray, "rows columns"],
        rng: np.random.Generator,
    ) -> Touch:
        chosen = rng.choice(np.flatnonzero(contact), self.points, replace=False)
        local = np.column_stack([gel[chosen], felt.ravel()[chosen] - surface])
        local[:, 2] += rng.normal(0, 1, len(local)) * self.depth_noise
        local += rng.normal(0, 1, 3) * self.pose_noise
        pose = rays.to_object @ _matrix(frame, place + frame[:, 2] * surface)
        return Touch(
            points=local @ pose[:3, :3].T + pose[:3, 3],
            pose=pose,
            sensor="digit",
            contact_area=float(contact.sum()) * self.pitch**2,
        )


def _grid(columns: int, rows: int, pitch: float) -> Float[np.ndarray, "p 2"]:
    """Pixel centres in the gel's plane, row by row."""
    x = (np.arange(columns) - (columns - 1) / 2) * pitch
    y = (np.arange(rows) - (rows - 1) / 2) * pitch
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _rim(width: float, height: float) -> Float[np.ndarray, "p 2"]:
    """Places on the housing around the gel, 1.5 mm apart."""
    x, y = (np.linspace(-side / 2, side / 2, round(side / 1.5) + 1) for side in HOUSING)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return grid[(np.abs(grid[:, 0]) > width / 2) | (np.abs(grid[:, 1]) > height / 2)]


def _frame(normal: Float[np.ndarray, "3"], tilt: float, rng: np.random.Generator) -> Float[np.ndarray, "3 3"]:
    """The sensor's axes as columns: z points out of the object, tilted a little; x and y at a random yaw."""
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    x = np.cross(helper, normal)
    x /= np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(normal, x), normal])
    yaw = Rotation.from_euler("z", rng.uniform(0, 360), degrees=True)
    lean = Rotation.from_euler("xy", rng.normal(0, 1, 2) * tilt, degrees=True)
    turned: Float[np.ndarray, "3 3"] = frame @ (yaw * lean).as_matrix()
    return turned


def _contact(
    penetration: Float[np.ndarray, "rows columns"], least: float
) -> Bool[np.ndarray, "rows columns"]:
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
