"""Poses of a sensor in a bag: from the transforms of tf, or from a topic of poses."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from pcsr.errors import UserError
from pcsr.ros.bag import TF, Bag, nanoseconds
from pcsr.ros.transforms import Transforms, listed_frames, plain

POSE = "geometry_msgs/msg/PoseStamped"
"""Type of the messages of a topic of poses."""
TF_TOPIC, STATIC_TOPIC = "/tf", "/tf_static"
Advance = Callable[[str, int, int], None]
"""Function that shows progress: what is done, how much is done, and how much there is."""


@dataclass(frozen=True)
class Poses:
    """Poses of a sensor at any time."""

    transforms: Transforms
    source: str
    """Frame of the sensor, or the topic of its poses."""
    target: str
    """Frame of the object."""
    from_topic: bool
    """Whether the poses are those of a topic."""

    def at(self, stamp: int) -> Float64[np.ndarray, "4 4"]:
        """Return the rigid pose of the sensor in the object's frame at a time in nanoseconds, in metres.

        Raises:
            UserError: it is not known for this time, or is no rigid motion.
        """
        return self.transforms.matrix(self.source, self.target, stamp)


def read_poses(bag: Bag, pose: str, object_frame: str | None, max_gap: float, advance: Advance) -> Poses:
    """Read the poses of a sensor.

    Args:
        bag: bag with them.
        pose: topic of messages geometry_msgs/PoseStamped, which begins with a slash, or frame of the sensor in tf.
        object_frame: frame of the object; by default that of the topic's messages.
        max_gap: longest time to the nearest transform, in seconds.
        advance: called while messages are read.

    Raises:
        UserError: there is no such frame or topic, or no transforms lead to the object.
    """
    if object_frame is not None and plain(pose) == plain(object_frame):
        raise UserError(
            f"--pose and --object-frame are both '{plain(pose)}': name the frame of the sensor, and the frame in which "
            f"the object does not move"
        )
    transforms = Transforms(max_gap)
    if not pose.startswith("/") or pose not in bag.topics:
        _add_tf(bag, transforms, advance)
        if pose.startswith("/") and plain(pose) not in transforms.frames:
            bag.topic(pose, [POSE])  # raises an error with the topics that are there
        if object_frame is None:
            known = listed_frames(transforms.frames)
            raise UserError(f"--object-frame is missing: name the frame of the object or of its cloud: {known}")
        transforms.check(pose, object_frame)
        return Poses(transforms, plain(pose), plain(object_frame), from_topic=False)
    topic = bag.topic(pose, [POSE])
    parents = set()
    for number, message in enumerate(bag.messages([topic.name]), 1):
        parent = message.content.header.frame_id
        parents.add(plain(parent))
        found = message.content.pose
        transforms.add(topic.name, parent, message.stamp, found.position, found.orientation)
        advance(f"reading {topic.name}", number, topic.count)
    target = plain(object_frame) if object_frame is not None else sorted(parents)[0]
    if parents != {target}:
        if object_frame is None:
            raise UserError(f"--object-frame is missing: {topic.name} has poses in {listed_frames(sorted(parents))}")
        _add_tf(bag, transforms, advance)
    transforms.check(topic.name, target)
    return Poses(transforms, topic.name, target, from_topic=True)


def _add_tf(bag: Bag, transforms: Transforms, advance: Advance) -> None:
    """Add all transforms of the bag.

    Raises:
        UserError: it has none.
    """
    names = [name for name in (TF_TOPIC, STATIC_TOPIC) if name in bag.topics and bag.topics[name].count]
    topics = [bag.topic(name, TF) for name in names or [TF_TOPIC]]
    total = sum(topic.count for topic in topics)
    for number, message in enumerate(bag.messages([topic.name for topic in topics]), 1):
        for one in message.content.transforms:
            stamp = None if message.topic == STATIC_TOPIC else nanoseconds(one.header.stamp) or message.received
            moved = one.transform
            transforms.add(one.child_frame_id, one.header.frame_id, stamp, moved.translation, moved.rotation)
        advance("reading transforms", number, total)
