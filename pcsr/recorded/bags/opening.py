"""Choice of the reader of a tactile topic, by its messages and the options that belong to them."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pcsr.errors import PcsrWarning, UserError
from pcsr.inputs import read_bytes
from pcsr.limits import LARGEST_JSON
from pcsr.recorded.bags.cloud_topic import CloudTopic
from pcsr.recorded.bags.colour_topic import ColourTopic
from pcsr.recorded.bags.depth_topic import DepthTopic
from pcsr.recorded.bags.pressed import TactileTopic
from pcsr.recorded.fields import Axis
from pcsr.recorded.images import read_image
from pcsr.recorded.manifest import Intrinsics
from pcsr.ros import images
from pcsr.ros.bag import Bag
from pcsr.ros.images import CAMERA_INFO, COMPRESSED, IMAGE
from pcsr.ros.point_clouds import POINT_CLOUD
from pcsr.ros.topics import Topic, listed
from pcsr.sensors.background import doubt
from pcsr.sensors.calibration import Calibration
from pcsr.sensors.images import read_rgb

T = TypeVar("T")
TYPES = (POINT_CLOUD, IMAGE, COMPRESSED)
"""Types of messages that hold touches."""


@dataclass(frozen=True)
class Sensor:
    """What is known of a tactile sensor beside its messages; each field is the option of its name."""

    axes: Axis | None = None
    """Axis of its frame along which it looks; by default +z for images, as ROS defines it, and -z for clouds."""
    face: float | None = None
    """Distance along that axis from the frame's origin to the gel's face, in mm; needed for depth images, else 0."""
    contact_above: float | None = None
    """Indentation in mm above which there is contact, for clouds and depth images."""
    camera_info: str | None = None
    """Topic of the intrinsics of the camera of depth images; by default `camera_info` beside the topic."""
    calibration: Path | None = None
    """File of the calibration of the camera of images in colour."""
    background: str | None = None
    """Image of the untouched gel: a file, or a time as in `TopicMessages.nearest`; by default the first in colour."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in (("face", self.face), ("contact-above", self.contact_above)):
            if value is not None and not np.isfinite(value):
                raise UserError(f"--{name} {value}: it must be a number of millimetres")


def open_topic(
    bag: Bag, topic: Topic, sensor: Sensor, content: Any, message_at: Callable[[float, str], Any]
) -> tuple[TactileTopic, Axis]:
    """Return the reader of a topic, and the axis along which the sensor looks.

    Args:
        bag: bag of the topic.
        topic: topic with messages of one of `TYPES`.
        sensor: what else is known of the sensor.
        content: content of the topic's first message.
        message_at: returns the content of the message at a time, which an option names.

    Raises:
        UserError: an option is missing, or does not belong to such messages.
    """
    if topic.type == POINT_CLOUD:
        _check_options(topic, "clouds", sensor, ("camera_info", "calibration", "background"))
        axes: Axis = sensor.axes or "-z"
        return CloudTopic(axes, sensor.face or 0.0, sensor.contact_above), axes
    axes = sensor.axes or "+z"
    if topic.type == IMAGE and _named(topic, images.is_depth, content):
        _check_options(topic, "depth images", sensor, ("calibration",))
        return _depth_topic(bag, topic, sensor, content, message_at), axes
    _check_options(topic, "images in colour", sensor, ("camera_info", "contact_above"))
    return _colour_topic(topic, sensor, content, message_at), axes


def _check_options(topic: Topic, what: str, sensor: Sensor, foreign: tuple[str, ...]) -> None:
    for name in foreign:
        if getattr(sensor, name) is not None:
            raise UserError(f"--{name.replace('_', '-')}: {topic.name} has {what}, which take none: leave it out")


def _depth_topic(
    bag: Bag, topic: Topic, sensor: Sensor, content: Any, message_at: Callable[[float, str], Any]
) -> DepthTopic:
    if sensor.face is None or not sensor.face > 0:
        raise UserError(
            f"--face is missing: {topic.name} has depth images: give the gel's distance from the camera in mm"
        )
    depths = _named(topic, images.depth, content)
    background = None
    if sensor.background is not None:
        time = _number(sensor.background)
        if time is not None:
            background = _named(topic, images.depth, message_at(time, "--background"))
        else:
            background = read_image(Path(sensor.background)) * images.DEPTHS[content.encoding][1]
            background[~(background > 0)] = np.nan
        if background.shape != depths.shape:
            raise UserError(
                f"--background: it has {background.shape} rows and columns, and {topic.name} {depths.shape}"
            )
    return DepthTopic(_intrinsics(bag, topic, sensor, depths.shape), sensor.face, sensor.contact_above, background)


def _intrinsics(bag: Bag, topic: Topic, sensor: Sensor, shape: tuple[int, ...]) -> Intrinsics:
    name = sensor.camera_info or f"{topic.name.rpartition('/')[0]}/camera_info"
    if sensor.camera_info is None and name not in bag.topics:
        known = [one for one in bag.topics.values() if one.type == CAMERA_INFO]
        raise UserError(
            f"--camera-info is missing: there is no topic {name} with the intrinsics of {topic.name}: name one of "
            f"those with sensor_msgs/CameraInfo: {listed(known)}"
        )
    about = bag.topic(name, [CAMERA_INFO])
    info = bag.last(about.name).content
    if (info.height, info.width) not in ((0, 0), shape):
        raise UserError(
            f"{name} is of images of {info.width} x {info.height} pixels, and {topic.name} has {shape[1]} x {shape[0]} "
            f"pixels: name the topic of its camera with --camera-info"
        )
    fx, fy, cx, cy = _named(about, images.intrinsics, info)
    return Intrinsics(fx=fx, fy=fy, cx=cx, cy=cy)


def _colour_topic(topic: Topic, sensor: Sensor, content: Any, message_at: Callable[[float, str], Any]) -> ColourTopic:
    if sensor.calibration is None:
        raise UserError(f"--calibration is missing: {topic.name} has images in colour: name the sensor's calibration")
    calibration = Calibration.load(sensor.calibration)
    if sensor.background is None:
        background = _named(topic, images.colours, content)
    else:
        time = _number(sensor.background)
        if time is not None:
            background = _named(topic, images.colours, message_at(time, "--background"))
        else:
            background = read_rgb(Path(sensor.background))
    what = "its first image, taken as the background," if sensor.background is None else "--background"
    _named(topic, lambda image: calibration.check_background(image, what), background)
    if remark := doubt(background, calibration.background, what, calibration.sensor):
        warnings.warn(f"{topic.name}: {remark}", PcsrWarning, stacklevel=2)
    return ColourTopic(calibration, read_bytes(sensor.calibration, most=LARGEST_JSON), background)


def _named(topic: Topic, read: Callable[[Any], T], content: Any) -> T:
    """Read the content of a message; errors name the topic."""
    try:
        return read(content)
    except UserError as error:
        raise UserError(f"{topic.name}: {error}") from error


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
