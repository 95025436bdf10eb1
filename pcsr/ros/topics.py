"""Topics of bags, and how messages to people list them."""

from collections.abc import Collection
from dataclasses import dataclass

from pcsr.errors import printable

MOST_LISTED = 20
"""Most topics that a message lists; further ones are counted."""


@dataclass(frozen=True)
class Topic:
    """Topic of a bag."""

    name: str
    type: str
    """Type of its messages, such as "sensor_msgs/msg/PointCloud2"; in ROS 1 it is written without "msg/"."""
    count: int
    """Number of its messages."""


def listed(topics: Collection[Topic]) -> str:
    """Return the names and types of topics for a message."""
    shown = [printable(f"{one.name} ({short(one.type)})", lines=False) for one in list(topics)[:MOST_LISTED]]
    more = len(topics) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "") if shown else "no topics"


def short(kind: str) -> str:
    """Return the name of a type without "msg", as in ROS 1: "sensor_msgs/Image"."""
    return kind.replace("/msg/", "/")
