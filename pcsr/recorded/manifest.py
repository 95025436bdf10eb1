"""What a `touches.json` may say: strict models, and their mistakes in plain words. docs/recorded.md explains it."""

from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag, ValidationError, model_validator

from pcsr.errors import UserError
from pcsr.mistakes import described

Model = TypeVar("Model", bound=BaseModel)
MISTAKES = 20
"""The most mistakes of one entry that a message lists; of more, it gives the number."""
UNITS = {"m": 1000.0, "cm": 10.0, "mm": 1.0, "um": 0.001, "in": 25.4}
"""Lengths of the named units, in mm."""


def _length(value: Any) -> Any:
    """A unit's length in mm."""
    if isinstance(value, str):
        if value not in UNITS:
            raise ValueError(f"no unit of that name: {', '.join(UNITS)}, or a number: its length in mm")
        return UNITS[value]
    return value


Length = Annotated[float, Field(gt=0), BeforeValidator(_length)]
Positive = Annotated[float, Field(gt=0, le=1e12)]
NotNegative = Annotated[float, Field(ge=0)]
Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Sign = Literal["positive", "negative"]
Row = Annotated[list[float], Field(min_length=4, max_length=4)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]


class Strict(BaseModel):
    """Unknown keys and other types are mistakes, and so is what is not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class MatrixPose(Strict):
    """A 4x4 matrix that maps sensor coordinates to the object's, or to the world's."""

    matrix: Annotated[list[Row], Field(min_length=4, max_length=4)]
    maps_to: Literal["object_unit", "rigid"] | None = None
    """None: `object_unit` where poses lead to the object, `rigid` where they lead to the world."""


class QuaternionPose(Strict):
    """A rigid pose; its translation is in the recording's unit."""

    translation: Triple
    quaternion: Row
    order: Literal["xyzw", "wxyz"]


class EulerPose(Strict):
    """A rigid pose; its translation is in the recording's unit."""

    translation: Triple
    euler: Annotated[list[float], Field(min_length=1, max_length=3)]
    axes: Annotated[str, Field(pattern=r"^([xyz]{1,3}|[XYZ]{1,3})$")]
    """As scipy takes them: small letters turn about fixed axes, capitals about those that turn along."""
    angle: Literal["degrees", "radians"]


def _kind_of_pose(value: Any) -> str | None:
    kinds = [key for key in ("matrix", "quaternion", "euler") if isinstance(value, dict) and key in value]
    return f"<{kinds[0]}>" if len(kinds) == 1 else None


Pose = Annotated[
    Annotated[MatrixPose, Tag("<matrix>")]
    | Annotated[QuaternionPose, Tag("<quaternion>")]
    | Annotated[EulerPose, Tag("<euler>")],
    Discriminator(
        _kind_of_pose,
        custom_error_type="pose",
        custom_error_message="a pose says one of matrix, quaternion and euler",
    ),
]


class Entry(Strict):
    """What every touch may say."""

    name: str | None = None
    pose: Pose | None = None
    sensor: str | None = None
    """Where it is another than the recording's."""


class CloudEntry(Entry):
    """The points themselves."""

    cloud: str | None
    """None for a finger of a grasp that touched nothing."""
    unit: Length | None = None
    """Of this cloud, where it is another than the recording's."""
    contact_area: NotNegative | None = None
    """In mm²."""


class HeightEntry(Entry):
    """An image of how far the gel's surface has moved."""

    height: str
    mm_per_level: Positive
    mm_per_pixel: Positive
    indentation: Sign
    contact_above: NotNegative
    background: str | None = None
    mask: str | None = None


class Intrinsics(Strict):
    """A pinhole camera, in pixels."""

    fx: Positive
    fy: Positive
    cx: float
    cy: float


class DepthEntry(Entry):
    """An image of distances along the axis of a pinhole camera behind the gel."""

    depth: str
    unit: Length
    intrinsics: Intrinsics
    face: Positive
    """From the camera to the gel's face, in mm."""
    contact_above: NotNegative
    background: str | None = None


