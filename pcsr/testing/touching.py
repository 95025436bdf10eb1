"""Checks of touch sources, on the suite's object or a given one."""

from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float

from pcsr.clouds.touch import Touch
from pcsr.contracts import ShapeItem
from pcsr.errors import UserError
from pcsr.geometry.sampling import surface_points
from pcsr.metrics.p2f import point_to_surface
from pcsr.testing.subject import Subject, pickled

SEEN = 256
"""Number of points of the cloud that a source is given."""
COUNT = 3
"""Number of touches that are requested."""
MAX_DISTANCE = 0.1
"""Largest median distance of a touch's points from the surface, in radii of the object."""


def egg() -> ShapeItem:
    """Create the suite's object: 60 mm long, watertight, curved, and far from the origin of its frame."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    mesh.apply_scale([30.0, 22.0, 16.0])
    mesh.apply_translation([400.0, -250.0, 600.0])
    return ShapeItem("egg", "egg", mesh)


def touches(subject: Subject) -> None:
    """The requested number of touches is returned, all with the same number of points, on the surface of the object."""
    item = subject.item or egg()
    for count in (0, 1, COUNT):
        found = _touch(subject, count)
        if not isinstance(found, list) or len(found) != count or not all(isinstance(one, Touch) for one in found):
            raise subject.failure(
                f"{count} touches were requested, and it returned {found!r:.200}",
                f"a list of {count} pcsr.Touch",
                "raise a UserError where the object cannot be touched that often",
            )
        for number, touch in enumerate(found):
            _sound(subject, item, number, touch)
        sizes = {len(touch.points) for touch in found}
        if len(sizes) > 1:
            raise subject.failure(
                f"its touches have {sorted(sizes)} points",
                "touches of one size, since a batch holds them in one tensor",
                "draw equally many of each: Touch.resampled(count, rng)",
            )


def _sound(subject: Subject, item: ShapeItem, number: int, touch: Touch) -> None:
    """Raises CheckFailed for a touch that cannot be one of this object."""
    points, finger, poses = touch.points, touch.finger, touch.poses
    if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
        raise subject.failure(
            f"the points of touch {number} have the shape {points.shape}, or are not finite",
            "(m, 3), m above 0, finite",
            "raise a UserError where the sensor touched nothing",
        )
    fingers = max(1, len(poses))
    if finger.shape != (len(points),) or finger.min() < 0 or finger.max() >= fingers:
        raise subject.failure(
            f"touch {number} has {len(points)} points, and for {finger.shape} of them the fingers {np.unique(finger)}",
            f"for each point an index below {fingers}",
            "use Touch.single and Touch.grasp",
        )
    radius = float(np.linalg.norm(item.mesh.vertices - item.mesh.vertices.mean(0), axis=1).max())
    away = float(np.median(point_to_surface(points, np.asarray(item.mesh.vertices), np.asarray(item.mesh.faces))))
    if away > MAX_DISTANCE * radius:
        raise subject.failure(
            f"touch {number} lies {away / radius:.3g} radii off the surface of '{item.name}'",
            "points on the surface",
            "give them in the frame and unit of item.mesh",
        )
    if not (np.isfinite(touch.unit) and touch.unit > 0) or not touch.sensor:
        raise subject.failure(
            f"touch {number} has the unit {touch.unit!r} and the sensor {touch.sensor!r}",
            "the object's unit in millimetres, and a name",
            "fill in both",
        )


def repeatable(subject: Subject) -> None:
    """The same arguments give the same touches, from the same instance, another one and a pickled copy."""
    source = subject.built()
    found = _touch(subject, COUNT, source)
    for what, other in (
        ("itself", source),
        ("another instance", subject.built()),
        ("a pickled copy", pickled(source)),
    ):
        if not _same(found, _touch(subject, COUNT, other)):
            raise subject.failure(
                f"{what} gives other touches for the same arguments",
                "the same touches",
                "draw with numpy.random.default_rng((seed, number)) alone",
            )
    for name in ("egg", "egg/other"):
        digest, again = source.digest(name), pickled(source).digest(name)
        if not isinstance(digest, str) or digest != again:
            raise subject.failure(
                f"its digest of '{name}' is {digest!r}, then {again!r}", "one text", "let it depend on contents alone"
            )


def prefix(subject: Subject) -> None:
    """Fewer touches are the first ones of more."""
    found = _touch(subject, COUNT)
    for count in range(1, COUNT):
        if not _same(found[:count], _touch(subject, count)):
            raise subject.failure(
                f"{count} touches are not the first {count} of {COUNT}",
                "that fewer are a prefix of more",
                "give each touch random numbers of its own: numpy.random.default_rng((seed, number))",
            )


def leaves_inputs(subject: Subject) -> None:
    """The object and its cloud are not changed."""
    item, cloud = _object(subject)
    before = (cloud.copy(), np.array(item.mesh.vertices), np.array(item.mesh.faces))
    subject.built().touches(item, cloud, 1, 0)
    after = (cloud, np.asarray(item.mesh.vertices), np.asarray(item.mesh.faces))
    if not all(np.array_equal(one, other) for one, other in zip(before, after, strict=True)):
        raise subject.failure("it changes the object or its cloud", "that both stay as they are", "work on copies")


def _object(subject: Subject) -> tuple[ShapeItem, Float[np.ndarray, "n 3"]]:
    item = subject.item or egg()
    return item, surface_points(item.mesh, SEEN, np.random.default_rng(0))


def _touch(subject: Subject, count: int, source: Any = None) -> list[Touch]:
    """Touch the object, with seed 7.

    Raises:
        CheckFailed: the source refuses it.
    """
    source = subject.built() if source is None else source
    item, cloud = _object(subject)
    try:
        found: list[Touch] = source.touches(item, cloud, count, 7)
    except UserError as error:
        raise subject.failure(
            f"it refuses {count} touches of '{item.name}': {error}",
            "that it can touch something",
            "give the suite an object that it can touch: checks_for(Part, item=pcsr.ShapeItem(…)), or --mesh FILE",
        ) from error
    return found


def _same(some: list[Touch], others: list[Touch]) -> bool:
    return len(some) == len(others) and all(
        np.array_equal(one.points, other.points)
        and np.array_equal(one.finger, other.finger)
        and np.array_equal(one.poses, other.poses)
        for one, other in zip(some, others, strict=True)
    )
