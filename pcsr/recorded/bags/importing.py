"""Import of touches from bags: a message of each contact, with its pose, becomes a touch of a recording."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.errors import PcsrWarning, UserError
from pcsr.limits import MOST_TOUCHED_POINTS, MOST_TOUCHES
from pcsr.recorded.bags.cloud_topic import CloudTopic
from pcsr.recorded.bags.messages import TopicMessages
from pcsr.recorded.bags.opening import TYPES, Sensor, open_topic
from pcsr.recorded.bags.poses import Advance, Poses, read_poses
from pcsr.recorded.bags.pressed import METRE, Pressed, TactileTopic, sensor_frame
from pcsr.recorded.folder import check_free, manifest_text, write_folder
from pcsr.recorded.pose import in_object, transformed
from pcsr.recorded.writing import write
from pcsr.ros.bag import Bag
from pcsr.ros.topics import Topic
from pcsr.ros.transforms import MAX_GAP, plain

STILL = 1e-6
"""Difference of two poses, in metres and of their rotations, up to which they are equal."""
FAR = 10.0
"""Distance of a sensor from the object's frame in metres from which on the unit may be wrong."""


@dataclass(frozen=True)
class ImportOptions:
    """What is imported from a bag."""

    topic: str
    """Topic of the tactile sensor: PointCloud2, Image or CompressedImage."""
    pose: str
    """Frame of the sensor in tf, or a topic of messages PoseStamped, which begins with a slash."""
    object_frame: str | None = None
    """Frame of the object; by default that of the topic of poses."""
    sensor: Sensor = field(default_factory=Sensor)
    """What is known of the sensor."""
    name: str | None = None
    """Name of the sensor in the recording; the topic's by default."""
    at: Sequence[float] = ()
    """Times of the touches, as in `TopicMessages.nearest`; by default contacts are found."""
    max_gap: float = MAX_GAP
    """Longest time from a touch to the nearest transform, in seconds."""
    pose_error: PoseError | None = None
    """Error of the poses; None if it is unknown."""
    overwrite: bool = False
    """Whether a recording in the folder is replaced."""


@dataclass(frozen=True)
class ImportedTouch:
    """Touch that was imported."""

    name: str
    """Its name in the recording: its time since the start of the bag."""
    points: Float64[np.ndarray, "m 3"]
    """Contact points in the object's frame, in metres."""
    pose: Float64[np.ndarray, "4 4"]
    """Rigid pose of the frame or topic that was named, in the object's frame, in metres."""
    sensor_pose: Float64[np.ndarray, "4 4"]
    """Transform from pcsr's frame of the sensor, in mm, to the object's frame, in metres."""
    pressed: Pressed
    """Contact in pcsr's frame of the sensor."""


def _silent(what: str, done: int, total: int) -> None:
    """Show no progress."""


def import_touches(bag: Bag, folder: Path, options: ImportOptions, advance: Advance = _silent) -> list[ImportedTouch]:
    """Write the touches of a tactile sensor in a bag as a recording.

    Args:
        bag: bag with the messages of the sensor and its poses.
        folder: folder of the recording; it need not exist.
        options: what is imported.
        advance: called while messages are read.

    Returns:
        The touches, in the order of time.

    Raises:
        UserError: a topic or frame is missing, there is no contact, no touch has a pose, or the folder holds a
            recording already. Nothing is written then.
        RunError: a file cannot be written.

    Warns:
        PcsrWarning: a contact is left out, as its pose is not known; or the messages are not as they should be.
    """
    check_free(folder, overwrite=options.overwrite)
    topic = bag.topic(options.topic, TYPES)
    poses = read_poses(bag, options.pose, options.object_frame, options.max_gap, advance)
    messages = TopicMessages(bag, topic, advance)
    first = bag.first(topic.name).content
    reader, axes = open_topic(bag, topic, options.sensor, first, messages.at)
    _check_frame(topic, poses, first)
    if options.at:
        chosen = sorted({messages.nearest(time, "--at") for time in options.at})
    else:
        chosen = messages.contacts(reader)
    if len(chosen) > MOST_TOUCHES:
        raise UserError(f"{topic.name} has {len(chosen)} contacts, and a recording {MOST_TOUCHES} at most: use --at")
    frame = sensor_frame(axes, options.sensor.face or 0.0)
    touches = _touches(messages, reader, poses, frame, chosen, named=bool(options.at))
    _write(folder, touches, reader, options)
    return touches


