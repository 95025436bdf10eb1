"""Loop in simulation: ask where to touch next, touch a mesh there, and ask again."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float

from pcsr.clouds.touch import Touch
from pcsr.contracts import Policy, ShapeItem, TouchSource
from pcsr.errors import UserError
from pcsr.exploration.choosing import NextTouch
from pcsr.exploration.next import CANDIDATES, next_touches

POSES = 8
"""Poses of an answer that are tried before the loop ends, since the finger may fail at some."""


@dataclass(frozen=True)
class Exploration:
    """Touches of one object, in the order in which they were made."""

    touches: tuple[Touch, ...]
    unit: float
    """Unit of the object in mm."""
    chosen: tuple[NextTouch, ...]
    """The pose of each touch, with the gain that was expected of it."""
    errors: tuple[float | None, ...]
    """Expected Chamfer distance before each touch, in mm²; None if the policy does not expect any."""
    failed: int
    """Poses at which the housing was in the way, or nothing was met."""


def explore(
    item: ShapeItem,
    source: TouchSource,
    cloud: Float[np.ndarray, "n 3"],
    policy: Policy,
    count: int,
    *,
    candidates: int = CANDIDATES,
    seed: int = 0,
    advance: Callable[[], None] = lambda: None,
) -> Exploration:
    """Touch an object `count` times, each time at the first pose of `pcsr.next_touches` where the finger can touch.

    The policy knows what it knows in use: the cloud and the touches so far, but not the mesh. Where the finger fails,
    the next pose is tried.

    Args:
        item: the object.
        source: touch source with a simulated finger.
        cloud: points that a camera sees, (n 3), in the frame and unit of the object.
        policy: chooses the poses.
        count: number of touches.
        candidates: number of candidates of each answer.
        seed: seed of the candidates and of the sensor's noise.
        advance: called after each touch.

    Returns:
        At most `count` touches: fewer if no pose was left, or the finger failed at all.

    Raises:
        UserError: the source has no simulated finger, or the object or the cloud cannot be touched.
    """
    finger, fingertip = source.finger(item), source.fingertip()
    if finger is None or fingertip is None:
        raise UserError(f"touch source {type(source).__name__} cannot touch at given poses: name another one")
    touches: list[Touch] = []
    chosen: list[NextTouch] = []
    errors: list[float | None] = []
    failed = 0
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        ask = partial(
            next_touches,
            cloud,
            touches,
            sensor=fingertip,
            policy=policy,
            unit=finger.unit,
            candidates=candidates,
            seed=count * seed + number,
            touch_as_is=True,
        )
        made, tried = None, 0
        for asked in (1, POSES):  # the first of several poses is the one of one
            found = ask(count=asked)
            while made is None and tried < len(found):
                made = finger.touch(found[tried].pose, rng)
                tried += 1
            if made is not None:
                break
        failed += tried - (made is not None)
        if made is None:
            break
        touches.append(made)
        chosen.append(found[tried - 1])
        errors.append(found.error)
        advance()
    return Exploration(tuple(touches), finger.unit, tuple(chosen), tuple(errors), failed)