class GraspEntry(Strict):
    """Several fingers at once."""

    fingers: Annotated[list[Any], Field(min_length=1)]
    name: str | None = None
    sensor: str | None = None
    contact_area: NotNegative | None = None
    order: str | None = None
    """File with the place of each of the grasp's points among those of its fingers, one finger after the other."""


class Recorded(Strict):
    """The whole file, its touches unread: each is checked by itself, so that a bad one does not stop the others."""

    format: Literal[1]
    unit: Length
    object_unit: Length
    frame: Literal["sensor", "object"]
    sensor: str
    pose_to: Literal["object", "world"] = "object"
    object_pose: Pose | None = None
    axes: Axis = "-z"
    touches: Annotated[list[Any], Field(min_length=1)]

    @model_validator(mode="after")
    def _world(self) -> "Recorded":
        if (self.pose_to == "world") != (self.object_pose is not None):
            raise ValueError("pose_to 'world' and object_pose, the object's own pose there, go together: give both")
        return self


class LayoutManifest(Strict):
    """A folder in somebody else's layout."""

    format: Literal[1]
    layout: dict[str, Any]


ENTRIES: dict[str, type[Entry] | type[GraspEntry]] = {
    "cloud": CloudEntry,
    "height": HeightEntry,
    "depth": DepthEntry,
    "fingers": GraspEntry,
}


def check_entry(value: Any, place: str, *, in_grasp: bool = False) -> Entry | GraspEntry:
    """One touch, or one finger of a grasp.

    Raises:
        UserError: it has mistakes; all of them.
    """
    allowed = [key for key in ENTRIES if not (in_grasp and key == "fingers")]
    kinds = [key for key in allowed if isinstance(value, dict) and key in value]
    if len(kinds) != 1:
        raise UserError(f"touches.json: {place}: it says {_and(kinds)}: it needs one of {', '.join(allowed)}")
    entry = checked(ENTRIES[kinds[0]], value, place)
    if isinstance(entry, CloudEntry) and entry.cloud is None and not in_grasp:
        raise UserError(f"touches.json: {place}.cloud: only a finger of a grasp may have felt nothing: name a file")
    return entry


def checked(model: type[Model], value: Any, place: str) -> Model:
    """A model of plain data.

    Args:
        model: what it should be.
        value: what the file says.
        place: its keys, joined by dots; empty at the top.

    Raises:
        UserError: it has mistakes; one line for each.
    """
    try:
        return model.model_validate(value)
    except ValidationError as error:
        mistakes = error.errors(include_url=False)
        lines = [f"touches.json: {_mistake(one, model, place)}" for one in mistakes[:MISTAKES]]
        lines += [f"touches.json: and {len(mistakes) - MISTAKES} mistakes more"] if len(mistakes) > MISTAKES else []
        raise UserError("\n".join(dict.fromkeys(lines))) from error


def _mistake(one: Any, model: type[BaseModel], place: str) -> str:
    keys = [key for key in one["loc"] if not str(key).startswith("<")]
    path = ".".join(str(key)[:80] for key in [*([place] if place else []), *keys]) or "the file"
    owner = path.rpartition(".")[0] or "the file"
    return described([one], path, owner, _fields(model, one["loc"]))


def _fields(model: type[BaseModel], loc: tuple[Any, ...]) -> list[str]:
    """The keys that are known where an unknown one was found."""
    nested: dict[Any, type[BaseModel]] = {
        "<matrix>": MatrixPose,
        "<quaternion>": QuaternionPose,
        "<euler>": EulerPose,
        "intrinsics": Intrinsics,
    }
    owners = [nested[key] for key in loc[:-1] if key in nested]
    return list((owners or [model])[-1].model_fields)


def _and(words: list[str]) -> str:
    return " and ".join(words) or "none"
