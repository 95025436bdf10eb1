"""The description of a graft in the header of a file: its layer and its tactile parts."""

from dataclasses import asdict
from typing import Any, get_args

from pcsr.grafting.grafted import Grafted
from pcsr.grafting.injection_point import InjectionPoint, Order, SeenPoints
from pcsr.recipe.graft_section import Layout, PointsLayout
from pcsr.recipe.old_names import modern_part

WIDEST = 10**6
"""Largest number of channels of a grafted layer."""


def described(grafted: Grafted) -> dict[str, Any]:
    """Return the description of a graft as plain data."""
    return {"injection_point": asdict(grafted.injection_point), **grafted.specs}


def named_parts(card: Any) -> tuple[Any, Any]:
    """Return the names and options of the fusion and the touch encoder that a description names."""
    fusion, encoder = card["fusion"], card["touch_encoder"]
    return (
        modern_part("fusion", fusion) if isinstance(fusion, dict) else fusion,
        modern_part("encoder", encoder) if isinstance(encoder, dict) else encoder,
    )


def point_of(card: Any) -> InjectionPoint:
    """Return the injection point of a description; files of 0.1 call it "joint".

    Raises:
        ValueError: the description is invalid. Other errors are those of `pcsr.weights.file.NONSENSE`.
    """
    written = dict(card.get("injection_point", card.get("joint")))
    if written.get("seen") is not None:
        written["seen"] = SeenPoints(**written["seen"])
    point = InjectionPoint(**written)
    words = isinstance(point.at, str) and isinstance(point.points, int | str)
    layouts = point.layout in get_args(Layout) and point.points_layout in get_args(PointsLayout)
    numbers = (point.width, point.channels, point.multiple)
    counted = all(isinstance(number, int) and 0 < number <= WIDEST for number in numbers)
    counted = counted and point.smallest_batch in (1, 2)
    copies = point.order is None or point.order in get_args(Order)
    if not (words and layouts and counted and copies and _is_valid(point.seen)):
        raise ValueError("its injection point is none")
    return point


def _is_valid(seen: SeenPoints | None) -> bool:
    if seen is None:
        return True
    places = isinstance(seen.module, str) and isinstance(seen.argument, int | str | None)
    return places and seen.layout in get_args(PointsLayout)