def _check_frame(topic: Topic, poses: Poses, content: Any) -> None:
    """Warn if messages say that they are in another frame than that of the poses."""
    said = plain(content.header.frame_id)
    if not poses.from_topic and said not in ("", poses.source):
        warnings.warn(
            f"{topic.name}: its messages are in frame '{said}', and are taken as being in '{poses.source}', the frame "
            f"of --pose",
            PcsrWarning,
            stacklevel=3,
        )


def _touches(
    messages: TopicMessages,
    reader: TactileTopic,
    poses: Poses,
    frame: Float64[np.ndarray, "4 4"],
    chosen: Sequence[int],
    *,
    named: bool,
) -> list[ImportedTouch]:
    """Return the touches of some messages.

    Args:
        messages: messages of the sensor's topic.
        reader: reader of their content.
        poses: poses of the sensor.
        frame: pose of pcsr's frame of the sensor in that of the messages, in mm.
        chosen: indices of the messages.
        named: whether a person named these times; then a touch that cannot be read is an error.

    Raises:
        UserError: a named touch cannot be read, or no touch can; or there are too many points.
    """
    found: list[ImportedTouch] = []
    left_out: list[str] = []
    for index in chosen:
        name = messages.name(index)
        try:
            content = messages.content(index)
            pose = poses.at(messages.moments[index].stamp)
            pressed = reader.pressed(content, str(len(found)))
        except UserError as error:
            if named:
                raise UserError(f"{messages.topic.name} at {name}: {error}") from error
            left_out.append(f"the contact at {name} is left out: {error}")
            continue
        if isinstance(reader, CloudTopic) and not found and reader.is_whole_gel(content):
            left_out.append(
                f"{messages.topic.name}: most points of the cloud at {name} lie at the gel's face: if these are clouds "
                f"of the whole gel, give --contact-above"
            )
        sensor_pose = in_object(pose, METRE, METRE) @ frame
        found.append(ImportedTouch(name, transformed(sensor_pose, pressed.points), pose, sensor_pose, pressed))
        if sum(len(one.points) for one in found) > MOST_TOUCHED_POINTS:
            raise UserError(f"the touches have more than {MOST_TOUCHED_POINTS} points: name some of them with --at")
    if not found:
        raise UserError(f"none of the {len(chosen)} contacts can be used: {left_out[0]}")
    for line in [*left_out, *poses.transforms.doubts, *_odd_poses(found, poses)]:
        warnings.warn(line, PcsrWarning, stacklevel=3)
    return found


def _odd_poses(touches: Sequence[ImportedTouch], poses: Poses) -> list[str]:
    """Return what is odd about the poses of touches: they are equal, or far from the object."""
    lines = []
    positions = np.array([one.pose[:3, 3] for one in touches])
    if len(touches) > 1 and all(np.allclose(one.pose, touches[0].pose, atol=STILL) for one in touches):
        lines.append(
            f"all {len(touches)} touches have the same pose, as '{poses.source}' does not move against "
            f"'{poses.target}': is the object at rest in '{poses.target}'?"
        )
    farthest = float(np.linalg.norm(positions, axis=1).max())
    if farthest > FAR:
        lines.append(f"'{poses.source}' is up to {farthest:.4g} m from '{poses.target}': are the poses in metres?")
    return lines


def _write(folder: Path, touches: Sequence[ImportedTouch], reader: TactileTopic, options: ImportOptions) -> None:
    """Write touches as a recording, whole or not at all."""
    name = options.name or reader.sensor or options.topic.strip("/")
    names = [one.name for one in touches]
    if touches[0].pressed.entry is None:
        written = [Touch.single(one.points, one.sensor_pose, METRE, name, one.pressed.area) for one in touches]
        write(folder, written, names, overwrite=options.overwrite, pose_error=options.pose_error)
        return
    keys, files = reader.shared()
    head = {"format": 1, "unit": "mm", "object_unit": "m", "frame": "sensor", "sensor": name} | keys
    entries = []
    for one in touches:
        pose = {"matrix": one.sensor_pose.tolist(), "maps_to": "object_unit"}
        entries.append({"name": one.name, **(one.pressed.entry or {}), "pose": pose})
        files = files | one.pressed.files
    text = manifest_text(head, entries, options.pose_error)
    contents = {file: partial(bytes, content) for file, content in files.items()}
    write_folder(folder, text, contents, overwrite=options.overwrite)
