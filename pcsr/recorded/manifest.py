"""Strict models of the manifest `touches.json`, and messages about its mistakes. docs/recorded.md describes it."""

from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError, model_validator

from pcsr.clouds.pose_error import MOST_POSITION, MOST_ROTATION, PoseError
from pcsr.errors import UserError
from pcsr.recorded.fields import Axis, Length, NotNegative, Positive, Sign, Strict
from pcsr.recorded.pose_models import EulerPose, MatrixPose, Pose, QuaternionPose
from pcsr.sensors.foreign_heights import Integration
from pcsr.validation_messages import described

Model = TypeVar("Model", bound=BaseModel)
MOST_MISTAKES = 20
"""Greatest number of mistakes of one entry that a message lists; further ones are counted."""


class Entry(Strict):
    """Keys that all touches of one finger have in common."""

    name: str | None = None
    pose: Pose | None = None
    sensor: str | None = None
    """Name of the sensor; that of the recording by default."""


class CloudEntry(Entry):
    """Touch that is recorded as a cloud of touched points."""

    cloud: str | None
    """File of the cloud. None: a finger of a grasp without contact."""
    unit: Length | None = None
    """Unit of the cloud; that of the recording by default."""
    view: Annotated[tuple[Positive, Positive], Field(strict=False)] | None = None
    """Sides of the part of a flat gel that the sensor sees, in mm, along x and y of pcsr's sensor frame."""
    contact_area: NotNegative | None = None
    """Contact area in mm²."""


class HeightEntry(Entry):
    """Touch that is recorded as a height map of the gel's surface."""

    height: str
    mm_per_level: Positive
    mm_per_pixel: Positive
    indentation: Sign
    contact_above: NotNegative | None = None
    """Indentation above which a pixel is in contact, in mm. None: `pcsr.sensors.contact` finds the contact."""
    background: str | None = None
    rest: float | None = None
    """Height of the untouched gel in mm, instead of a background."""
    mask: str | None = None
    integration: Integration = "exact"
    """Program that integrated the heights, if they have to be corrected."""

    @model_validator(mode="after")
    def _one_level(self) -> "HeightEntry":
        if self.rest is not None and self.background is not None:
            raise ValueError("rest and background are both heights of the untouched gel: give one of them")
        if self.rest is not None and self.integration != "exact":
            raise ValueError(f"the heights of {self.integration} have no level, so rest has no meaning: leave it out")
        return self


class Intrinsics(Strict):
    """Intrinsics of a pinhole camera, in pixels."""

    fx: Positive
    fy: Positive
    cx: float
    cy: float


class DepthEntry(Entry):
    """Touch that is recorded as a depth image of a pinhole camera behind the gel."""

    depth: str
    unit: Length
    intrinsics: Intrinsics
    face: Positive
    """Distance from the camera to the gel's face, in mm."""
    contact_above: NotNegative | None = None
    """Indentation above which a pixel is in contact, in mm. None: `pcsr.sensors.contact` finds the contact."""
    background: str | None = None


class ImageEntry(Entry):
    """Touch that is recorded as the camera image of a calibrated sensor."""

    image: str
    background: str | None = None
    """Image of the untouched gel; that of the recording by default."""
    calibration: str | None = None
    """File of the sensor's calibration; that of the recording by default."""


class GraspEntry(Strict):
    """Touch of several fingers at once."""

    fingers: Annotated[list[Any], Field(min_length=1)]
    name: str | None = None
    sensor: str | None = None
    contact_area: NotNegative | None = None
    order: str | None = None
    """File of the order of the grasp's points: indices into the points of all fingers, one finger after another."""


class RecordedPoseError(Strict):
    """Error of the poses of a recording: the fields of `PoseError`."""

    position: Annotated[float, Field(ge=0, le=MOST_POSITION)]
    rotation: Annotated[float, Field(ge=0, le=MOST_ROTATION)]


class Manifest(Strict):
    """Keys of every `touches.json`."""

    format: Literal[1]
    pose_error: RecordedPoseError | None = None
    """Error of the poses; None if it is unknown."""

    @property
    def known_pose_error(self) -> PoseError | None:
        """The error of the poses, as the registration takes it."""
        return None if self.pose_error is None else PoseError(self.pose_error.position, self.pose_error.rotation)


