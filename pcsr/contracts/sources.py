"""The sources of training data: objects, and touches of them."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.contracts.part import Part
from pcsr.contracts.policy import Fingertip
from pcsr.errors import UserError

if TYPE_CHECKING:
    import trimesh  # it imports a ray caster and a solid modeller, which networks do not need


SPLITS = ("train", "validation", "test")
"""The splits of a data set."""


@dataclass(frozen=True)
class ShapeItem:
    """One object: a mesh in its own frame and unit.

    Examples:
        >>> import trimesh
        >>> item = pcsr.ShapeItem("box", group="boxes", mesh=trimesh.creation.box())
        >>> item.mesh.is_watertight
        True
    """

    name: str
    """Name of the object: unique within its `ShapeSource`, and the same on every machine."""
    group: str
    """Name that variants of one object share: of a family, a product line or a source file."""
    mesh: "trimesh.Trimesh"
    """Surface of the object."""


class ShapeSource(Part):
    """Provides the objects of a data set.

    A source is pickled and sent to the worker processes, which load one object each by name. Constructing and pickling
    it must be cheap.

    Examples:
        >>> import trimesh
        >>> class Balls(pcsr.ShapeSource):
        ...     def names(self, split):
        ...         return [f"{split}/{number}" for number in range(2)]
        ...
        ...     def item(self, name):
        ...         return pcsr.ShapeItem(name, group=name, mesh=trimesh.creation.icosphere())
        >>> Balls().names("test")
        ['test/0', 'test/1']
    """

    def names(self, split: str) -> Sequence[str]:
        """List the objects of a split.

        Args:
            split: "train", "validation" or "test".

        Returns:
            Names in a fixed order. No name is in two splits.
        """
        raise NotImplementedError

    def item(self, name: str) -> ShapeItem:
        """Load or generate one object.

        Raises:
            UserError: the object cannot be used; the message names the object and says why.
        """
        raise NotImplementedError

    def digest(self, name: str) -> str:
        """Identify the contents of an object, wherever its files lie.

        By default this is a hash of the mesh, or the reason for which it cannot be loaded. Override it where a cheaper
        identification exists, such as the hash of a file.

        Returns:
            A text that changes when the object does, and only then.
        """
        try:
            mesh = self.item(name).mesh
        except UserError as error:
            return f"refused: {error}"
        arrays = (np.ascontiguousarray(mesh.vertices, np.float64), np.ascontiguousarray(mesh.faces, np.int64))
        return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


class SimulatedFinger:
    """Finger that touches one object at given poses, as a robot would.

    Examples:
        >>> class Point(pcsr.SimulatedFinger):
        ...     unit = 1.0
        ...
        ...     def touch(self, pose, rng):
        ...         return pcsr.Touch.single(pose[:3, 3][None], pose, unit=1.0, sensor="point")
        >>> len(Point().touch(np.eye(4), np.random.default_rng(0)).points)
        1
    """

    unit: float
    """Unit of the object in mm."""

    def touch(self, pose: Float[np.ndarray, "4 4"], rng: np.random.Generator) -> Touch | None:
        """Approach the object along the axis of the sensor from far outside, and press.

        Args:
            pose: from mm in the frame of the sensor to the frame and unit of the object. Where it lies on its axis does
                not matter: the finger stops where it meets the object.
            rng: source of the noise.

        Returns:
            The touch, or None where the housing is in the way, or nothing is met.
        """
        raise NotImplementedError


class TouchSource(Part):
    """Provides touches of an object, simulated or recorded.

    Examples:
        >>> class Corner(pcsr.TouchSource):
        ...     def touches(self, item, cloud, count, seed):
        ...         corner = np.asarray(item.mesh.vertices[:1])
        ...         return [pcsr.Touch.single(corner, None, unit=1.0, sensor="point")] * count
        >>> import trimesh
        >>> item = pcsr.ShapeItem("box", "boxes", trimesh.creation.box())
        >>> len(Corner().touches(item, np.zeros((1, 3)), count=2, seed=0))
        2
    """

    def touches(self, item: ShapeItem, cloud: Float[np.ndarray, "n 3"], count: int, seed: int) -> list[Touch]:
        """Touch an object.

        The result is a function of the arguments, and the touches of a smaller `count` are the first of a larger one.

        Args:
            item: the object.
            cloud: the part of its surface that the camera sees, (n 3).
            count: number of touches.
            seed: of the random choices.

        Returns:
            `count` touches in the frame and unit of the object, all with the same number of points.

        Raises:
            UserError: the object cannot be touched `count` times; the message names the object and says why.
        """
        raise NotImplementedError

    def digest(self, name: str) -> str:
        """Identify whatever determines the touches of an object besides the options, such as its recording.

        By default this is empty: a simulation depends on its options and the seed alone.
        """
        return ""

    def pose_error(self, name: str) -> PoseError | None:
        """Return the error of the poses of an object's touches; None, the default, if it is unknown."""
        return None

    def fingertip(self) -> Fingertip | None:
        """Return the outline of the sensor; None, the default, if it is unknown."""
        return None

    def finger(self, item: ShapeItem) -> "SimulatedFinger | None":
        """Return a finger that touches an object at given poses; None, the default, if the source has none.

        Raises:
            UserError: the object cannot be touched.
        """
        return None
