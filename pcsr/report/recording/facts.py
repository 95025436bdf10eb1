"""Facts about each touch of a recording: its points, depth, area, position, and distance from a cloud."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from pcsr.clouds.touch import Touch
from pcsr.recorded import Recording
from pcsr.recorded.fields import UNITS
from pcsr.recorded.pose import transformed

MOST_MEASURED = 2000
"""Most points of a touch whose distances from the cloud are measured; of more, a regular subset is."""
NUMBERS = frozenset(("points", "depth mm", "area mm²", "cloud mm"))
"""Heads of columns of numbers."""


@dataclass(frozen=True)
class TouchFacts:
    """Facts about one touch."""

    name: str
    sensor: str
    points: int
    depth: float | None
    """Greatest z of its points in the frame of their sensor, in mm; None without a pose."""
    area: float | None
    """Contact area in mm²; None if it is unknown."""
    positions: Float[np.ndarray, "fingers 3"]
    """Position of the sensor of each finger, in the object's unit; empty without a pose."""
    distance: float | None
    """Median distance of its points from the nearest points of the cloud, in mm; None without a cloud."""


def touch_facts(recording: Recording, cloud: Float[np.ndarray, "n 3"] | None = None) -> list[TouchFacts]:
    """Return the facts about each touch of a recording.

    Args:
        recording: the recording.
        cloud: cloud in the frame and unit of the touches.
    """
    tree = None if cloud is None else KDTree(cloud)
    return [_facts(name, touch, tree) for name, touch in zip(recording.names, recording.touches, strict=True)]


def _facts(name: str, touch: Touch, tree: KDTree | None) -> TouchFacts:
    seen = in_sensors(touch)
    distance = None
    if tree is not None:
        measured = touch.points[:: -(-len(touch.points) // MOST_MEASURED)]
        distance = float(np.median(tree.query(measured)[0])) * touch.unit
    return TouchFacts(
        name,
        touch.sensor,
        len(touch.points),
        max((float(points[:, 2].max()) for points in seen if len(points)), default=None),
        touch.contact_area,
        touch.poses[:, :3, 3],
        distance,
    )


def in_sensors(touch: Touch) -> list[Float[np.ndarray, "m 3"]]:
    """Return the points of each finger in the frame of its sensor, in mm; an empty list without poses."""
    return [
        transformed(np.linalg.inv(pose), touch.points[touch.finger == number])
        for number, pose in enumerate(touch.poses)
    ]


def table(facts: Sequence[TouchFacts], unit: float) -> tuple[list[str], list[list[str]]]:
    """Return the heads and the rows of a table of touches.

    Args:
        facts: facts about the touches.
        unit: the object's unit in mm.
    """
    named = next((name for name, length in UNITS.items() if length == unit), f"{unit:g} mm")
    heads = ["touch", "sensor", "points", "depth mm", "area mm²", f"position {named}"]
    measured = any(one.distance is not None for one in facts)
    rows = [
        [
            one.name,
            one.sensor,
            str(one.points),
            _number(one.depth, 2),
            _number(one.area, 1),
            "; ".join(" ".join(f"{x:.4g}" for x in position) for position in one.positions) or "–",
            *([_number(one.distance, 2)] if measured else []),
        ]
        for one in facts
    ]
    return [*heads, *(["cloud mm"] if measured else [])], rows


def _number(value: float | None, decimals: int) -> str:
    return "–" if value is None else f"{value:.{decimals}f}"