class RecordingManifest(Manifest):
    """Content of `touches.json`. Touches are validated one by one later, so that a bad one does not stop the others."""

    unit: Length
    object_unit: Length
    frame: Literal["sensor", "object"]
    sensor: str
    pose_to: Literal["object", "world"] = "object"
    object_pose: Pose | None = None
    axes: Axis = "-z"
    background: str | None = None
    """Image of the untouched gel for touches that are images."""
    calibration: str | None = None
    """File of the sensor's calibration for touches that are images."""
    touches: Annotated[list[Any], Field(min_length=1)]

    @model_validator(mode="after")
    def _world(self) -> "RecordingManifest":
        if (self.pose_to == "world") != (self.object_pose is not None):
            raise ValueError("pose_to 'world' and object_pose, the object's own pose there, go together: give both")
        return self


class LayoutManifest(Manifest):
    """Content of `touches.json` in a folder that has the layout of another data set."""

    layout: dict[str, Any]


ENTRIES: dict[str, type[Entry] | type[GraspEntry]] = {
    "cloud": CloudEntry,
    "height": HeightEntry,
    "depth": DepthEntry,
    "image": ImageEntry,
    "fingers": GraspEntry,
}


def check_entry(value: Any, place: str, *, in_grasp: bool = False) -> Entry | GraspEntry:
    """Validate the entry of one touch, or of one finger of a grasp.

    Args:
        value: plain data of the entry.
        place: keys of the entry, joined by dots, for messages.
        in_grasp: the entry is a finger of a grasp.

    Raises:
        UserError: the entry has mistakes; the message has one line for each.
    """
    allowed = [key for key in ENTRIES if not (in_grasp and key == "fingers")]
    kinds = [key for key in allowed if isinstance(value, dict) and key in value]
    if len(kinds) != 1:
        found = " and ".join(kinds) or "none"
        raise UserError(f"touches.json: {place}: it has {found} of the keys {', '.join(allowed)}: give exactly one")
    entry = checked(ENTRIES[kinds[0]], value, place)
    if isinstance(entry, CloudEntry) and entry.cloud is None and not in_grasp:
        raise UserError(f"touches.json: {place}.cloud: only a finger of a grasp may have no contact: name a file")
    return entry


def checked(model: type[Model], value: Any, place: str) -> Model:
    """Validate plain data of the manifest.

    Args:
        model: model of the data.
        value: plain data.
        place: keys of the data, joined by dots, for messages; empty for the whole file.

    Raises:
        UserError: the data has mistakes; the message has one line for each.
    """
    try:
        return model.model_validate(value)
    except ValidationError as error:
        mistakes = error.errors(include_url=False)
        lines = [f"touches.json: {_mistake(one, model, place)}" for one in mistakes[:MOST_MISTAKES]]
        if len(mistakes) > MOST_MISTAKES:
            lines.append(f"touches.json: and {len(mistakes) - MOST_MISTAKES} more mistakes")
        raise UserError("\n".join(dict.fromkeys(lines))) from error


def _mistake(one: Any, model: type[BaseModel], place: str) -> str:
    keys = [key for key in one["loc"] if not str(key).startswith("<")]
    path = ".".join(str(key)[:80] for key in [*([place] if place else []), *keys]) or "the file"
    owner = path.rpartition(".")[0] or "the file"
    return described([one], path, owner, _fields(model, one["loc"]))


def _fields(model: type[BaseModel], loc: tuple[Any, ...]) -> list[str]:
    """Return the keys that are allowed at the location of an unknown one."""
    nested: dict[Any, type[BaseModel]] = {
        "<matrix>": MatrixPose,
        "<quaternion>": QuaternionPose,
        "<euler>": EulerPose,
        "intrinsics": Intrinsics,
        "pose_error": RecordedPoseError,
    }
    owners = [nested[key] for key in loc[:-1] if key in nested]
    return list((owners or [model])[-1].model_fields)
