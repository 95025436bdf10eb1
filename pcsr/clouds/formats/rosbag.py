"""Clouds of ROS bags: messages sensor_msgs/PointCloud2 of one topic (extra `[ros]`)."""

from pathlib import Path

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import native, unused
from pcsr.clouds.formats.colours import unpacked
from pcsr.errors import UserError
from pcsr.limits import check_memory
from pcsr.ros.bag import Bag
from pcsr.ros.point_clouds import POINT_CLOUD, coordinates, table
from pcsr.ros.topics import Topic, listed

MEMORY = 4
"""Peak memory of reading a cloud, relative to the size of its message."""


def read(path: Path, topic: str | None) -> Cloud:
    """Read the last cloud of a topic, with all fields.

    `rgb` and `rgba` are unpacked to red, green, blue (and alpha); `normal_x` is renamed to nx. Points that are NaN, as
    pixels without a measurement are, are left out, with a note.

    Args:
        path: the bag, a file or a folder of ROS 2.
        topic: name of the topic; None for the only one with clouds.

    Raises:
        UserError: there is no such topic, several have clouds and none was named, or the cloud is damaged.
    """
    with Bag([path]) as bag:
        chosen = _only(bag) if topic is None else bag.topic(topic, [POINT_CLOUD])
        message = bag.last(chosen.name).content
    check_memory(MEMORY * len(message.data), f"the last cloud of {chosen.name}")
    try:
        rows = table(message)
        points = coordinates(rows)
    except UserError as error:
        raise UserError(f"topic {chosen.name}: {error}") from error
    measured = ~np.isnan(points).any(axis=1)
    notes = []
    if chosen.count > 1:
        notes.append(f"the last of the {chosen.count} clouds of {chosen.name} is read")
    if missing := len(points) - int(measured.sum()):
        notes.append(f"{missing} of {len(points)} points are NaN, as pixels without a measurement, and are left out")
    about = {"rosbag": {"coordinates": rows.dtype["x"].str[1:]}, "notes": tuple(notes)}
    return Cloud(points[measured], _columns(rows[measured]), about)


def _only(bag: Bag) -> Topic:
    found = [one for one in bag.topics.values() if one.type == POINT_CLOUD]
    if len(found) != 1:
        what = f"several topics with clouds: name one, as in {bag.name}:{found[0].name}" if found else "no cloud"
        raise UserError(f"it has {what}; it has {listed(found or bag.topics.values())}")
    return bag.topic(found[0].name, [POINT_CLOUD])


def _columns(rows: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns beside the coordinates, by the names that the Point Cloud Library gives to fields."""
    columns: dict[str, np.ndarray] = {}
    for name in rows.dtype.names or ():
        column = native(rows[name])
        if name in ("x", "y", "z"):
            continue
        if name.lower() in ("rgb", "rgba") and column.dtype.itemsize == 4 and column.ndim == 1:
            colours = unpacked(column)[:, : len(name)]
            for colour, part in zip(("red", "green", "blue", "alpha"), colours.T, strict=False):
                columns[unused(colour, columns)] = np.ascontiguousarray(part)
        else:
            columns[unused(name.replace("normal_", "n") if name[:-1] == "normal_" else name, columns)] = column
    return columns
