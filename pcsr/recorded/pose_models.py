"""Strict models of the poses in the manifest `touches.json`."""

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from pcsr.recorded.fields import Strict

Row = Annotated[list[float], Field(min_length=4, max_length=4)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]


class MatrixPose(Strict):
    """Pose as a 4x4 matrix that maps sensor coordinates to those of the object or the world."""

    matrix: Annotated[list[Row], Field(min_length=4, max_length=4)]
    maps_to: Literal["object_unit", "rigid"] | None = None
    """Unit of the mapped coordinates. None: `object_unit` if poses lead to the object, `rigid` if to the world."""


class QuaternionPose(Strict):
    """Rigid pose as a translation, in the recording's unit, and a quaternion."""

    translation: Triple
    quaternion: Row
    order: Literal["xyzw", "wxyz"]


class EulerPose(Strict):
    """Rigid pose as a translation, in the recording's unit, and Euler angles."""

    translation: Triple
    euler: Annotated[list[float], Field(min_length=1, max_length=3)]
    axes: Annotated[str, Field(pattern=r"^([xyz]{1,3}|[XYZ]{1,3})$")]
    """Axes in scipy's notation: lower-case letters for fixed axes, upper-case letters for axes that rotate along."""
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
        custom_error_message="a pose has exactly one of the keys matrix, quaternion and euler",
    ),
]
